"""Normals of glossy surfaces, from where a pixel's highlight stands among the lamps.

    ln s_l = c + g . h_l,    h_l = (w_l + v) / |w_l + v|,     n = g / |g|

The highlight s is what exceeds the pixel's matte level; around its peak a lobe (n . h)^m is exp(m (n . h - 1)), of
which the logarithm is linear in the half vector. Lindner, Arigita, Puente León: Illumination-based segmentation of
structured surfaces in automated optical inspection. SPIE 5856, 2005, take the direction of the peak itself; the fit
places it between the lamps.
"""

import numpy as np

from analysis.series.photometric_stereo import CONDITION
from interchange.problems import BrightfieldError
from interchange.series import Series


def specular_normals(series: Series, matte: float = 0.5, least: float = 0.15) -> np.ndarray:
    """(H, W, 3) unit, world; NaN where fewer than four lamps show the highlight or their half vectors lie in a line.

    ``matte``: quantile of a pixel's samples that is taken for its matte level. Samples whose highlight is below the
    share ``least`` of its brightest are left out. Raises BrightfieldError for fewer than four lamps.
    """
    if len(series) < 4:
        raise BrightfieldError(f"The direction of a highlight needs four lamps or more; got {len(series)}.")
    y = np.where(series.usable, series.per_irradiance, np.nan).reshape(len(series), -1).astype(np.float64)
    s = y - np.nanquantile(y, matte, axis=0)
    top = np.nanmax(s, axis=0)
    seen = np.nan_to_num(s, nan=-1.0) > least * top
    h = _half_vectors(series)
    # the noise of a logarithm falls with the value
    weight = np.where(seen, s / np.maximum(top, 1e-30), 0.0) ** 2
    log = np.log(np.where(seen, s / np.maximum(top, 1e-30), 1.0))
    design = np.concatenate([h, np.ones((*h.shape[:-1], 1))], axis=-1)
    if design.ndim == 2:
        outer = (design[:, :, None] * design[:, None, :]).reshape(len(design), 16)
        normal, right = (weight.T @ outer).reshape(-1, 4, 4), (weight * log).T @ design
    else:
        normal = np.einsum("ln,lni,lnj->nij", weight, design, design, optimize=True)
        right = np.einsum("ln,lni->ni", weight * log, design)
    values = np.linalg.eigvalsh(normal)
    good = (seen.sum(axis=0) >= 4) & (values[:, 0] > CONDITION * values[:, 3])
    n = np.full((y.shape[1], 3), np.nan)
    g = np.linalg.solve(normal[good], right[good][..., None])[:, :3, 0]
    n[good] = g / np.linalg.norm(g, axis=1, keepdims=True)
    # without a peak the lobe bends the other way: no highlight
    n[np.einsum("nk,nk->n", n, np.nan_to_num(_view(series))) <= 0] = np.nan
    return n.reshape(*series.shape, 3)


def _view(series: Series) -> np.ndarray:
    return np.broadcast_to(series.wo, (*series.shape, 3)).reshape(-1, 3)


def _half_vectors(series: Series) -> np.ndarray:
    """(L, 3) or (L, N, 3)."""
    if series.wi.ndim == 2 and series.wo.ndim == 1:
        h = series.wi + series.wo
    else:
        wi = series.wi if series.wi.ndim == 4 else series.wi[:, None, None]
        h = (wi + series.wo).reshape(len(series), -1, 3)
        if h.shape[1] == 1:
            h = h[:, 0]
    return np.asarray(h / np.linalg.norm(h, axis=-1, keepdims=True), np.float64)

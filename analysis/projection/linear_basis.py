"""Weights of a basis of materials: f = sum_k w_k f_k, for one material, or for every pixel of an image series.

    min_w  sum_n (f_n - sum_k w_k f_k(wi_n, wo_n))² / sigma_n²,    w >= 0 unless asked otherwise

Matusik et al. (SIGGRAPH 2003) take measured materials for the basis, Lensch et al. (EGRW 2001) Lafortune fits of the
materials on an object, with weights that vary over its surface. The result is a ``Sum``; over pixels, with a texture
for every weight. Weights of each channel are free; none adds up to 1 by force.
"""

from collections.abc import Sequence

import numpy as np

from analysis.projection.residual import Projection, prepared, residual, weights
from interchange.brdf.base import Brdf
from interchange.brdf.sum import Sum
from interchange.material import Material, Texture
from interchange.problems import BrightfieldError
from interchange.reflectance import ReflectanceSamples

PIXELS = 4096  # solved at once


def mixture(
    data: ReflectanceSamples | Brdf, basis: Sequence[Brdf], nonnegative: bool = True
) -> Projection[Sum]:
    """``data`` as a weighted sum of ``basis``. Raises BrightfieldError where samples do not tell parts apart."""
    samples = prepared(data)
    weight = weights(samples).T[..., None]  # (3, N, 1)
    design = weight * np.stack([b.evaluate(samples.wi, samples.wo) for b in basis], axis=-1).swapaxes(0, 1)
    right = weight[..., 0] * samples.f.T
    w = _solved(design, right, nonnegative)
    if not np.isfinite(w).all():
        raise BrightfieldError(f"The samples must tell {len(basis)} materials apart; {len(samples)} do not.")
    model = Sum(weight=tuple(map(tuple, w.T)), parts=tuple(basis))
    return Projection(model, residual(model, samples), len(basis))


def weight_maps(
    f: np.ndarray,
    wi: np.ndarray,
    wo: np.ndarray,
    basis: Sequence[Brdf],
    use: np.ndarray | None = None,
    nonnegative: bool = True,
) -> np.ndarray:
    """Weights (H, W, K, 3) of K materials from reflectance ``f`` (H, W, L, 3) under L lights, 1/sr.

    ``wi``, ``wo``: shapes that broadcast to (H, W, L, 3), shading frame; samples with a direction below the surface,
    and those where ``use`` (H, W, L) is False, do not count. NaN where the rest does not tell the basis apart.
    """
    shape = f.shape
    if f.ndim != 4 or shape[-1] != 3:
        raise BrightfieldError(f"Reflectance of pixels must have shape (H, W, L, 3); got {shape}.")
    count = shape[0] * shape[1]
    flat = f.reshape(count, *shape[2:])
    wi, wo = (np.broadcast_to(w, shape).reshape(flat.shape) for w in (wi, wo))
    counted = (wi[..., 2] > 0) & (wo[..., 2] > 0) & np.isfinite(flat).all(axis=-1)
    if use is not None:
        counted &= np.broadcast_to(use, shape[:3]).reshape(counted.shape)
    found = np.empty((count, 3, len(basis)))
    for start in range(0, count, PIXELS):
        rows = slice(start, start + PIXELS)
        on = counted[rows, :, None]
        design = np.stack([np.where(on, b.evaluate(wi[rows], wo[rows]), 0.0) for b in basis], axis=-1)
        right = np.where(on, flat[rows], 0.0)
        found[rows] = _solved(design.swapaxes(1, 2), right.swapaxes(1, 2), nonnegative)
    return found.swapaxes(1, 2).reshape(*shape[:2], len(basis), 3)


def mixed_material(name: str, maps: np.ndarray, basis: Sequence[Brdf]) -> Material:
    """A material with ``weight_maps``' weights (H, W, K, 3) as textures; row 0 is v = 1. NaN becomes 0."""
    maps = np.nan_to_num(maps).astype(np.float32)
    mean = tuple(map(tuple, maps.mean(axis=(0, 1)).tolist()))
    textures = {f"weight{k}": Texture(np.ascontiguousarray(maps[:, :, k])) for k in range(len(basis))}
    return Material(name, Sum(weight=mean, parts=tuple(basis)), textures)


def _solved(design: np.ndarray, right: np.ndarray, nonnegative: bool) -> np.ndarray:
    """(..., K) weights of (..., N, K) columns; NaN where they are not independent."""
    gram = np.einsum("...nk,...nl->...kl", design, design)
    moment = np.einsum("...nk,...n->...k", design, right)
    scale = np.sqrt(np.maximum(np.einsum("...kk->...k", gram), 1e-300))
    gram = gram / (scale[..., None] * scale[..., None, :])
    known = np.linalg.eigvalsh(gram)[..., 0] > 1e-10
    gram = np.where(known[..., None, None], gram, np.eye(gram.shape[-1]))
    moment = moment / scale
    w = least_squares(gram, moment) if nonnegative else np.linalg.solve(gram, moment[..., None])[..., 0]
    return np.where(known[..., None], w / scale, np.nan)


def least_squares(gram: np.ndarray, moment: np.ndarray, most: int = 200) -> np.ndarray:
    """x >= 0 that minimises x'Gx / 2 - m'x, for many (..., K, K) and (..., K) at once, by block principal pivoting.

    Kim, Park: Fast nonnegative matrix factorization: an active-set-like method and comparisons. SIAM J. Sci. Comput.
    2011. Raises BrightfieldError where it does not end, which positive definite G do not allow.
    """
    size = gram.shape[-1]
    g, m = gram.reshape(-1, size, size), moment.reshape(-1, size)
    free = np.ones(m.shape, bool)
    fewest, patience = np.full(len(m), size + 1), np.full(len(m), 3)
    x, last = np.zeros_like(m), 1 << np.arange(size)
    for _ in range(most):
        both = free[:, :, None] & free[:, None, :]
        x = np.linalg.solve(np.where(both, g, np.eye(size)), np.where(free, m, 0.0)[..., None])[..., 0]
        slope = np.einsum("pkl,pl->pk", g, x) - m
        wrong = np.where(free, x < -1e-12, slope < -1e-12 * np.abs(m).max(axis=1, keepdims=True))
        number = wrong.sum(axis=1)
        if not number.any():
            return np.asarray(np.maximum(x, 0.0).reshape(moment.shape))
        better = number < fewest
        patience = np.where(better, 3, patience - 1)
        fewest = np.where(better, number, fewest)
        highest = (wrong * last).max(axis=1)[
            :, None
        ] == last  # the rule that must end, where exchanging all does not
        free ^= np.where((patience >= 0)[:, None], wrong, wrong & highest)
    raise BrightfieldError(f"Nonnegative weights must be found within {most} exchanges; they were not.")

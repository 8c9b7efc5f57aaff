"""Surface normals and albedo from a series, by least squares and by estimators that stand highlights and shadows.

L_l / E_l = rho / pi max(n . w_l, 0)        g = rho / pi n:     least squares of y = W g

least_squares   Woodham: Photometric method for determining surface orientation from multiple images. Opt. Eng. 1980
ranks           the same without a pixel's darkest and brightest lamps. Coleman, Jain: Obtaining 3-dimensional shape
                of textured and specular surfaces using four-source photometry. CGIP 1982, for many lamps
l1              least absolute residuals by reweighting (IRLS). Ikehata et al.: Robust photometric stereo using
                sparse regression. CVPR 2012, their L1 baseline
ransac          the triple of lamps that most others agree with. Fischler, Bolles: Random sample consensus. CACM
                1981; for photometric stereo Mukaigawa et al.: Analysis of photometric factors. JOSA A 2007
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from interchange.problems import BrightfieldError
from interchange.series import Series

LEAST_DETERMINANT = 1e-6  # of three unit directions: of lamps in a plane it is 0
CONDITION = 1e-8  # least over largest eigenvalue of the sum of w wᵀ


class Method(StrEnum):
    LEAST_SQUARES = "least-squares"
    RANKS = "ranks"
    L1 = "l1"
    RANSAC = "ransac"


@dataclass(frozen=True, eq=False)
class SurfaceNormals:
    """``n`` (H, W, 3) unit, world; ``rho`` (H, W) albedo; ``residual`` (H, W) rms over the samples used, in units of
    f cos; ``used`` (H, W) how many. NaN where the usable lamps do not fix a normal."""

    n: np.ndarray
    rho: np.ndarray
    residual: np.ndarray
    used: np.ndarray


def photometric_stereo(
    series: Series,
    method: Method = Method.LEAST_SQUARES,
    shadow: float = 0.0,
    keep: tuple[float, float] = (0.2, 0.7),
    tolerance: float = 0.05,
    triples: int = 120,
    rng: np.random.Generator | None = None,
) -> SurfaceNormals:
    """Normals of every pixel of ``series`` (its grey images; lamps distant or near, as ``wi`` says).

    ``shadow``: samples below this share of a pixel's brightest are taken as shadows and left out. ``keep``: ranks of
    ``ranks``, from darkest 0 to brightest 1. ``tolerance`` of ``ransac``: residuals below this share of rho / pi agree;
    ``triples`` of lamps, drawn by ``rng``. Raises BrightfieldError for fewer than three lamps, or lamps in one plane
    with the origin, from which no normal follows anywhere.
    """
    method = Method(method)
    y = series.per_irradiance.astype(np.float64).reshape(len(series), -1)
    weight = series.usable.reshape(len(series), -1).astype(np.float64)
    y = np.where(weight > 0, y, 0.0)
    w = _directions(series)
    _check(series)
    if shadow > 0:
        weight = weight * (y > shadow * y.max(axis=0))
    match method:
        case Method.RANKS:
            weight = weight * _within(y, weight, keep)
        case Method.L1:
            weight = _reweighted(y, w, weight)
        case Method.RANSAC:
            weight = _agreeing(y, w, weight, tolerance, triples, rng or np.random.default_rng(0))
        case Method.LEAST_SQUARES:
            pass
    g = solve(y, w, weight)
    length = np.linalg.norm(g, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        n = g / length[:, None]
        squares = np.where(weight > 0, (y - predicted(w, g)) ** 2, 0.0) * (weight > 0)
        used = (weight > 0).sum(axis=0)
        residual = np.sqrt(squares.sum(axis=0) / used)
    shape = series.shape
    return SurfaceNormals(
        n.reshape(*shape, 3),
        np.pi * length.reshape(shape),
        np.where(np.isfinite(length), residual, np.nan).reshape(shape),
        used.reshape(shape),
    )


def _directions(series: Series) -> np.ndarray:
    """(L, 3), or (L, N, 3) where lamps are near."""
    if series.wi.ndim == 2:
        return series.wi.astype(np.float64)
    return series.wi.reshape(len(series), -1, 3).astype(np.float64)


def _check(series: Series) -> None:
    values = np.linalg.eigvalsh(series.directions.T @ series.directions)
    if len(series) < 3 or values[0] < CONDITION * values[2]:
        raise BrightfieldError(
            f"A normal needs three lamps or more that are not in one plane with the object; got {len(series)} whose "
            "directions span less."
        )


def predicted(w: np.ndarray, g: np.ndarray) -> np.ndarray:
    """(L, N): w . g of (L, 3) or (L, N, 3) and (N, 3)."""
    return w @ g.T if w.ndim == 2 else np.einsum("lnk,nk->ln", w, g)


def solve(y: np.ndarray, w: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(N, 3): the g that minimises sum_l weight (y - w . g)², by its normal equations; NaN where they are singular."""
    if w.ndim == 2:
        outer = (w[:, :, None] * w[:, None, :]).reshape(len(w), 9)
        normal = (weight.T @ outer).reshape(-1, 3, 3)
        right = (weight * y).T @ w
    else:
        normal = np.einsum("ln,lni,lnj->nij", weight, w, w, optimize=True)
        right = np.einsum("ln,lni->ni", weight * y, w)
    values = np.linalg.eigvalsh(normal)
    good = values[:, 0] > CONDITION * np.maximum(values[:, 2], 1e-300)
    g = np.full((y.shape[1], 3), np.nan)
    g[good] = np.linalg.solve(normal[good], right[good][..., None])[..., 0]
    return g


def _within(y: np.ndarray, weight: np.ndarray, keep: tuple[float, float]) -> np.ndarray:
    """(L, N) bool: samples between two ranks of the usable ones of their pixel; never fewer than 4."""
    low, high = keep
    if not 0 <= low < high <= 1:
        raise BrightfieldError(f"Ranks to keep must rise within [0, 1]; got {low:g}, {high:g}.")
    filled = np.where(weight > 0, y, np.inf)
    rank = np.argsort(np.argsort(filled, axis=0, kind="stable"), axis=0, kind="stable")
    count = (weight > 0).sum(axis=0)
    first = np.floor(low * count)
    last = np.maximum(np.ceil(high * count), np.minimum(first + 4, count))
    return (rank >= first) & (rank < last)


def _reweighted(y: np.ndarray, w: np.ndarray, weight: np.ndarray, steps: int = 40) -> np.ndarray:
    """Weights 1 / |residual|, floored at 1e-3 of the pixel's level, after they have settled."""
    floor = 1e-3 * np.maximum(np.abs(y).max(axis=0), 1e-30)
    out = weight
    before = solve(y, w, out)
    for _ in range(steps):
        residual = np.abs(y - np.maximum(predicted(w, before), 0.0))
        out = weight / np.maximum(residual, floor)
        # a lamp behind the surface says nothing when it is dark, as it must be
        out = np.where(predicted(w, before) < 0, 0.05 * out, out)
        g = solve(y, w, out)
        change = np.linalg.norm(g - before, axis=1) / np.maximum(np.linalg.norm(g, axis=1), 1e-30)
        before = np.where(np.isfinite(g), g, before)
        if np.nanmax(change, initial=0.0) < 1e-6:
            break
    return out


def _agreeing(
    y: np.ndarray,
    w: np.ndarray,
    weight: np.ndarray,
    tolerance: float,
    triples: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """(L, N) of 0 and 1: the samples that agree with the triple of lamps that most agree with."""
    count, pixels = y.shape
    best, out = np.zeros(pixels), weight.copy()
    for _ in range(triples):
        three = rng.choice(count, 3, replace=False)
        if w.ndim == 2:
            if abs(np.linalg.det(w[three])) < 0.05:
                continue
            g = (np.linalg.inv(w[three]) @ y[three]).T
        else:
            system = np.moveaxis(w[three], 0, 1)
            if np.abs(np.linalg.det(system)).min() < 0.02:
                continue
            g = np.linalg.solve(system, y[three].T[..., None])[..., 0]
        model = predicted(w, g)
        limit = tolerance * np.linalg.norm(g, axis=1)
        agree = (weight > 0) & (np.abs(y - model) < limit) & (model > 0)
        # dark lamps behind the surface agree as well, though no normal is found from them
        dark = (weight > 0) & (model <= 0) & (y < limit)
        usable = (weight[three] > 0).all(axis=0)
        score = np.where(usable, agree.sum(axis=0) + 0.5 * dark.sum(axis=0), 0.0)
        better = (score > best) & (agree.sum(axis=0) >= 3)
        best = np.where(better, score, best)
        out[:, better] = agree[:, better]
    return out


def angular_error(n: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(H, W) rad between unit vectors (H, W, 3), by the angle's half: right for tiny ones as well."""
    return np.asarray(2 * np.arcsin(np.clip(np.linalg.norm(n - truth, axis=-1) / 2, 0, 1)))

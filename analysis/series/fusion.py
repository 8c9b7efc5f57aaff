"""One image of best contrast from a series: every place from the lamp that shows its structure best.

    E(l) = - sum_x K(x, l(x)) + λ sum_<x,y> (1 - w_l(x) . w_l(y))      least energy over maps of lamps l(x)

K is the local contrast, the standard deviation of an image in a window over its largest in all images; the second term
keeps the direction of light smooth over the image, so that shading can be read. Puente León: Komplementäre
Bildfusion zur Inspektion technischer Oberflächen. 1997 (the energy functional of Gruna, Irgenfried 2012, 3.2.1), who
minimises by annealing; here by a mean field that is cooled (Geiger, Girosi: Parallel and deterministic algorithms from
MRFs. PAMI 1991): shares q_l(x) of the lamps, with the image fused as sum_l q_l(x) g_l(x) / E_l.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from interchange.problems import BrightfieldError
from interchange.series import Series


@dataclass(frozen=True, eq=False)
class Fused:
    """``image`` (H, W), in units of f cos; ``lamp`` (H, W): the one with the largest share; ``contrast`` (H, W): K of
    that lamp; ``best_single``: the lamp whose image has the largest mean contrast."""

    image: np.ndarray
    lamp: np.ndarray
    contrast: np.ndarray
    best_single: int


def local_contrast(series: Series, window: float = 2.0) -> np.ndarray:
    """(L, H, W) in [0, 1]: standard deviation in a Gaussian window of ``window`` px, over the largest in the series.

    A saturated sample has none.
    """
    y = series.per_irradiance.astype(np.float32)
    y = np.where(series.usable, y, 0.0)
    out = np.stack([local_deviation(image, window) for image in y])
    if series.valid is not None:
        near = np.stack([gaussian_filter((~u).astype(np.float32), window) for u in series.usable])
        out = np.where(near > 0.05, 0.0, out)
    top = float(out.max())
    if not top > 0:
        raise BrightfieldError("The images must have structure to be fused; each is even.")
    return np.asarray(out / top)


def local_deviation(image: np.ndarray, window: float) -> np.ndarray:
    """Standard deviation (H, W) in a Gaussian window of ``window`` px about every pixel of ``image`` (H, W)."""
    centred = image - image.mean()
    mean = gaussian_filter(centred, window)
    return np.sqrt(np.maximum(gaussian_filter(centred**2, window) - mean**2, 0.0))


def fuse(
    series: Series, smoothness: float = 1.0, window: float = 2.0, steps: int = 24, coldest: float = 0.01
) -> Fused:
    """Fuse ``series``. ``smoothness`` λ: 0 takes every pixel's best lamp, a large one the best lamp of all.

    ``window``: px, of the contrast, also of the neighbourhood that is kept smooth.
    """
    K = local_contrast(series, window)
    w = series.directions
    q = shares(K, 1 - w @ w.T, smoothness, window, steps, coldest)
    lamp = np.argmax(q, axis=0)
    y = np.where(series.usable, series.per_irradiance, 0.0)
    return Fused(
        (q * y).sum(axis=0),
        lamp,
        np.take_along_axis(K, lamp[None], axis=0)[0],
        int(np.argmax(K.mean(axis=(1, 2)))),
    )


def shares(
    K: np.ndarray,
    apart: np.ndarray,
    smoothness: float,
    window: float,
    steps: int = 24,
    coldest: float = 0.01,
) -> np.ndarray:
    """q (L, H, W), of 1 in all at every place, by contrasts ``K`` (L, H, W) and how far images lie ``apart`` (L, L)."""
    q = np.full(K.shape, 1 / len(K), np.float32)
    # so hot that all images have a share, and each place knows of all others; then cooled, and nearer and nearer
    hottest, widest = max(1.0, smoothness), max(*K.shape[1:], window)
    for temperature, reach in zip(
        np.geomspace(hottest, coldest, steps), np.geomspace(widest, max(window, 1.0), steps), strict=True
    ):
        field = K
        if smoothness > 0:
            neighbours = np.stack([_blurred(share, reach) for share in q])
            field = K - smoothness * np.tensordot(apart, neighbours, axes=1)
        logits = (field - field.max(axis=0)) / temperature
        q = np.exp(logits)
        q /= q.sum(axis=0)
    return q


def _blurred(share: np.ndarray, reach: float) -> np.ndarray:
    """(H, W) by a Gaussian of ``reach`` px; a broad one on a coarser grid, where it is as good."""
    import cv2

    coarse = int(reach // 3)
    if coarse <= 1:
        return np.asarray(cv2.GaussianBlur(share, (0, 0), reach, borderType=cv2.BORDER_REFLECT))
    height, width = share.shape
    size = -(-width // coarse), -(-height // coarse)
    small = cv2.resize(share, size, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), reach / coarse, borderType=cv2.BORDER_REFLECT)
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR))


def energy(contrast: np.ndarray, lamp: np.ndarray, wi: np.ndarray, smoothness: float) -> float:
    """E of a map of lamps (H, W), the sum over pixels and their right and lower neighbours."""
    own = np.take_along_axis(contrast, lamp[None], axis=0).sum()
    w = wi[lamp]
    pairs = (1 - np.sum(w[1:] * w[:-1], -1)).sum() + (1 - np.sum(w[:, 1:] * w[:, :-1], -1)).sum()
    return float(smoothness * pairs - own)

"""Convolution with a point-spread function that changes over the field.

    out(x) = Σ_n Σ_u k_n(u) w_n(x - u) E(x - u)

k_n are the functions at the nodes of a grid, w_n tents that sum to 1: light is shared between nodes where it leaves
and spread by each, so none is lost, and at a node the function is its own. Between nodes it is the mean of four.

Hirsch, Sra, Schölkopf, Harmeling: Efficient filter flow for space-variant multiframe blind deconvolution. CVPR 2010,
in its scattering form.
"""

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np

from interchange.filtering import applied, lagrange, trimmed
from interchange.local import Local

NODES = 11  # along the longer side
RAYS = 4096  # through the pupil, for a function of some pixels
GOLDEN = np.pi * (3 - np.sqrt(5))

PointSpread = Callable[
    [float], np.ndarray
]  # field radius (half the diagonal is 1) -> (n, 2) px: outward, around


def over_field(function: PointSpread, resolution: tuple[int, int], centre: tuple[float, float]) -> Local:
    """The step that spreads light by ``function``, which is hashable and turns with the azimuth about ``centre``
    (column, row)."""
    columns, rows = nodes(*resolution)
    found = kernels(function, resolution, centre)
    half = max(k.shape[0] for k in found.values()) // 2
    together = np.zeros((len(rows), len(columns), 2 * half + 1, 2 * half + 1), np.float32)
    halves = np.zeros((len(rows), len(columns)), np.int64)
    for (i, j), k in found.items():
        h = halves[i, j] = k.shape[0] // 2
        together[i, j, half - h : half + h + 1, half - h : half + h + 1] = k
    return Local(half, half, (partial(_spread, columns, rows, together, halves),))


def _spread(
    columns: np.ndarray,
    rows: np.ndarray,
    kernels: np.ndarray,
    halves: np.ndarray,
    plane: np.ndarray,
    low: int,
    height: int,
    out: np.ndarray,
    start: int,
    pad: int,
) -> None:
    from interchange import spread_kernels  # Numba comes with it

    spread_kernels.spread(plane, low, height, out, start, columns, rows, kernels, halves, pad)


def spread_over_field(
    pixels: np.ndarray, function: PointSpread, resolution: tuple[int, int], centre: tuple[float, float]
) -> np.ndarray:
    """``pixels`` (H, W, C) float32 through ``function``."""
    return applied(pixels, [over_field(function, resolution, centre)])


def kernel(offsets: np.ndarray) -> np.ndarray:
    """(k, k) float32 of rays that arrive at ``offsets`` (n, 2) px (column, row), their centroid put in the middle.

    Rays are shared between five pixels a side by Lagrange's weights: moments to the fourth are the rays' own, and a
    blur that is smaller than a pixel takes as much from an edge as its variance says.
    """
    offsets = offsets - offsets.mean(axis=0)
    half = int(np.ceil(np.abs(offsets).max(initial=0))) + 2
    size = 2 * half + 1
    (j, across), (i, down) = lagrange(offsets[:, 0] + half), lagrange(offsets[:, 1] + half)
    out = np.zeros(size * size)
    for a in range(5):
        for b in range(5):
            place = (i + a - 2) * size + j + b - 2
            out += np.bincount(place, down[a] * across[b], size * size)
    return trimmed(out.reshape(size, size))


@lru_cache(maxsize=4)
def pupil(count: int = RAYS) -> tuple[np.ndarray, np.ndarray]:
    """Radius (0 .. 1) and azimuth of rays that fill a round pupil evenly: Vogel's spiral."""
    k = np.arange(count)
    return np.sqrt((k + 0.5) / count), k * GOLDEN


def nodes(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    step = max(width, height) / (NODES - 1)
    count = [max(2, round(n / step) + 1) if n > 1 else 1 for n in (width, height)]
    return np.linspace(0, width - 1, count[0]), np.linspace(0, height - 1, count[1])


@lru_cache(maxsize=64)
def kernels(
    function: PointSpread, resolution: tuple[int, int], centre: tuple[float, float]
) -> dict[tuple[int, int], np.ndarray]:
    """By (row, column) of the grid."""
    columns, rows = nodes(*resolution)
    out = {}
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            x, y = column - centre[0], row - centre[1]
            r = np.hypot(x, y)
            c, s = (x / r, y / r) if r > 0 else (1.0, 0.0)
            offsets = function(2 * r / np.hypot(*resolution))
            out[i, j] = kernel(offsets @ np.array([[c, s], [-s, c]]))
    return out

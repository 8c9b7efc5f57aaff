"""Convolution with a point-spread function that changes over the field.

    out(x) = Σ_n Σ_u k_n(u) w_n(x - u) E(x - u)

k_n are the functions at the nodes of a grid, w_n tents that sum to 1: light is shared between nodes where it leaves
and spread by each, so none is lost, and at a node the function is its own. Between nodes it is the mean of four.

Hirsch, Sra, Schölkopf, Harmeling: Efficient filter flow for space-variant multiframe blind deconvolution. CVPR 2010,
in its scattering form.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, partial

import cv2
import numpy as np

from interchange.filtering import BORDER, lagrange, trimmed

NODES = 11  # along the longer side
RAYS = 4096  # through the pupil, for a function of some pixels
GOLDEN = np.pi * (3 - np.sqrt(5))

PointSpread = Callable[
    [float], np.ndarray
]  # field radius (half the diagonal is 1) -> (n, 2) px: outward, around


def spread_over_field(
    pixels: np.ndarray, function: PointSpread, resolution: tuple[int, int], centre: tuple[float, float]
) -> np.ndarray:
    """``pixels`` (H, W, C) float32 through ``function``, which is hashable and turns with the azimuth about
    ``centre`` (column, row)."""
    height, width = pixels.shape[:2]
    columns, rows = _nodes(width, height)
    kernels = _kernels(function, resolution, centre)
    half = max(k.shape[0] for k in kernels.values()) // 2
    across, down = _tents(columns, width, half), _tents(rows, height, half)
    planes = []
    for plane in cv2.split(np.ascontiguousarray(pixels, np.float32)):
        padded = np.asarray(cv2.copyMakeBorder(plane, half, half, half, half, BORDER))
        out = np.zeros(padded.shape, np.float32)
        for i in range(len(rows)):
            row = partial(_share, padded, [kernels[i, j] for j in range(len(columns))], down[i], across)
            for y, x, part in _pool(os.getpid()).map(row, range(len(columns))):
                out[y, x] += part
        planes.append(out[half : half + height, half : half + width])
    return np.ascontiguousarray(np.stack(planes, axis=-1))


Tent = tuple[int, np.ndarray]


def _share(
    padded: np.ndarray, kernels: list[np.ndarray], down: Tent, across: list[Tent], j: int
) -> tuple[slice, slice, np.ndarray]:
    """Where the light of one node goes, and that light, spread."""
    (top, wy), (left, wx), kernel = down, across[j], kernels[j]
    part = padded[top : top + len(wy), left : left + len(wx)] * (wy[:, None] * wx)
    h = kernel.shape[0] // 2
    ends = [
        min(h, room)
        for room in (top, padded.shape[0] - top - len(wy), left, padded.shape[1] - left - len(wx))
    ]
    part = cv2.copyMakeBorder(part, ends[0], ends[1], ends[2], ends[3], cv2.BORDER_CONSTANT)
    part = np.asarray(cv2.filter2D(part, -1, kernel[::-1, ::-1], borderType=cv2.BORDER_CONSTANT))
    y, x = top - ends[0], left - ends[2]
    return slice(y, y + part.shape[0]), slice(x, x + part.shape[1]), part


@lru_cache(maxsize=1)
def _pool(process: int) -> ThreadPoolExecutor:
    """One a process: threads do not outlive a fork."""
    return ThreadPoolExecutor(len(os.sched_getaffinity(0)), "psf")


def kernel(offsets: np.ndarray) -> np.ndarray:
    """(k, k) float32 of rays that arrive at ``offsets`` (n, 2) px (column, row), their centroid put in the middle.

    Rays are shared between pixels by Lagrange's cubic weights: mean, variance and third moments are the rays' own.
    """
    offsets = offsets - offsets.mean(axis=0)
    half = int(np.ceil(np.abs(offsets).max(initial=0))) + 2
    size = 2 * half + 1
    (j, across), (i, down) = lagrange(offsets[:, 0] + half), lagrange(offsets[:, 1] + half)
    out = np.zeros(size * size)
    for a in range(4):
        for b in range(4):
            place = (i + a - 1) * size + j + b - 1
            out += np.bincount(place, down[a] * across[b], size * size)
    return trimmed(out.reshape(size, size))


@lru_cache(maxsize=4)
def pupil(count: int = RAYS) -> tuple[np.ndarray, np.ndarray]:
    """Radius (0 .. 1) and azimuth of rays that fill a round pupil evenly: Vogel's spiral."""
    k = np.arange(count)
    return np.sqrt((k + 0.5) / count), k * GOLDEN


def _nodes(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    step = max(width, height) / (NODES - 1)
    count = [max(2, round(n / step) + 1) if n > 1 else 1 for n in (width, height)]
    return np.linspace(0, width - 1, count[0]), np.linspace(0, height - 1, count[1])


@lru_cache(maxsize=4)
def _kernels(
    function: PointSpread, resolution: tuple[int, int], centre: tuple[float, float]
) -> dict[tuple[int, int], np.ndarray]:
    """By (row, column) of the grid."""
    columns, rows = _nodes(*resolution)
    out = {}
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            x, y = column - centre[0], row - centre[1]
            r = np.hypot(x, y)
            c, s = (x / r, y / r) if r > 0 else (1.0, 0.0)
            offsets = function(2 * r / np.hypot(*resolution))
            out[i, j] = kernel(offsets @ np.array([[c, s], [-s, c]]))
    return out


def _tents(nodes: np.ndarray, size: int, half: int) -> list[Tent]:
    """Of each node where its weights begin in the padded image, and they: 1 at it, 0 at its neighbours."""
    at = np.arange(-half, size + half)
    out = []
    for k in range(len(nodes)):
        weights = np.interp(at, nodes, np.eye(len(nodes))[k]).astype(np.float32)
        there = np.flatnonzero(weights)
        out.append((int(there[0]), weights[there[0] : there[-1] + 1]))
    return out

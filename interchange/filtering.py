"""Convolution and resampling of images (H, W, C) float32, and the point-spread functions of optics.

A rendered pixel is the mean over its own square already: kernels add what the optics do and no second square. Their
sum is 1. Outside the image its border goes on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import cv2
import numpy as np
from scipy.special import ive, j1

from interchange.bands import BAND, each_band
from interchange.local import ROWS, Function, Local, banded

BORDER = cv2.BORDER_REPLICATE
AIRY_REACH = 8.0  # kernel radius in units of λN; the 2.5 % of light that lie outside are folded back
MOST_AIRY = 160  # px
FAINT = 0.1  # of the light: edges between cells that differ by no more are left to straight lines
RIM = 1e-4  # of the light, that one ring of a combined kernel may be left out with
EVEN = 1e-6  # of a kernel's largest weight, that those across from each other differ by at most
SEPARABLE_ERROR = 1e-3  # of a kernel's norm, that its sum of separable kernels may miss


def each_channel(pixels: np.ndarray, kernels: Sequence[np.ndarray]) -> np.ndarray:
    """``pixels`` (H, W, C) convolved: every channel with its own kernel, or all with the only one.

    Kernels (k, k), k odd: the weight of what lies that far to the right and down. Where that is less work they are
    replaced by a sum of separable ones (within ``SEPARABLE_ERROR``).
    """
    height, width, channels = pixels.shape
    pixels = np.ascontiguousarray(pixels, np.float32)
    filters = [_filter(k.tobytes(), k.shape) for k in kernels]
    half = max(k.shape[0] for k in kernels) // 2
    out = np.empty_like(pixels)

    def work(start: int, stop: int) -> None:
        low, high = max(start - half, 0), min(stop + half, height)
        part = pixels[low:high]
        if len(filters) == 1:
            done = _filtered(part, filters[0])
        else:
            planes = [_filtered(p, f) for p, f in zip(cv2.split(part), filters, strict=True)]
            done = np.asarray(cv2.merge(planes))
        out[start:stop] = done.reshape(part.shape)[start - low : stop - low]

    each_band(
        work, height, max(1, width * channels // (1 + half))
    )  # bands that are high beside what they overlap
    return out


def applied(pixels: np.ndarray, steps: Sequence[Local]) -> np.ndarray:
    """``pixels`` (H, W, C) after ``steps``, in bands."""
    pixels = np.ascontiguousarray(pixels, np.float32)
    out = np.empty_like(pixels)

    def work(start: int, stop: int) -> None:
        planes = banded(pixels, steps, start, stop)
        for c, plane in enumerate(planes.channels):
            out[start:stop, :, c] = plane[:, planes.pad : planes.pad + pixels.shape[1]]

    each_band(work, len(pixels), BAND // ROWS)
    return out


def convolution(kernels: Sequence[np.ndarray]) -> Local:
    """``each_channel`` as a step that is run in bands."""
    half = max(k.shape[0] for k in kernels) // 2
    functions = tuple(_convolution(k.tobytes(), k.shape) for k in kernels)
    return Local(half, half + 4, functions)  # 4: taps come in fours, of which the last may have no weight


@lru_cache(maxsize=64)
def _convolution(data: bytes, shape: tuple[int, int]) -> Function | None:
    if shape == (1, 1):
        return None
    by, half = _filter(data, shape), shape[0] // 2
    if isinstance(by, list) and all(np.array_equal(v, v[::-1]) for term in by for v in term):
        size = (half + 4) // 4 * 4
        down, across = (np.zeros((len(by), size), np.float32) for _ in range(2))
        for t, (column, row) in enumerate(by):
            down[t, : half + 1], across[t, : half + 1] = column[half:], row[half:]
        return partial(_separated, across, down)
    kernel = np.frombuffer(data, np.float32).reshape(shape)
    there = np.argwhere(kernel != 0)
    count = (len(there) + 3) // 4 * 4
    offsets, weights = np.zeros((count, 2), np.int64), np.zeros(count, np.float32)
    offsets[: len(there)], weights[: len(there)] = there - half, kernel[there[:, 0], there[:, 1]]
    return partial(_summed, offsets, weights)


def _separated(
    across: np.ndarray,
    down: np.ndarray,
    plane: np.ndarray,
    low: int,
    height: int,
    out: np.ndarray,
    start: int,
    pad: int,
) -> None:
    from interchange import plane_kernels  # Numba comes with it

    plane_kernels.separable(plane, low, height, out, start, across, down, pad)


def _summed(
    offsets: np.ndarray,
    weights: np.ndarray,
    plane: np.ndarray,
    low: int,
    height: int,
    out: np.ndarray,
    start: int,
    pad: int,
) -> None:
    from interchange import plane_kernels

    plane_kernels.taps(plane, low, height, out, start, offsets, weights, pad)


def convolve(pixels: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """``pixels`` (H, W, C), all channels with one kernel."""
    return each_channel(pixels, [kernel])


def convolve_at_once(pixels: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """The same of few pixels (H, W, C) float32, by the thread that asks."""
    return _filtered(pixels, _filter(kernel.tobytes(), kernel.shape)).reshape(pixels.shape)


def combined(kernels: Sequence[np.ndarray]) -> np.ndarray:
    """The one kernel that does what several do one after the other."""
    return _combined(tuple((k.tobytes(), k.shape) for k in kernels))


@lru_cache(maxsize=64)
def _combined(kernels: tuple[tuple[bytes, tuple[int, int]], ...]) -> np.ndarray:
    from scipy.signal import convolve2d  # near a second to import, for cameras of several blurs

    out = np.ones((1, 1))
    for data, shape in kernels:
        out = convolve2d(out, np.frombuffer(data, np.float32).reshape(shape).astype(np.float64))
    return trimmed(out)


def trimmed(kernel: np.ndarray) -> np.ndarray:
    """Without the outer rings that hold less than ``RIM`` of the light each; float32, its sum 1."""
    while len(kernel) > 3 and abs(1 - kernel[1:-1, 1:-1].sum() / kernel.sum()) < RIM:
        kernel = kernel[1:-1, 1:-1]
    return np.ascontiguousarray(kernel / kernel.sum(), np.float32)


Terms = list[tuple[np.ndarray, np.ndarray]]  # columns and rows whose products are summed


def _filtered(part: np.ndarray, by: np.ndarray | Terms) -> np.ndarray:
    if isinstance(by, np.ndarray):
        return part if by.shape == (1, 1) else np.asarray(cv2.filter2D(part, -1, by, borderType=BORDER))
    done = np.asarray(cv2.sepFilter2D(part, -1, by[0][1], by[0][0], borderType=BORDER))
    for column, row in by[1:]:
        cv2.add(done, cv2.sepFilter2D(part, -1, row, column, borderType=BORDER), dst=done)
    return done


@lru_cache(maxsize=64)
def _filter(data: bytes, shape: tuple[int, int]) -> np.ndarray | Terms:
    """The kernel itself, or its terms where they are less work."""
    terms = _separable(data, shape)
    if shape[0] <= 5 or 2 * len(terms) >= shape[0]:
        return np.frombuffer(data, np.float32).reshape(shape)
    return terms


def _separable(data: bytes, shape: tuple[int, int]) -> Terms:
    kernel = np.frombuffer(data, np.float32).reshape(shape).astype(np.float64)
    u, s, v = np.linalg.svd(kernel)
    missed = np.sqrt(np.cumsum((s**2)[::-1])[::-1]) / np.linalg.norm(s)
    rank = max(1, int((missed > SEPARABLE_ERROR).sum()))
    terms = [(u[:, i] * np.sqrt(s[i]), v[i] * np.sqrt(s[i])) for i in range(rank)]
    if np.abs(kernel - kernel[::-1, ::-1]).max() < EVEN * kernel.max():
        # its vectors are symmetric or antisymmetric, as OpenCV's fast paths want them to the last bit
        terms = [(_even(column), _even(row)) for column, row in terms]
    scale = 1 / sum(c.sum() * r.sum() for c, r in terms)  # what the rest missed of the light
    return [((c * scale).astype(np.float32), r.astype(np.float32)) for c, r in terms]


def _even(x: np.ndarray) -> np.ndarray:
    sign = 1 if np.dot(x, x[::-1]) > 0 else -1
    return (x + sign * x[::-1]) / 2


def resample(
    pixels: np.ndarray, column: np.ndarray, row: np.ndarray, step: tuple[float, float] = (1.0, 1.0)
) -> np.ndarray:
    """``pixels`` (H, W, C) at places (h, w), px, exact for parabolas where a place lies about ``step`` px (columns,
    rows) from its neighbour's.

    OpenCV's bilinear ``remap`` rounds places to 1/32 px, and its bicubic (a = -0.75) moves edges by up to 0.05 px.
    Here the bilinear value is corrected by the output's own differences: the first for what was rounded off, the
    second for what linear interpolation between pixels misses, t (1 - t) / 2 of it.
    """
    from interchange import kernels  # Numba comes with it

    column, row = (np.ascontiguousarray(place, np.float32) for place in (column, row))
    height, width = column.shape
    channels = pixels.shape[2]
    out = np.empty((height, width, channels), np.float32)
    source = np.ascontiguousarray(pixels, np.float32)

    def work(start: int, stop: int) -> None:
        low, high = max(start - 1, 0), min(stop + 1, height)
        x, y = column[low:high], row[low:high]
        inside = cv2.remap(source, x, y, cv2.INTER_LINEAR, borderMode=BORDER).reshape(*x.shape, channels)
        around = cv2.copyMakeBorder(inside, int(start == 0), int(stop == height), 1, 1, BORDER)
        kernels.corrected(
            around.reshape(stop - start + 2, width + 2, channels),
            column[start:stop],
            row[start:stop],
            np.array(step, np.float32),
            out[start:stop],
        )

    each_band(work, height, width)
    return out


@dataclass(frozen=True, eq=False)
class Edges:
    """Of cells (H, W, C) those near an edge: ``place`` (H, W) int32, -1 or the number of each, and ``found``
    (n, C, 6) what `interchange.kernels.edges` finds in them."""

    place: np.ndarray
    found: np.ndarray

    def of(self, channel: int) -> "Edges":
        return Edges(self.place, self.found[:, channel : channel + 1])


def edges(cells: np.ndarray) -> Edges:
    """Of ``cells`` (H, W, C), means over squares: where there are sharp edges in them."""
    from interchange import kernels  # Numba comes with it

    cells = np.ascontiguousarray(cells, np.float32)
    around = np.ones((5, 5), np.uint8)  # whose values tell a cell's edge
    high, low = cv2.dilate(cells, around), cv2.erode(cells, around)
    steep = (high - low > FAINT * np.maximum(np.abs(high), np.abs(low))).reshape(cells.shape).any(axis=2)
    rim = np.zeros_like(steep)
    rim[2:-2, 2:-2] = True
    row, column = np.nonzero(steep & rim)
    place = np.full(steep.shape, -1, np.int32)
    place[row, column] = np.arange(len(row), dtype=np.int32)
    return Edges(place, kernels.edges(cells, row, column, FAINT))


def resample_cells(
    cells: np.ndarray, column: np.ndarray, row: np.ndarray, known: Edges | None = None
) -> np.ndarray:
    """``cells`` (H, W, C), means over squares of what may have sharp edges, at places (h, w): means over squares there.

    Where a straight line through a cell, with what lies two cells off on either side of it, gives the cell's mean and
    those of the cells beside it, it is that edge, and the mean over a square between cells is a sum of polygons: exact
    for straight edges. The rest is left to `resample`, which misses up to a fifth of an edge's contrast where places
    lie halfway between cells, and all places within a quarter of a cell: it averages what few samples give cells of
    noise. A place's neighbours lie a cell apart, but for a few per cent. ``known``: `edges` of the
    cells, which take longer than this.

    Youngs: Time-dependent multi-material flow with large fluid distortion. Numerical Methods for Fluid Dynamics, 1982.
    Scardovelli, Zaleski: Analytical relations connecting linear interfaces and volume fractions in rectangular grids.
    Journal of Computational Physics 164, 2000.
    """
    from interchange import kernels  # Numba comes with it

    column, row = (np.ascontiguousarray(place, np.float32) for place in (column, row))
    cells = np.ascontiguousarray(cells, np.float32)
    out = resample(cells, column, row)
    near = edges(cells) if known is None else known

    def work(start: int, stop: int) -> None:
        kernels.with_edges(
            out[start:stop], cells, near.place, near.found, column[start:stop], row[start:stop]
        )

    each_band(work, *column.shape)
    return out


@lru_cache(maxsize=128)
def disc(diameter: float) -> np.ndarray:
    """(k, k) float32: a uniform disc of ``diameter`` px, as a thin lens out of focus draws a point.

    Its variance along each axis is the disc's, diameter² / 16: below three pixels it is a Gaussian of that width, which
    is hard to tell from it; beyond, the sum over pixels of a disc smaller by what that sum adds, 1/12 px².
    """
    if diameter < 3.0:
        return gaussian(diameter / 4)
    radius = np.sqrt(diameter**2 - 4 / 3) / 2
    half = int(np.ceil(radius - 0.5))
    n = 16 if half < 8 else 8
    x = (np.arange((2 * half + 1) * n) + 0.5) / n - (half + 0.5)
    inside = (x[:, None] ** 2 + x[None, :] ** 2 <= radius**2).astype(np.float64)
    cells = inside.reshape(2 * half + 1, n, 2 * half + 1, n).sum(axis=(1, 3))
    return np.ascontiguousarray(cells / cells.sum(), np.float32)


def airy(r: np.ndarray, first_zero: float) -> np.ndarray:
    """Diffraction's point-spread function at radius ``r``, 1 in its middle: (2 J1(v) / v)², v = 3.8317 r / r0.

    ``first_zero`` r0 = 1.2197 λ N. Airy: On the diffraction of an object-glass. Trans. Camb. Phil. Soc. 1835.
    """
    v = 3.831705970207512 * np.asarray(r, np.float64) / first_zero
    safe = np.where(v < 1e-6, 1.0, v)
    return np.where(v < 1e-6, 1.0, (2 * j1(safe) / safe) ** 2)


def diffraction_mtf(nu: np.ndarray) -> np.ndarray:
    """Contrast of a sine at ``nu`` = frequency · λ N: 2/π (arccos ν - ν √(1 - ν²)), 0 beyond 1.

    Goodman: Introduction to Fourier Optics, 3rd ed., 2005, eq. 6-31.
    """
    v = np.clip(nu, 0, 1)
    return np.asarray(2 / np.pi * (np.arccos(v) - v * np.sqrt(1 - v * v)))


@lru_cache(maxsize=32)
def airy_kernel(spread: float) -> np.ndarray:
    """(k, k) float32 with diffraction's contrast at every frequency that pixels can show. ``spread``: λ N in px."""
    if spread <= 0:
        return np.ones((1, 1), np.float32)
    half = min(MOST_AIRY, int(np.ceil(AIRY_REACH * spread)))
    f = np.fft.fftfreq(2 * half + 1)
    kernel = np.fft.fftshift(np.fft.ifft2(diffraction_mtf(spread * np.hypot(f[:, None], f[None, :]))).real)
    kernel = (kernel + kernel.T) / 2
    kernel = (kernel + kernel[::-1, ::-1]) / 2
    return np.ascontiguousarray(kernel, np.float32)


@lru_cache(maxsize=32)
def gaussian(sigma: float) -> np.ndarray:
    """(k, k) float32, rms ``sigma`` px along each axis: e^(-σ²) I_n(σ²), the Gaussian's twin on whole pixels.

    Its variance is σ² for every σ, where samples of a Gaussian lose it below half a pixel. Lindeberg: Scale-space for
    discrete signals. PAMI 12(3), 1990.
    """
    if sigma <= 0:
        return np.ones((1, 1), np.float32)
    half = int(np.ceil(4 * sigma)) + 1
    g = ive(np.abs(np.arange(-half, half + 1)), sigma**2)
    return np.ascontiguousarray(np.outer(g, g) / g.sum() ** 2, np.float32)


def line(u: float, v: float, acceleration: float = 0.0) -> np.ndarray:
    """(k, k) float32: a straight path of (u, v) px, around the mean of where it is, whose speed changes by a factor of
    exp(``acceleration``) from its start to its end, evenly by its logarithm.

    Each place is shared between the five pixels a side around the nearest one by Lagrange's weights: moments to the
    fourth are the path's own, and a path shorter than a pixel blurs with the square of its length, as u² / 12 does.
    """
    half = int(np.ceil(max(abs(u), abs(v)) * (1 if acceleration else 1 / 2))) + 2
    t = (np.arange(n := 64 * half) + 0.5) / n
    run = np.expm1(acceleration * t) / np.expm1(acceleration) if acceleration else t  # of the path
    way = run.mean() - run  # from a pixel back to what is there now
    kernel = np.zeros((2 * half + 1, 2 * half + 1))
    (j, across), (i, down) = lagrange(u * way), lagrange(v * way)
    for a in range(5):
        for b in range(5):
            np.add.at(kernel, (i + half + a - 2, j + half + b - 2), down[a] * across[b])
    if not acceleration:
        kernel = (kernel + kernel[::-1, ::-1]) / 2
    return (kernel / kernel.sum()).astype(np.float32)


def lagrange(x: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """The pixel nearest to each place and the weights of five around it, whose moments to the fourth are its own."""
    i = np.rint(x).astype(int)
    t, nodes = x - i, (-2, -1, 0, 1, 2)
    return i, [np.prod([(t - m) / (k - m) for m in nodes if m != k], axis=0) for k in nodes]

"""Convolution and resampling of images (H, W, C) float32, and the point-spread functions of optics.

A rendered pixel is the mean over its own square; kernels are the mean of the point-spread function over squares of
that size, with sum 1. Outside the image its border goes on.
"""

from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np
from scipy.special import j1

BORDER = cv2.BORDER_REPLICATE
AIRY_REACH = 8.0  # kernel radius in units of λN; outside lie 0.2 / AIRY_REACH = 2.5 % of the light
SEPARABLE_ERROR = 1e-3  # of a kernel's norm, that its sum of separable kernels may miss


def each_channel(pixels: np.ndarray, kernels: Sequence[np.ndarray]) -> np.ndarray:
    """Convolve every channel with its own point-symmetric kernel, or all with the only one."""
    if len(kernels) == 1 or all(k is kernels[0] for k in kernels):
        return convolve(pixels, kernels[0])
    planes = [convolve(pixels[..., c : c + 1], k)[..., 0] for c, k in enumerate(kernels)]
    return np.stack(planes, axis=-1)


def convolve(pixels: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """``pixels`` (H, W, C) with a point-symmetric kernel (k, k), k odd; by sums of separable filters where that is
    less work (within ``SEPARABLE_ERROR``)."""
    if kernel.shape == (1, 1):
        return pixels * kernel[0, 0]
    terms = _separable(kernel.tobytes(), kernel.shape)
    k = kernel.shape[0]
    if k <= 5 or 2 * len(terms) >= k:
        out = cv2.filter2D(pixels, -1, kernel, borderType=BORDER)
    else:
        column, row = terms[0]
        out = cv2.sepFilter2D(pixels, -1, row, column, borderType=BORDER)
        for column, row in terms[1:]:
            cv2.add(out, cv2.sepFilter2D(pixels, -1, row, column, borderType=BORDER), dst=out)
    return out.reshape(pixels.shape)


@lru_cache(maxsize=64)
def _separable(data: bytes, shape: tuple[int, int]) -> list[tuple[np.ndarray, np.ndarray]]:
    u, s, v = np.linalg.svd(np.frombuffer(data, np.float32).reshape(shape).astype(np.float64))
    missed = np.sqrt(np.cumsum((s**2)[::-1])[::-1]) / np.linalg.norm(s)
    rank = max(1, int((missed > SEPARABLE_ERROR).sum()))
    terms = [(u[:, i] * np.sqrt(s[i]), v[i] * np.sqrt(s[i])) for i in range(rank)]
    scale = 1 / sum(c.sum() * r.sum() for c, r in terms)  # what the rest missed of the light
    return [((c * scale).astype(np.float32), r.astype(np.float32)) for c, r in terms]


def resample(pixels: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """``pixels`` (H, W, C) at places (h, w), px, bicubic. OpenCV rounds a place to 1/32 px: 0.009 px rms."""
    out = cv2.remap(
        np.ascontiguousarray(pixels, np.float32),
        column.astype(np.float32),
        row.astype(np.float32),
        cv2.INTER_CUBIC,
        borderMode=BORDER,
    )
    return out.reshape(*column.shape, pixels.shape[2])


@lru_cache(maxsize=128)
def disc(diameter: float) -> np.ndarray:
    """(k, k) float32: a uniform disc of ``diameter`` px, as a thin lens out of focus draws a point."""
    radius = diameter / 2
    half = max(0, int(np.ceil(radius - 0.5)))
    n = 16 if half < 8 else 8
    x = (np.arange((2 * half + 1) * n) + 0.5) / n - (half + 0.5)
    inside = (x[:, None] ** 2 + x[None, :] ** 2 <= max(radius, 1e-6) ** 2).astype(np.float64)
    return _binned(inside, n) if inside.any() else np.ones((1, 1), np.float32)


def airy(r: np.ndarray, first_zero: float) -> np.ndarray:
    """Diffraction's point-spread function at radius ``r``, 1 in its middle: (2 J1(v) / v)², v = 3.8317 r / r0.

    ``first_zero`` r0 = 1.2197 λ N. Airy: On the diffraction of an object-glass. Trans. Camb. Phil. Soc. 1835.
    """
    v = 3.831705970207512 * np.asarray(r, np.float64) / first_zero
    safe = np.where(v < 1e-6, 1.0, v)
    return np.where(v < 1e-6, 1.0, (2 * j1(safe) / safe) ** 2)


@lru_cache(maxsize=32)
def airy_kernel(spread: float) -> np.ndarray:
    """(k, k) float32. ``spread``: λ N in px."""
    half = min(64, int(np.ceil(AIRY_REACH * spread)))
    n = int(np.clip(np.ceil(8 / max(spread, 1e-3)), 3, 33)) | 1
    x = (np.arange((2 * half + 1) * n) + 0.5) / n - (half + 0.5)
    return _binned(airy(np.hypot(x[:, None], x[None, :]), 1.2196698912665045 * spread), n)


def line(u: float, v: float) -> np.ndarray:
    """(k, k) float32: a straight path of (u, v) px at constant speed, around its middle."""
    half = int(np.ceil(max(abs(u), abs(v)) / 2 + 0.5))
    t = (np.arange(n := 64 * (half + 1)) + 0.5) / n - 0.5
    kernel = np.zeros((2 * half + 1, 2 * half + 1))
    x, y = u * t + half, v * t + half
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    a, b = y - i, x - j
    for di, dj, w in ((0, 0, (1 - a) * (1 - b)), (0, 1, (1 - a) * b), (1, 0, a * (1 - b)), (1, 1, a * b)):
        inside = w > 0
        np.add.at(kernel, (i[inside] + di, j[inside] + dj), w[inside])
    return (kernel / kernel.sum()).astype(np.float32)


def _binned(fine: np.ndarray, n: int) -> np.ndarray:
    """Sums over n x n cells, scaled to sum 1."""
    k = fine.shape[0] // n
    kernel = fine.reshape(k, n, k, n).sum(axis=(1, 3))
    return np.ascontiguousarray(kernel / kernel.sum(), np.float32)

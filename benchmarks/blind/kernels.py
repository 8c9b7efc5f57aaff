"""Convolution with kernels given on the grid of an image."""

from collections.abc import Callable

import cv2
import numpy as np


def filtered(image: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    return cv2.filter2D(image, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)


def square(n: float) -> tuple[np.ndarray, np.ndarray]:
    m = int(np.ceil(n))
    return np.meshgrid(np.arange(-m, m + 1, dtype=float), np.arange(-m, m + 1, dtype=float))


def keys(t: float) -> np.ndarray:
    """Weights of the pixels at -1, 0, 1, 2 for a place t in [0, 1): they blur nothing, where linear ones add the
    variance t (1 - t). Keys: Cubic convolution interpolation. IEEE ASSP 1981."""
    return 0.5 * np.array([
        -t + 2 * t**2 - t**3, 2 - 5 * t**2 + 3 * t**3, t + 4 * t**2 - 3 * t**3, -(t**2) + t**3
    ])  # fmt: skip


def spread(E: np.ndarray, profile: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """``E`` (h, w, 3) convolved with ``profile`` of the squared distance in px; what falls beside is lost."""
    h, w = E.shape[:2]
    shape = (2 * h, 2 * w)
    i = np.minimum(np.arange(shape[0]), shape[0] - np.arange(shape[0]))
    j = np.minimum(np.arange(shape[1]), shape[1] - np.arange(shape[1]))
    k = profile(i[:, None] ** 2 + j[None, :] ** 2)
    k /= k.sum()
    spectrum = np.fft.rfft2(k)[..., None]
    return np.fft.irfft2(np.fft.rfft2(E, shape, axes=(0, 1)) * spectrum, shape, axes=(0, 1))[:h, :w]

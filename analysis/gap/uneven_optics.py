"""A blur that is not the same everywhere, drawn: its variance has a slope over the image.

    σ²(x, y) = σ0² + corner r² + right x + down y    px²; x, y of half the image's diagonal from its middle

σ0² is ``defocus``'s; less than none is none.
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage
from interchange.filtering import convolve, gaussian
from interchange.image import Image
from interchange.parameter import parameter

APART = 0.1  # px² between two blurs that what lies between is a mean of: 1e-3 of an edge that a Gaussian is
MOST = 8  # blurs


@dataclass(frozen=True)
class UnevenBlur(Effect):
    """Of no scene file: what a diagnosis finds a lens to have, until ``field_blur`` says it."""

    stage = Stage.OPTICS
    order = 41
    source = (
        "Koenderink: The structure of images. Biological Cybernetics 50, 1984 (variances of blurs add up)."
    )
    achromatic = True

    corner: float = parameter(0.0, "a", "px²", -1e4, 1e4, "variance more in the corner")
    right: float = parameter(0.0, "b", "px²", -1e4, 1e4, "variance more half a diagonal to the right")
    down: float = parameter(0.0, "c", "px²", -1e4, 1e4, "variance more half a diagonal down")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        return replace(image, pixels=uneven(image.pixels, 0.0, self.slopes)) if self.is_there else image

    @property
    def slopes(self) -> tuple[float, float, float]:
        return self.corner, self.right, self.down


def uneven(plane: np.ndarray, sigma: float, slopes: tuple[float, float, float], finer: int = 1) -> np.ndarray:
    """(h, w, C) of the whole image, on a grid ``finer`` times finer than the sensor's: means of blurs of the variances
    next to a pixel's own, in which a blurred image is smooth."""
    variance = variances(plane.shape[:2], sigma, slopes)
    low, high = float(variance.min()), float(variance.max())
    count = min(1 + int(np.ceil((high - low) / APART)), MOST)
    levels = np.linspace(low, high, count)
    out = np.zeros(plane.shape, np.float32)
    step = levels[1] - levels[0] if count > 1 else 1.0
    for level in levels:
        share = np.maximum(1 - np.abs(variance - level) / step, 0).astype(np.float32)
        out += share[..., None] * convolve(
            np.ascontiguousarray(plane, np.float32), gaussian(finer * level**0.5)
        )
    return out


def variances(shape: tuple[int, ...], sigma: float, slopes: tuple[float, float, float]) -> np.ndarray:
    """(h, w) px²."""
    column, row = np.meshgrid(np.arange(shape[1]), np.arange(shape[0]))
    x, y = in_image(column, row, (shape[1], shape[0]))
    corner, right, down = slopes
    return np.maximum(sigma**2 + corner * (x**2 + y**2) + right * x + down * y, 0)


def in_image(
    column: np.ndarray, row: np.ndarray, resolution: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels' middles, of half the diagonal from the image's middle."""
    w, h = resolution
    half = 0.5 * float(np.hypot(w, h))
    return (column + 0.5 - w / 2) / half, (row + 0.5 - h / 2) / half

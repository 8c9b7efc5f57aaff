"""A blur that is not the same everywhere, drawn: its variance has a slope over the image.

    σ²(x, y) = σ0² + corner r² + fourth r⁴ + right x + down y    px²; x, y of half the image's diagonal from the axis

σ0² is ``defocus``'s; less than none is none. Round discs of ``field_blur`` are such a blur: of diameter d_0 + d_T r²,
with a variance of its square over 16.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from interchange.bands import BAND, each_band
from interchange.camera import Camera
from interchange.effects.base import Effect, Stage
from interchange.filtering import convolve_at_once, gaussian
from interchange.image import Image
from interchange.parameter import parameter

APART = 0.15  # px, and of the blur, between two blurs that what lies between is a mean of: 0.3 % of an edge at most
TILE = 192  # px: few of the blurs are in one, and what a kernel needs around it is little beside it


class Slopes(NamedTuple):
    """px² that a variance has more of in the corner, by the square and by the fourth power of how far out it is, and
    half a diagonal to the right and down; ``axis``: from the image's middle, of half its diagonal."""

    corner: float = 0.0
    right: float = 0.0
    down: float = 0.0
    fourth: float = 0.0
    axis: tuple[float, float] = (0.0, 0.0)

    @property
    def are_there(self) -> bool:
        return any(self[:4])


EVEN = Slopes()


@dataclass(frozen=True)
class UnevenBlur(Effect):
    """Of no scene file: what a diagnosis finds a lens to have, until ``field_blur`` says it."""

    stage = Stage.OPTICS
    order = 41
    source = (
        "Koenderink: The structure of images. Biological Cybernetics 50, 1984 (variances of blurs add up)."
    )
    achromatic = True

    corner: float = parameter(0.0, "a", "px²", -100, 100, "variance more in the corner")
    fourth: float = parameter(0.0, "f", "px²", -100, 100, "variance more in the corner, by the fourth power")
    right: float = parameter(0.0, "b", "px²", -100, 100, "variance more half a diagonal to the right")
    down: float = parameter(0.0, "c", "px²", -100, 100, "variance more half a diagonal down")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        if not self.is_there:
            return image
        return replace(image, pixels=uneven(image.pixels, 0.0, self.slopes(camera)))

    def slopes(self, camera: Camera) -> Slopes:
        return Slopes(self.corner, self.right, self.down, self.fourth, axis_of(camera))


def uneven(plane: np.ndarray, sigma: float, slopes: Slopes, finer: int = 1) -> np.ndarray:
    """(h, w, C) of the whole image, on a grid ``finer`` times finer than the sensor's: means of blurs of the variances
    next to a pixel's own, in which a blurred image is smooth."""
    from interchange import kernels  # Numba comes with it

    plane = np.ascontiguousarray(plane, np.float32)
    levels, place = _placed(plane.shape[:2], sigma, slopes)
    out = np.zeros(plane.shape, np.float32)

    def work(start: int, stop: int) -> None:
        for left in range(0, plane.shape[1], TILE):
            tile = slice(start, stop), slice(left, left + TILE)
            own = place[tile]
            for k in range(int(own.min()), int(np.ceil(own.max())) + 1):
                kernel = gaussian(finer * float(levels[k]))
                rim = len(kernel) // 2
                rows = slice(max(start - rim, 0), stop + rim)
                columns = slice(max(left - rim, 0), left + TILE + rim)
                wider = convolve_at_once(np.ascontiguousarray(plane[rows, columns]), kernel)
                within = wider[start - rows.start :, left - columns.start :]
                kernels.add_share(out[tile], within, own, k)

    each_band(work, plane.shape[0], BAND // TILE)
    return out


@lru_cache(maxsize=2)
def _placed(shape: tuple[int, int], sigma: float, slopes: Slopes) -> tuple[np.ndarray, np.ndarray]:
    """Rms blurs (k,) px, and where between them each pixel is, (h, w)."""
    variance = variances(shape, sigma, slopes)
    levels = _levels(float(variance.min()) ** 0.5, float(variance.max()) ** 0.5)
    place = np.interp(variance, levels**2, np.arange(len(levels)))
    return levels, place.astype(np.float32)


def _levels(low: float, high: float) -> np.ndarray:
    """Rms blurs, px, from the least to the most."""
    found = [low]
    while found[-1] < high:
        found.append(min(found[-1] + APART * max(1.0, found[-1]), high))
    return np.array(found)


def variances(shape: tuple[int, ...], sigma: float, slopes: Slopes) -> np.ndarray:
    """(h, w) px²."""
    column, row = np.ogrid[: shape[0], : shape[1]][::-1]
    x, y = from_axis(column, row, (shape[1], shape[0]), slopes.axis)
    square = x**2 + y**2
    radial = slopes.corner * square + slopes.fourth * square**2
    return np.asarray(np.maximum(sigma**2 + radial + slopes.right * x + slopes.down * y, 0))


def from_axis(
    column: np.ndarray, row: np.ndarray, resolution: tuple[int, int], axis: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels' middles, of half the diagonal from the axis."""
    w, h = resolution
    half = 0.5 * float(np.hypot(w, h))
    return (column + 0.5 - w / 2) / half - axis[0], (row + 0.5 - h / 2) / half - axis[1]


def axis_of(camera: Camera) -> tuple[float, float]:
    """Where the principal point is, of half the diagonal from the image's middle."""
    K = camera.K
    x, y = from_axis(K[0, 2], K[1, 2], camera.sensor.resolution, (0.0, 0.0))
    return float(x), float(y)

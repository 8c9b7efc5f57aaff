"""Fall-off of image irradiance away from the optical axis.

E(r) = E(0) (1 + a2 r² + a4 r⁴),    r = distance from the principal point / half the image's diagonal
"""

from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.local import Local
from interchange.parameter import parameter


@dataclass(frozen=True)
class Vignetting(Effect):
    stage = Stage.OPTICS
    order = 60
    source = "Goldman: Vignette and exposure calibration and compensation. IEEE PAMI 32(12), 2010."
    identified_by = "A fall-off around the axis that is fixed to the image, whatever is in view."
    confused_with = ("light_beam", "exposure")
    separated_by = (
        "a flat field (an integrating sphere or an evenly lit plate), or the camera turned by 90 degrees"
    )
    pointwise = True
    achromatic = True
    carried_by = carried(a2="lens.vignetting.0", a4="lens.vignetting.1")

    a2: float = parameter(0.0, "a_2", "1", -1, 1, "quadratic fall-off at the image corner")
    a4: float = parameter(0.0, "a_4", "1", -1, 1, "fall-off of fourth order at the image corner")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        K = camera.K
        gain = _gain(self.a2, self.a4, camera.sensor.resolution, (K[0, 2], K[1, 2]))
        rows = gain[image.first_row : image.first_row + len(image.pixels)]
        if image.pixels.shape[2] != 3:
            return replace(image, pixels=image.pixels * rows[..., None])
        from interchange import kernels  # Numba comes with it

        return replace(image, pixels=kernels.times_field(np.ascontiguousarray(image.pixels), rows))

    def local(self, image: Image, camera: Camera) -> Local:
        K, (width, height) = camera.K, camera.sensor.resolution
        unit = float(np.hypot(width / 2, height / 2))
        return Local(0, 0, (partial(_dimmed, np.array([K[0, 2], K[1, 2]]), self.a2, self.a4, unit),))

    @classmethod
    def natural(cls, camera: Camera) -> "Vignetting":
        """The two terms of cos⁴ θ, by which every lens without distortion falls off; exact to r⁴."""
        (w, h), (px, py) = camera.sensor.resolution, camera.sensor.pixel_pitch
        tan2 = ((w * px) ** 2 + (h * py) ** 2) / 4 / camera.lens.focal_length**2
        return cls(a2=-2 * tan2, a4=3 * tan2**2)


def _dimmed(
    centre: np.ndarray,
    a2: float,
    a4: float,
    unit: float,
    plane: np.ndarray,
    low: int,
    height: int,
    out: np.ndarray,
    start: int,
    pad: int,
) -> None:
    from interchange import plane_kernels  # Numba comes with it

    plane_kernels.dimmed(plane, low, height, out, start, centre, a2, a4, unit, pad)


@lru_cache(maxsize=4)
def _gain(a2: float, a4: float, resolution: tuple[int, int], centre: tuple[float, float]) -> np.ndarray:
    r2 = radius2(resolution, centre)
    gain = np.maximum(1 + r2 * (a2 + a4 * r2), 0).astype(np.float32)
    gain.setflags(write=False)
    return gain


def radius2(resolution: tuple[int, int], centre: tuple[float, float]) -> np.ndarray:
    """(H, W): squared distance of every pixel from ``centre`` (column, row), half the image's diagonal being 1."""
    width, height = resolution
    x, y = np.arange(width) - centre[0], np.arange(height) - centre[1]
    return (x[None, :] ** 2 + y[:, None] ** 2) / ((width**2 + height**2) / 4)

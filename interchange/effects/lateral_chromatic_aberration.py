"""Red and blue are imaged larger or smaller than green.

    r_red = r (1 + red + red3 r²),   r_blue = r (1 + blue + blue3 r²)

about the principal point; r = 1 is half the image's diagonal. Green, the second channel, stays.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.filtering import resample
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class LateralChromaticAberration(Effect):
    stage = Stage.OPTICS
    order = 20
    source = (
        "Mallon, Whelan: Calibration and removal of lateral chromatic aberration in images. "
        "Pattern Recognition Letters 28(1), 2007."
    )
    identified_by = "Red and blue edges shift apart along the radius, the more the farther from the axis."
    confused_with = ("lens_distortion", "axial_chromatic_aberration")
    separated_by = "black and white edges in the image's corners"
    carried_by = carried(
        red="lens.lateral_chromatic_aberration.0",
        blue="lens.lateral_chromatic_aberration.1",
        red3="lens.lateral_chromatic_aberration.2",
        blue3="lens.lateral_chromatic_aberration.3",
    )

    red: float = parameter(0.0, "c_R", "1", -0.05, 0.05, "red's magnification over green's, less 1")
    blue: float = parameter(0.0, "c_B", "1", -0.05, 0.05, "blue's magnification over green's, less 1")
    red3: float = parameter(0.0, "d_R", "1", -0.05, 0.05, "what is added to red's at the image corner")
    blue3: float = parameter(0.0, "d_B", "1", -0.05, 0.05, "what is added to blue's at the image corner")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        if image.pixels.shape[2] != 3:
            return image
        K = camera.K
        pixels = image.pixels.copy()
        for channel, c, d in ((0, self.red, self.red3), (2, self.blue, self.blue3)):
            if c or d:
                column, row = _source(c, d, camera.sensor.resolution, (K[0, 2], K[1, 2]))
                pixels[..., channel] = resample(image.pixels[..., channel, None], column, row)[..., 0]
        return replace(image, pixels=pixels)


@lru_cache(maxsize=8)
def _source(
    c: float, d: float, resolution: tuple[int, int], centre: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Where in the image of green the light stands that arrives at each pixel: r of r (1 + c + d r²), by Newton."""
    width, height = resolution
    x, y = np.meshgrid(np.arange(width) - centre[0], np.arange(height) - centre[1])
    there = np.hypot(x, y) / np.hypot(width / 2, height / 2)
    r = there / (1 + c)
    for _ in range(3 if d else 0):
        r -= (r * (1 + c + d * r * r) - there) / (1 + c + 3 * d * r * r)
    scale = np.where(there > 0, r / np.where(there > 0, there, 1), 1)
    return (x * scale + centre[0]).astype(np.float32), (y * scale + centre[1]).astype(np.float32)

"""The scene gives more or less light than its file says, or the shutter is open longer: a factor on all electrons.

A shutter that is open by the same time more than is set, whatever is set, makes short exposures the brighter ones.
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class Exposure(Effect):
    stage = Stage.SENSOR
    order = 10
    source = (
        "EMVA Standard 1288, release 4.0 Linear, 2021, eq. 1: the mean number of photons is linear in time."
    )
    identified_by = (
        "All DN above black are larger by one factor, in every capture, or by more the shorter it is."
    )
    confused_with = ("light_intensity", "response_curve", "saturation")
    separated_by = "the same scene at half and at twice the exposure"
    pointwise = True
    carried_by = carried(delay="sensor.exposure_delay")

    scale: float = parameter(1.0, "a", "1", 0, 1e6, "electrons over those that the camera's numbers give")
    delay: float = parameter(
        0.0, "t_0", "s", -1, 1, "time that the shutter is open beyond the exposure that is set"
    )

    def factor(self, t_exp: float) -> float:
        """Electrons over those that an exposure of ``t_exp`` s gives; none where the shutter does not open."""
        return self.scale * max(1 + self.delay / t_exp, 0.0) if t_exp > 0 else self.scale

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        return replace(image, pixels=image.pixels * np.float32(self.factor(camera.t_exp)))

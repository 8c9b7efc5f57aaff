"""A pixel holds so many electrons and no more; what is above stays in it (blooming is off)."""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class Saturation(Effect):
    stage = Stage.SENSOR
    order = 60
    source = "EMVA Standard 1288, release 4.0 Linear, 2021, section 2.5."
    identified_by = (
        "Nothing is brighter than one level below the highest DN: the histogram ends in a spike there."
    )
    confused_with = ("response_curve", "exposure")
    separated_by = "the same scene at half and at twice the exposure"
    pointwise = True
    always = True
    carried_by = carried(full_well="sensor.full_well")

    full_well: float = parameter(1e4, "µ_e.sat", "e-", 1, 1e9, "electrons that read as the highest DN")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        return replace(image, pixels=np.minimum(image.pixels, np.float32(self.full_well)))

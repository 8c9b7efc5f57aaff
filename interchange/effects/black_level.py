"""The DN of a pixel without electrons; all others are higher or lower by as much, as the gain stays."""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class BlackLevel(Effect):
    stage = Stage.READOUT
    order = 10
    source = "EMVA Standard 1288, release 4.0 Linear, 2021, eq. 4: µ_y = K µ_e + µ_y.dark."
    identified_by = (
        "The same DN everywhere, with the lens covered too; whatever the exposure, or in proportion to it where it is "
        "a dark current."
    )
    confused_with = ("veiling_glare", "ambient_light", "sensor_noise")
    separated_by = "a capture with the lens covered"
    pointwise = True
    carried_by = carried(black_level="sensor.black_level")

    black_level: float = parameter(
        0.0, "µ_y.dark", "DN", -65535, 65535, "DN of no electrons; below 0 the converter cuts it off"
    )

    def on(self, camera: Camera) -> Camera:
        return replace(camera, sensor=camera.sensor.with_black_level(self.black_level))

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        return replace(image, pixels=image.pixels + np.float32(self.black_level))

"""The converter: DN become whole numbers between 0 and 2^bits - 1. Its noise is a uniform one of variance 1/12."""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class Quantization(Effect):
    stage = Stage.READOUT
    order = 20
    source = "EMVA Standard 1288, release 4.0 Linear, 2021, eq. 8, after Widrow 1956."
    identified_by = "Only every so many values of DN occur."
    confused_with = ("jpeg", "sensor_noise", "response_curve")
    separated_by = "a histogram of an evenly lit plate at the camera's full bit depth"
    pointwise = True
    always = True
    carried_by = carried(bits="sensor.bit_depth")

    bits: float = parameter(12, "b", "1", 1, 16, "bits of the converter")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        pixels = np.rint(image.pixels)
        np.clip(pixels, 0, np.float32(2**self.bits - 1), out=pixels)
        return replace(image, pixels=pixels)

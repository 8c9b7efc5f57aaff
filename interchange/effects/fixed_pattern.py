"""Differences between pixels that stay: the gain (PRNU) and the offset (DSNU), the same in every frame of a sensor.

e' = (1 + p(u)) e + d(u),    p ~ N(0, PRNU²), d ~ N(0, DSNU²), white, from the sensor's serial number
"""

import hashlib
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class FixedPattern(Effect):
    stage = Stage.SENSOR
    order = 50
    source = "EMVA Standard 1288, release 4.0 Linear, 2021, section 4."
    pointwise = True
    carried_by = carried(prnu="sensor.prnu", dsnu="sensor.dsnu", serial_number="sensor.serial_number")

    prnu: float = parameter(0.0, "PRNU", "1", 0, 1, "spread of the pixels' gain, rms")
    dsnu: float = parameter(0.0, "DSNU", "e-", 0, 1e6, "spread of the pixels' offset, rms")
    serial_number: str = ""

    @property
    def is_there(self) -> bool:
        return self.prnu > 0 or self.dsnu > 0

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        width, height = camera.sensor.resolution
        shape = (height, width, image.pixels.shape[2])
        rows = slice(image.first_row, image.first_row + len(image.pixels))
        pixels = image.pixels
        if self.prnu:
            pixels = pixels * _pattern(self.serial_number, "gain", shape, 1.0, self.prnu)[rows]
        if self.dsnu:
            pixels = pixels + _pattern(self.serial_number, "offset", shape, 0.0, self.dsnu)[rows]
        return replace(image, pixels=pixels)


@lru_cache(maxsize=8)
def _pattern(serial: str, kind: str, shape: tuple[int, int, int], mean: float, rms: float) -> np.ndarray:
    """(H, W, C) float32, the same for the same serial number and shape whatever was drawn before."""
    seed = hashlib.sha256(f"{kind}:{serial}".encode()).digest()
    rng = np.random.Generator(np.random.SFC64(np.frombuffer(seed, np.uint32).tolist()))
    pattern = rng.standard_normal(shape, np.float32)
    pattern *= np.float32(rms)
    pattern += np.float32(mean)
    pattern.setflags(write=False)
    return pattern

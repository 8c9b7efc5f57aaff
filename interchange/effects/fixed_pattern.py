"""Differences between pixels that stay: the gain (PRNU) and the offset (DSNU), the same in every frame of a sensor.

    e' = (1 + p(u)) e + d(u),    p = p_pixel(u) + p_row(v) + p_column(u), alike d

all normal and white, of rms ``prnu``, ``prnu_row``, ``prnu_column`` and ``dsnu``, ``dsnu_row``, ``dsnu_column``, from
the sensor's serial number. The standard's DSNU1288 is the root of the sum of the three squares, PRNU1288 likewise.
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
    identified_by = "The same pixels are off in captures of different scenes."
    confused_with = ("sensor_noise", "quantization", "hot_pixels")
    separated_by = (
        "two flat fields of different brightness, eight repeats each, and as many with the lens covered"
    )
    pointwise = True
    carried_by = carried(
        prnu="sensor.prnu",
        dsnu="sensor.dsnu",
        serial_number="sensor.serial_number",
        prnu_row="sensor.prnu_row",
        prnu_column="sensor.prnu_column",
        dsnu_row="sensor.dsnu_row",
        dsnu_column="sensor.dsnu_column",
    )

    prnu: float = parameter(0.0, "PRNU", "1", 0, 1, "spread of the pixels' gain, rms")
    dsnu: float = parameter(0.0, "DSNU", "e-", 0, 1e6, "spread of the pixels' offset, rms")
    serial_number: str = ""
    prnu_row: float = parameter(0.0, "PRNU.row", "1", 0, 1, "spread of the rows' gain, rms")
    prnu_column: float = parameter(0.0, "PRNU.col", "1", 0, 1, "spread of the columns' gain, rms")
    dsnu_row: float = parameter(0.0, "DSNU.row", "e-", 0, 1e6, "spread of the rows' offset, rms")
    dsnu_column: float = parameter(0.0, "DSNU.col", "e-", 0, 1e6, "spread of the columns' offset, rms")

    @property
    def gain(self) -> tuple[float, float, float]:
        return self.prnu, self.prnu_row, self.prnu_column

    @property
    def offset(self) -> tuple[float, float, float]:
        return self.dsnu, self.dsnu_row, self.dsnu_column

    @property
    def is_there(self) -> bool:
        return any(self.gain) or any(self.offset)

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        width, height = camera.sensor.resolution
        shape = (height, width, image.pixels.shape[2])
        rows = slice(image.first_row, image.first_row + len(image.pixels))
        pixels = image.pixels
        gain, offset = self.patterns(shape)
        if gain is not None:
            pixels = pixels * gain[rows]
        if offset is not None:
            pixels = pixels + offset[rows]
        return replace(image, pixels=pixels)

    def patterns(self, shape: tuple[int, int, int]) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Gain, about 1, and offset e- of an image (H, W, C); None where all are alike."""
        return (
            _pattern(self.serial_number, "gain", shape, 1.0, self.gain) if any(self.gain) else None,
            _pattern(self.serial_number, "offset", shape, 0.0, self.offset) if any(self.offset) else None,
        )


def stream(serial: str, kind: str) -> np.random.Generator:
    """Random numbers that belong to a sensor, whatever else was drawn before."""
    seed = hashlib.sha256(f"{kind}:{serial}".encode()).digest()
    return np.random.Generator(np.random.SFC64(np.frombuffer(seed, np.uint32).tolist()))


@lru_cache(maxsize=8)
def _pattern(
    serial: str, kind: str, shape: tuple[int, int, int], mean: float, rms: tuple[float, float, float]
) -> np.ndarray:
    """(H, W, C) float32, the same for the same serial number and shape. ``rms``: of pixels, rows, columns."""
    pattern = stream(serial, kind).standard_normal(shape, np.float32)
    pattern *= np.float32(rms[0])
    height, width, channels = shape
    for part, spread, size in zip(("row", "column"), rms[1:], ((height, 1), (1, width)), strict=True):
        if spread:
            drawn = stream(serial, f"{kind} {part}").standard_normal((*size, channels), np.float32)
            pattern += np.float32(spread) * drawn
    pattern += np.float32(mean)
    pattern.setflags(write=False)
    return pattern

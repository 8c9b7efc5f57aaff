"""Colour filters on the pixels: each measures one channel, in a pattern of 2 x 2 (Bayer)."""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.problems import BrightfieldError
from interchange.sensor import Mosaic as Pattern
from interchange.sensor import freeze_word

CHANNEL = {"R": 0, "G": 1, "B": 2}


@dataclass(frozen=True)
class Mosaic(Effect):
    stage = Stage.SENSOR
    order = 30
    source = "Bayer: Color imaging array. US patent 3,971,065, 1976."
    identified_by = "Neighbouring pixels differ with a period of 2 px, on coloured surfaces most."
    confused_with = ("demosaic",)
    separated_by = "an evenly lit coloured plate"
    pointwise = True
    carried_by = carried(pattern="sensor.mosaic")

    pattern: Pattern = Pattern.NONE

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze_word(self, "pattern", Pattern)

    @property
    def is_there(self) -> bool:
        return self.pattern.is_bayer

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        E = image.pixels
        if not self.pattern.is_bayer:
            return image
        if E.shape[2] != 3:
            raise BrightfieldError(f"A colour mosaic needs an image of three channels; got {E.shape[2]}.")
        out = np.empty(E.shape[:2], np.float32)
        for i, j, channel in phases(self.pattern, image.first_row):
            out[i::2, j::2] = E[i::2, j::2, channel]
        return replace(image, pixels=out[..., None])


def phases(pattern: Pattern, first_row: int = 0) -> list[tuple[int, int, int]]:
    """(row, column, channel) of the four places of a pattern, for an image that begins with ``first_row``."""
    return [((i - first_row) % 2, j, CHANNEL[pattern.value[2 * i + j]]) for i in (0, 1) for j in (0, 1)]

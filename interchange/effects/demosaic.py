"""A mosaic becomes an image of three channels: what a pixel does not measure is interpolated, by OpenCV."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.sensor import Demosaic as Method
from interchange.sensor import Mosaic, freeze_word


@dataclass(frozen=True)
class Demosaic(Effect):
    stage = Stage.READOUT
    order = 40
    source = "OpenCV 4.11, cv2.demosaicing: COLOR_Bayer*2RGB (bilinear) and COLOR_Bayer*2RGB_EA (edge aware)."
    identified_by = "Edges have coloured fringes with a period of 2 px."
    confused_with = ("mosaic", "lateral_chromatic_aberration")
    separated_by = "the raw image beside the processed one"
    carried_by = carried(method="sensor.demosaic", pattern="sensor.mosaic")

    method: Method = Method.BILINEAR
    pattern: Mosaic = Mosaic.NONE

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze_word(self, "method", Method)
        freeze_word(self, "pattern", Mosaic)

    @property
    def is_there(self) -> bool:
        return self.pattern.is_bayer and self.method is not Method.NONE

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        if not self.is_there or image.pixels.shape[2] != 1:
            return image
        top = 2**camera.sensor.bit_depth - 1  # white balance may have left it
        raw = np.clip(np.rint(image.pixels[..., 0]), 0, top).astype(np.uint16)
        suffix = "_EA" if self.method is Method.EDGE_AWARE else ""
        code = getattr(cv2, f"COLOR_Bayer{self.pattern.value}2RGB{suffix}")
        return replace(image, pixels=cv2.demosaicing(raw, code).astype(np.float32))

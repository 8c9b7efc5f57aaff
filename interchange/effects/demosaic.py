"""A mosaic becomes an image of three channels: what a pixel does not measure is interpolated, by OpenCV."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.sensor import Demosaic as Method
from interchange.sensor import freeze_word


@dataclass(frozen=True)
class Demosaic(Effect):
    stage = Stage.READOUT
    order = 40
    source = "OpenCV 4.11, cv2.demosaicing: COLOR_Bayer*2RGB (bilinear) and COLOR_Bayer*2RGB_EA (edge aware)."
    always = True
    carried_by = carried(method="sensor.demosaic")

    method: Method = Method.BILINEAR

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze_word(self, "method", Method)

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        pattern = camera.sensor.mosaic
        if self.method is Method.NONE or not pattern.is_bayer or image.pixels.shape[2] != 1:
            return image
        top = 2**camera.sensor.bit_depth - 1  # white balance may have left it
        raw = np.clip(np.rint(image.pixels[..., 0]), 0, top).astype(np.uint16)
        suffix = "_EA" if self.method is Method.EDGE_AWARE else ""
        code = getattr(cv2, f"COLOR_Bayer{pattern.value}2RGB{suffix}")
        return replace(image, pixels=cv2.demosaicing(raw, code).astype(np.float32))

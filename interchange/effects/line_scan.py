"""A line camera under which the object moves: rows of the image are moments, not places.

A rendering of the whole object at square pixels becomes the line camera's image: ``stretch`` is the number of lines
that are taken while the object moves by one pixel (1: encoder and optics fit each other), and each line is the mean
over ``open_share`` of its period, while the object moves on.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage
from interchange.filtering import BORDER, resample
from interchange.image import Image
from interchange.parameter import parameter
from interchange.problems import BrightfieldError


@dataclass(frozen=True)
class LineScan(Effect):
    stage = Stage.OPTICS
    order = 14
    source = "Hui, Wen, Zhang, Li: Line scan camera calibration for fabric imaging. J. Textile Inst. 2013."
    identified_by = "Lengths along the motion differ from those across it by one factor."
    confused_with = ("camera_pose", "geometry")
    separated_by = "a chessboard, scanned"
    achromatic = True

    stretch: float = parameter(1.0, "a", "1", 0.01, 100, "lines a pixel of the object's motion")
    open_share: float = parameter(0.0, "s", "1", 0, 100, "exposure time over the line period")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        pixels = image.pixels
        height, width = pixels.shape[:2]
        if self.open_share:
            travel = self.open_share / self.stretch  # px of the object during a line's exposure
            half = int(np.ceil(travel / 2 + 0.5))
            edges = np.clip(np.arange(-half - 0.5, half + 1), -travel / 2, travel / 2)
            box = (np.diff(edges) / travel).astype(np.float32)
            pixels = cv2.sepFilter2D(pixels, -1, np.ones(1, np.float32), box, borderType=BORDER)
            pixels = pixels.reshape(height, width, -1)
        if self.stretch != 1.0:
            column, row = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
            pixels = resample(
                pixels, column, (row + 0.5) / np.float32(self.stretch) - 0.5, (1.0, 1 / self.stretch)
            )
        return replace(image, pixels=pixels)


def assemble(moments: Sequence[Image], row: int) -> Image:
    """The line camera's image, one line a rendering: row ``row`` of each, in the order of time."""
    if not moments:
        raise BrightfieldError("A line camera's image needs one rendering or more; got none.")
    lines = [m.pixels[row] for m in moments]
    return replace(moments[0], pixels=np.stack(lines), passes={})

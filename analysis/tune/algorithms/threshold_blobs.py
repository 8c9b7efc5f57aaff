"""Blobs: connected pixels whose grey level lies away from the local mean by more than ``threshold``.

    dark:    I < M - threshold     bright:  I > M + threshold     M: mean over a square of ``window`` px

``polarity`` 1 looks for bright ones, -1 for dark ones, and 0 for both. Blobs below ``area`` are dropped.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import cv2
import numpy as np

from analysis.tune.algorithms.base import GREY, Algorithm
from analysis.tune.found import Blobs
from interchange.parameter import parameter, setting


@dataclass(frozen=True)
class ThresholdBlobs(Algorithm):
    finds: ClassVar[type] = Blobs
    source: ClassVar[str] = "Gonzalez, Woods: Digital Image Processing, 10.3.  OpenCV's connected components."

    threshold: float = parameter(20.0, "t", GREY, 1, 150, "step from the local mean")
    window: float = parameter(51.0, "w", "px", 5, 401, "side of the local mean's square")
    sigma: float = parameter(1.0, "σ", "px", 0.3, 4, "blur before, rms")
    area: float = parameter(10.0, "A", "px²", 1, 2000, "least area of a blob")
    polarity: int = setting(0, "p", -1, 1, "dark, either or bright")

    def run(self, image: np.ndarray, near: Any = None) -> Blobs:
        smooth = cv2.GaussianBlur(np.asarray(image, np.float32), (0, 0), self.sigma)
        side = 2 * int(self.window / 2) + 1
        step = smooth - cv2.blur(smooth, (side, side), borderType=cv2.BORDER_REFLECT)
        away = self.polarity * step if self.polarity else np.abs(step)
        count, labels, about, _ = cv2.connectedComponentsWithStats((away > self.threshold).astype(np.uint8))
        keep = about[:, cv2.CC_STAT_AREA] >= self.area
        keep[0] = False
        new = np.zeros(count, np.int32)
        new[keep] = np.arange(1, keep.sum() + 1)
        return Blobs(new[labels])

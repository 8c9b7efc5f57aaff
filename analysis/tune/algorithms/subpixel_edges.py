"""Canny's edges moved to a part of a pixel: to the top of the parabola through |∇| at -1, 0, 1 px along the gradient.

shift = (g₋ - g₊) / (2 (g₋ - 2 g₀ + g₊)),   |shift| <= ``reach``
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import cv2
import numpy as np

from analysis.tune.algorithms.base import GREY, Algorithm
from analysis.tune.algorithms.canny import canny_map, gradient
from analysis.tune.found import Edges
from interchange.parameter import parameter


@dataclass(frozen=True)
class SubpixelEdges(Algorithm):
    finds: ClassVar[type] = Edges
    source: ClassVar[str] = (
        "Devernay: A non-maxima suppression method for edge detection with sub-pixel accuracy. INRIA RR-2724, 1995."
    )

    sigma: float = parameter(1.0, "σ", "px", 0.3, 4, "blur before the gradient, rms")
    high: float = parameter(20.0, "t_h", f"{GREY}/px", 0.3, 100, "gradient that begins an edge")
    low_share: float = parameter(0.4, "t_l / t_h", "1", 0.05, 1, "gradient that continues an edge, over high")
    reach: float = parameter(0.75, "r", "px", 0.1, 1, "largest shift of an edge that counts")

    def run(self, image: np.ndarray, near: Any = None) -> Edges:
        gx, gy = gradient(image, self.sigma)
        row, column = np.nonzero(canny_map(gx, gy, self.low_share * self.high, self.high))
        if not len(row):
            return Edges(np.zeros((0, 2)))
        slope = np.hypot(gx, gy)
        at = np.stack([column, row], axis=-1).astype(np.float64)
        normal = np.stack([gx[row, column], gy[row, column]], axis=-1).astype(np.float64)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        before, middle, after = (
            cv2.remap(
                slope,
                (at[:, :1] + k * normal[:, :1]).astype(np.float32),
                (at[:, 1:] + k * normal[:, 1:]).astype(np.float32),
                cv2.INTER_CUBIC,
            )[:, 0].astype(np.float64)
            for k in (-1, 0, 1)
        )
        bend = before - 2 * middle + after
        with np.errstate(divide="ignore", invalid="ignore"):
            shift = np.where(bend < 0, 0.5 * (before - after) / bend, np.inf)
        good = np.abs(shift) <= self.reach
        return Edges(at[good] + shift[good, None] * normal[good])

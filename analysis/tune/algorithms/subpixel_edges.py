"""Canny's edges moved to a part of a pixel: to the ridge of |∇|, along the gradient n.

    shift = -(n · ∇l) / (nᵀ H n),   l = ln |∇|,   |shift| <= ``reach``

∇l and its second derivatives H come from the quadratic of least squares through 3 x 3 pixels. The slope of a step that
a lens and ``sigma`` have blurred is a Gaussian across the edge, whose logarithm is such a quadratic, so the place has
no bias of its own; a parabola through interpolated |∇| is off by up to 0.13 px.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import cv2
import numpy as np

from analysis.tune.algorithms.base import GREY, Algorithm
from analysis.tune.algorithms.canny import canny_map, gradient
from analysis.tune.found import Edges
from interchange.parameter import parameter

ONE, SLOPE, BEND = (np.array(k, np.float32) for k in ((1, 1, 1), (-1, 0, 1), (1, -2, 1)))


@dataclass(frozen=True)
class SubpixelEdges(Algorithm):
    finds: ClassVar[type] = Edges
    source: ClassVar[str] = (
        "Haralick: Digital step edges from zero crossing of second directional derivatives. PAMI 1984. "
        "Steger: Subpixel-precise extraction of lines and edges. ISPRS 2000."
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
        logarithm = np.log(np.maximum(np.hypot(gx, gy), 1e-3 * self.low_share * self.high))

        def at_edges(along_x: np.ndarray, along_y: np.ndarray, scale: float) -> np.ndarray:
            return (
                cv2.sepFilter2D(logarithm, cv2.CV_32F, along_x, along_y)[row, column].astype(np.float64)
                / scale
            )

        n = np.stack([gx[row, column], gy[row, column]], axis=-1).astype(np.float64)
        n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)
        x, y = n[:, 0], n[:, 1]
        slope = x * at_edges(SLOPE, ONE, 6) + y * at_edges(ONE, SLOPE, 6)
        bend = (
            x * x * at_edges(BEND, ONE, 3)
            + y * y * at_edges(ONE, BEND, 3)
            + 2 * x * y * at_edges(SLOPE, SLOPE, 4)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            shift = np.where(bend < 0, -slope / bend, np.inf)
        good = np.abs(shift) <= self.reach
        return Edges(np.stack([column, row], axis=-1)[good] + shift[good, None] * n[good])

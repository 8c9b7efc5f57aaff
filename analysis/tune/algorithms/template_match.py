"""Template match: the place of the highest normalised cross-correlation, to a part of a pixel by a parabola each way.

``near`` is a ``Pattern``: what to look for, and where its middle is expected.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import cv2
import numpy as np

from analysis.tune.algorithms.base import Algorithm
from analysis.tune.found import Place
from interchange.parameter import parameter


@dataclass(frozen=True, eq=False)
class Pattern:
    """``pixels`` (h, w) grey levels; ``middle`` (column, row) px: where it is expected."""

    pixels: np.ndarray
    middle: tuple[float, float]


@dataclass(frozen=True)
class TemplateMatch(Algorithm):
    finds: ClassVar[type] = Place
    source: ClassVar[str] = "Lewis: Fast normalized cross-correlation. 1995.  OpenCV's TM_CCOEFF_NORMED."

    sigma: float = parameter(0.5, "σ", "px", 0.3, 6, "blur of image and template, rms")
    accept: float = parameter(0.6, "ρ", "1", 0.05, 0.99, "least correlation of a find")
    reach: float = parameter(30.0, "r", "px", 3, 120, "search to every side of the expected place")

    def run(self, image: np.ndarray, near: Any = None) -> Place | None:
        h, w = near.pixels.shape
        column, row = near.middle[0] - (w - 1) / 2, near.middle[1] - (h - 1) / 2
        x0, y0 = (int(np.floor(v - self.reach)) for v in (column, row))
        x1, y1 = int(np.ceil(column + self.reach)) + w, int(np.ceil(row + self.reach)) + h
        x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, image.shape[1]), min(y1, image.shape[0])
        if x1 - x0 < w or y1 - y0 < h:
            return None
        part, pattern = (
            cv2.GaussianBlur(np.ascontiguousarray(p, np.float32), (0, 0), self.sigma)
            for p in (image[y0:y1, x0:x1], near.pixels)
        )
        if np.ptp(pattern) == 0:
            return None
        score = cv2.matchTemplate(part, pattern, cv2.TM_CCOEFF_NORMED)
        _, best, _, (i, j) = cv2.minMaxLoc(score)
        if not np.isfinite(best) or best < self.accept:
            return None
        at = (x0 + i + (w - 1) / 2 + _top(score[j], i), y0 + j + (h - 1) / 2 + _top(score[:, i], j))
        return Place((float(at[0]), float(at[1])))


def _top(row: np.ndarray, k: int) -> float:
    """Of the parabola through three values about the k-th, from it, px."""
    if not 0 < k < len(row) - 1:
        return 0.0
    a, b, c = (float(v) for v in row[k - 1 : k + 2])
    bend = a - 2 * b + c
    return 0.5 * (a - c) / bend if bend < 0 else 0.0

"""Evenness of the light on the part: the 5th over the 95th percentile of its pixels' signals, 1 for even light.

Pixels within 2 px of the part's rim, and those whose surface is seen at more than ``slant``, are left out.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from analysis.optimise.measures.base import Measure
from analysis.optimise.view import Unseen, View
from interchange.parameter import parameter


@dataclass(frozen=True)
class Evenness(Measure):
    best: ClassVar[str] = "high"
    unit: ClassVar[str] = "1"
    worst: ClassVar[float] = 0.0
    meaning: ClassVar[str] = "5th over 95th percentile of the part's signal"

    slant: float = parameter(45.0, "θ", "deg", 0, 90, "largest angle between ray and normal")

    def of(self, view: View) -> float:
        import cv2

        framed = np.pad(view.on_part, 1).astype(np.uint8)  # what lies beyond the image is not the part
        inner = cv2.erode(framed, np.ones((5, 5), np.uint8))[1:-1, 1:-1] > 0
        with np.errstate(invalid="ignore"):
            inner &= view.footprint.slant <= np.radians(self.slant)
        if not inner.any():
            raise Unseen("The part is seen too small for its evenness.")
        low, high = np.percentile(view.signal.electrons[inner], [5, 95])
        return float(low / high) if high > 0 else 0.0

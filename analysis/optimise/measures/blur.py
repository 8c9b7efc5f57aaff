"""Diameter of the disc of confusion on the part, px: a high quantile over its pixels (thin lens)."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from analysis.optimise.measures.base import Measure
from analysis.optimise.view import View
from interchange.parameter import parameter


@dataclass(frozen=True)
class Blur(Measure):
    best: ClassVar[str] = "low"
    unit: ClassVar[str] = "px"
    worst: ClassVar[float] = 100.0
    meaning: ClassVar[str] = "defocus on the part"

    quantile: float = parameter(0.95, "q", "1", 0, 1, "share of the part's pixels that have less")

    def of(self, view: View) -> float:
        return float(np.nanquantile(view.footprint.blur[view.on_part], self.quantile))

"""Step across the part's CAD edges over the noise beside them: |e₊ - e₋| / sqrt(σ₊² + σ₋²), a low quantile of it.

e and σ are means over 1.5 to 3 px on either side. The quantile says that edges must be seen everywhere, not on average.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from analysis.optimise.measures.base import Measure
from analysis.optimise.view import STEP, View
from interchange.parameter import parameter


@dataclass(frozen=True)
class EdgeContrast(Measure):
    best: ClassVar[str] = "high"
    unit: ClassVar[str] = "1"
    worst: ClassVar[float] = 0.0
    meaning: ClassVar[str] = "step across edges over its noise"

    quantile: float = parameter(0.25, "q", "1", 0, 1, "share of the edges that may have less")

    def of(self, view: View) -> float:
        e, s = view.across(view.signal.electrons), view.across(view.signal.sigma**2)
        beside = round(1.5 / STEP) + 1
        step = np.abs(e[:, -beside:].mean(axis=1) - e[:, :beside].mean(axis=1))
        noise = np.sqrt(s[:, -beside:].mean(axis=1) + s[:, :beside].mean(axis=1))
        return float(np.quantile(step / noise, self.quantile))

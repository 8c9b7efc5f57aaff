"""Standard uncertainty of an edge's place by the sensor's noise, µm, where the edge is averaged along ``along`` mm.

    u² = s² / (n Σ_k (de/dx)² / σ²),    n = along / s,    s mm per px

the Cramér-Rao bound of the place of a known profile, samples a pixel apart (Kay: Fundamentals of Statistical Signal
Processing, vol. 1, 1993, section 3.5), a high quantile over the part's CAD edges. An edge that noise cannot tell to
``most`` px counts with that.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from analysis.optimise.measures.base import Measure
from analysis.optimise.view import REACH, STEP, View, squared
from interchange.parameter import parameter


@dataclass(frozen=True)
class Uncertainty(Measure):
    best: ClassVar[str] = "low"
    unit: ClassVar[str] = "µm"
    worst: ClassVar[float] = 1e4
    meaning: ClassVar[str] = "standard uncertainty of an edge's place"
    source: ClassVar[str] = "Kay: Fundamentals of Statistical Signal Processing, vol. 1, 1993, section 3.5."
    log: ClassVar[bool] = True

    along: float = parameter(1.0, "l", "mm", 1e-3, 1e3, "length of edge that is averaged over")
    quantile: float = parameter(0.75, "q", "1", 0, 1, "share of the edges that are told better")
    most: float = parameter(2.0, "m", "px", 0.01, 100, "largest uncertainty of a single profile")

    def of(self, view: View) -> float:
        s = view.across(view.signal.sigma)
        slopes = [np.gradient(view.across(run.electrons), STEP, axis=1) for run in view.signals]
        information = np.sum(squared(slopes) / s**2, axis=1) * STEP  # samples a pixel apart, over ± REACH
        pixels = np.minimum(1 / np.sqrt(np.maximum(information, 1e-30)), min(self.most, REACH))
        column, row = np.rint(view.edges.points).astype(int).T
        scale = view.footprint.across[row, column]
        scale = 1e3 * np.where(np.isnan(scale), np.nanmedian(view.footprint.across), scale)
        n = np.maximum(self.along / scale, 1.0)
        return 1e3 * float(np.quantile(pixels * scale / np.sqrt(n), self.quantile))

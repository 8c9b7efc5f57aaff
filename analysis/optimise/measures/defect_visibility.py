"""Separation of a detector of the plan's defects: d' of the ideal observer who knows what to look for.

    d'² = Σ (e_defect - e_good)² / (σ² + (clutter e_good)²)      over the pixels, σ² the mean of both

``clutter`` is the texture of good parts that the scene does not hold, rms over the signal and white. Two classes that
are d' apart are told apart with area Φ(d' / √2) under the ROC curve.

Barrett, Myers: Foundations of Image Science. 2004, section 13.2.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from analysis.optimise.measures.base import Measure
from analysis.optimise.noise import mean_of
from analysis.optimise.view import View, squared
from interchange.parameter import parameter


@dataclass(frozen=True)
class DefectVisibility(Measure):
    best: ClassVar[str] = "high"
    unit: ClassVar[str] = "1"
    worst: ClassVar[float] = 0.0
    meaning: ClassVar[str] = "separation d' of defective from good"
    source: ClassVar[str] = "Barrett, Myers: Foundations of Image Science. 2004, section 13.2."

    clutter: float = parameter(0.01, "c", "1", 0, 1, "texture of good parts, rms over the signal")

    def of(self, view: View) -> float:
        good, bad = view.signal, mean_of(view.defective_signals)
        variance = (good.sigma**2 + bad.sigma**2) / 2 + (self.clutter * good.electrons) ** 2
        steps = [b.electrons - g.electrons for g, b in zip(view.signals, view.defective_signals, strict=True)]
        return float(np.sqrt(max(float(np.sum(squared(steps) / variance)), 0.0)))

"""What a pixel covers of the part, mm: the median over its pixels, for a surface that faces the camera."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from analysis.optimise.measures.base import Measure
from analysis.optimise.view import View


@dataclass(frozen=True)
class Scale(Measure):
    best: ClassVar[str] = "low"
    unit: ClassVar[str] = "mm/px"
    worst: ClassVar[float] = 1e3
    meaning: ClassVar[str] = "part to a pixel"
    log: ClassVar[bool] = True

    def of(self, view: View) -> float:
        return 1e3 * float(np.nanmedian(view.footprint.across[view.on_part]))

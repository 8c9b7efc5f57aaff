"""Depths along the axis that are sharp to ``blur`` px, mm: z_far - z_near of the thin lens (analysis.view.optics)."""

from dataclasses import dataclass
from typing import ClassVar

from analysis.optimise.measures.base import Measure
from analysis.optimise.view import View
from analysis.view.optics import depth_of_field
from interchange.parameter import parameter

MOST = 1e4  # mm: what is told of an infinite one


@dataclass(frozen=True)
class DepthOfField(Measure):
    best: ClassVar[str] = "high"
    unit: ClassVar[str] = "mm"
    worst: ClassVar[float] = 0.0
    meaning: ClassVar[str] = "depth that is sharp"
    log: ClassVar[bool] = True

    blur: float = parameter(1.0, "c", "px", 0.01, 100, "largest disc of confusion that is sharp")

    def of(self, view: View) -> float:
        found = depth_of_field(view.camera, self.blur)
        return min(1e3 * (found.far - found.near), MOST)

"""A dent: an elliptical hollow, smooth at its brim.

h = -depth (1 - ρ²)²,   ρ² = (2 x / length)² + (2 y / width)² < 1;    area of the outline: π length width / 4
"""

from dataclasses import dataclass

import numpy as np

from analysis.sweep.defect import SurfaceDefect
from analysis.sweep.footprint import Footprint
from interchange.parameter import parameter


@dataclass(frozen=True)
class Dent(SurfaceDefect):
    source = "Wyvill, McPheeters, Wyvill: Data structure for soft objects. The Visual Computer 2, 1986: its falloff."

    length: float = parameter(2.0, "l", "mm", 1e-3, 1e4, "diameter along its x")
    width: float = parameter(2.0, "w", "mm", 1e-3, 1e4, "diameter along its y")
    depth: float = parameter(0.2, "d", "mm", -1e2, 1e2, "in its middle; below 0 it is a bump")

    def footprint(self) -> Footprint:
        a, b, depth = 0.5e-3 * self.length, 0.5e-3 * self.width, 1e-3 * self.depth

        def rho(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            return np.hypot(x / a, y / b)

        def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            return -depth * np.square(1 - np.minimum(np.square(rho(x, y)), 1))

        return Footprint(lambda x, y: (rho(x, y) - 1) * min(a, b), (a, b), min(a, b) / 10, height)

"""A scratch: a furrow along a straight line, round at its ends, with a raised-cosine profile.

h(s) = -depth (1 + cos(2 π s / width)) / 2,   s the distance from the line, |s| < width / 2;
area of the outline: length width + π width² / 4
"""

from dataclasses import dataclass

import numpy as np

from analysis.sweep.defect import SurfaceDefect
from analysis.sweep.footprint import Footprint
from analysis.sweep.gloss import roughened
from interchange.material import Material
from interchange.parameter import parameter


@dataclass(frozen=True)
class Scratch(SurfaceDefect):
    source = (
        "Bosch, Pueyo, Mérillou, Ghazanfarpour: A physically based model for realistic scratches. CGF 2004."
    )

    length: float = parameter(5.0, "l", "mm", 1e-3, 1e4, "of the line in its middle")
    width: float = parameter(0.2, "w", "mm", 1e-3, 1e3, "from brim to brim")
    depth: float = parameter(0.03, "d", "mm", 0, 1e2, "at the deepest")
    roughness: float = parameter(1.0, "s", "1", 0.05, 20, "width of highlights inside over that around it")

    def footprint(self) -> Footprint:
        half, radius, depth = 0.5e-3 * self.length, 0.5e-3 * self.width, 1e-3 * self.depth

        def distance(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            return np.hypot(np.maximum(np.abs(x) - half, 0), y)

        def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            s = np.minimum(distance(x, y) / radius, 1)
            return -depth * (1 + np.cos(np.pi * s)) / 2

        return Footprint(lambda x, y: distance(x, y) - radius, (half + radius, radius), radius / 4, height)

    def material(self, material: Material) -> Material:
        return roughened(material, self.roughness)

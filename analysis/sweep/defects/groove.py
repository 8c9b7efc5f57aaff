"""A groove: a rectangular channel with a flat bottom and smooth flanks.

h = -depth (3 t² - 2 t³),   t = min(distance from the outline / flank, 1);    area of the outline: length width
"""

from dataclasses import dataclass

import numpy as np

from analysis.sweep.defect import SurfaceDefect
from analysis.sweep.footprint import Footprint
from interchange.parameter import parameter


@dataclass(frozen=True)
class Groove(SurfaceDefect):
    source = (
        "The cubic step of Perlin: An image synthesizer. SIGGRAPH 1985, over the distance from a rectangle."
    )

    length: float = parameter(8.0, "l", "mm", 1e-3, 1e4, "along its x")
    width: float = parameter(1.0, "w", "mm", 1e-3, 1e4, "along its y")
    depth: float = parameter(0.2, "d", "mm", -1e2, 1e2, "of the bottom; below 0 it is a ridge")
    flank: float = parameter(0.25, "f", "mm", 1e-3, 1e3, "from brim to bottom, across")

    def footprint(self) -> Footprint:
        a, b = 0.5e-3 * self.length, 0.5e-3 * self.width
        depth, flank = 1e-3 * self.depth, min(1e-3 * self.flank, a, b)

        def level(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            return np.maximum(np.abs(x) - a, np.abs(y) - b)

        def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            t = np.clip(-level(x, y) / flank, 0, 1)
            return -depth * t * t * (3 - 2 * t)

        return Footprint(level, (a, b), flank / 3, height)

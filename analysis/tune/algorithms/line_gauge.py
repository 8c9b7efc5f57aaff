"""A line gauge: edges along search lines across the nominal line, a line through them by total least squares."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from analysis.tune.algorithms.base import GREY, Algorithm
from analysis.tune.found import Line
from analysis.tune.gauging import edge_places
from interchange.parameter import parameter, setting

LEAST = 0.4  # of the search lines must have an edge on the line
INSET = 0.08  # of the length is left out at either end, where the next edge begins


@dataclass(frozen=True)
class LineGauge(Algorithm):
    finds: ClassVar[type] = Line
    source: ClassVar[str] = (
        "Pearson: On lines and planes of closest fit to systems of points in space. Phil. Mag. 2, 1901."
    )

    sigma: float = parameter(1.0, "σ", "px", 0.5, 4, "blur along the search line, rms")
    contrast: float = parameter(8.0, "t", f"{GREY}/px", 0.3, 80, "least slope of an edge")
    reach: float = parameter(8.0, "r", "px", 2, 25, "search to either side of the nominal line")
    lines: int = setting(32, "n", 6, 180, "search lines")
    outlier: float = parameter(1.0, "o", "px", 0.1, 5, "distance from the line that leaves a point out")

    def run(self, image: np.ndarray, near: Any = None) -> Line | None:
        a, b = np.asarray(near.start, np.float64), np.asarray(near.end, np.float64)
        along = (b - a) / np.linalg.norm(b - a)
        across = np.array([-along[1], along[0]])
        share = np.linspace(INSET, 1 - INSET, self.lines)[:, None]
        middles = a + share * (b - a)
        t = edge_places(
            image, middles, np.tile(across, (len(middles), 1)), self.reach, self.sigma, self.contrast
        )
        points = (middles + t[:, None] * across)[np.isfinite(t)]
        for _ in range(3):
            if len(points) < max(2, LEAST * len(t)):
                return None
            middle, direction = fit_line(points)
            off = np.abs((points - middle) @ np.array([-direction[1], direction[0]]))
            kept = points[off <= max(self.outlier, float(np.median(off)))]
            if len(kept) == len(points):
                break
            points = kept
        direction = direction * np.sign(direction @ along)
        first, last = (middle + ((p - middle) @ direction) * direction for p in (a, b))
        return Line((float(first[0]), float(first[1])), (float(last[0]), float(last[1])))


def fit_line(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A point (2,) on the line of least squared distances from ``points`` (n >= 2, 2), and its unit direction (2,)."""
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    return middle, axes[0]

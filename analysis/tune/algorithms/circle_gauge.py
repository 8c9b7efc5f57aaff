"""A circle gauge: edges along radial search lines, a circle through them by least squares, outliers left out.

The circle minimises Σ (|p - m| - r)², from Kåsa's algebraic fit by Gauss-Newton; points farther than ``outlier`` px
from it are left out, three times.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from analysis.tune.algorithms.base import GREY, Algorithm
from analysis.tune.found import Circle
from analysis.tune.gauging import edge_places
from interchange.parameter import parameter, setting

LEAST = 0.4  # of the search lines must have an edge on the circle


@dataclass(frozen=True)
class CircleGauge(Algorithm):
    finds: ClassVar[type] = Circle
    source: ClassVar[str] = (
        "Gander, Golub, Strebel: Least-squares fitting of circles and ellipses. BIT 34, 1994."
    )

    sigma: float = parameter(1.0, "σ", "px", 0.5, 4, "blur along the search line, rms")
    contrast: float = parameter(8.0, "t", f"{GREY}/px", 0.3, 80, "least slope of an edge")
    reach: float = parameter(8.0, "r", "px", 2, 25, "search to either side of the nominal circle")
    lines: int = setting(48, "n", 8, 180, "search lines")
    outlier: float = parameter(1.0, "o", "px", 0.1, 5, "distance from the circle that leaves a point out")

    def run(self, image: np.ndarray, near: Any = None) -> Circle | None:
        angle = 2 * np.pi * np.arange(self.lines) / self.lines
        out = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        middle = np.asarray(near.middle, np.float64)
        t = edge_places(image, middle + near.radius * out, out, self.reach, self.sigma, self.contrast)
        points = (middle + (near.radius + t[:, None]) * out)[np.isfinite(t)]
        for _ in range(3):
            if len(points) < max(3, LEAST * len(t)):
                return None
            circle = fit_circle(points)
            off = np.abs(np.linalg.norm(points - circle.middle, axis=1) - circle.radius)
            kept = points[off <= max(self.outlier, float(np.median(off)))]
            if len(kept) == len(points):
                break
            points = kept
        return circle


def fit_circle(points: np.ndarray) -> Circle:
    """The circle of least squared distances from ``points`` (n >= 3, 2)."""
    origin = points.mean(axis=0)
    x, y = (points - origin).T
    a, *_ = np.linalg.lstsq(np.column_stack([x, y, np.ones_like(x)]), x**2 + y**2, rcond=None)
    m = a[:2] / 2
    r = np.sqrt(max(a[2] + m @ m, 1e-12))
    for _ in range(10):
        d = points - origin - m
        length = np.maximum(np.linalg.norm(d, axis=1), 1e-12)
        J = np.column_stack([-d / length[:, None], -np.ones_like(length)])
        step, *_ = np.linalg.lstsq(J, r - length, rcond=None)
        m, r = m + step[:2], r + step[2]
        if np.abs(step).max() < 1e-9:
            break
    return Circle((float(origin[0] + m[0]), float(origin[1] + m[1])), float(abs(r)))

"""What an algorithm may find. Places are (column, row), px, pixel (0, 0) being the centre of the top-left one."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Edges:
    """``points`` (n, 2)."""

    points: np.ndarray


@dataclass(frozen=True, eq=False)
class Blobs:
    """``labels`` (H, W) int32: 0 is background, k the k-th blob."""

    labels: np.ndarray


@dataclass(frozen=True)
class Circle:
    """``middle`` (column, row) and ``radius``, px."""

    middle: tuple[float, float]
    radius: float


@dataclass(frozen=True)
class Line:
    """From ``start`` to ``end``, px each."""

    start: tuple[float, float]
    end: tuple[float, float]

    @property
    def length(self) -> float:
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))

    def across(self, points: np.ndarray) -> np.ndarray:
        """Signed distances (n,) of ``points`` (n, 2) from the line, px; positive on the right of start to end, as seen
        in the image."""
        d = (np.asarray(self.end) - np.asarray(self.start)) / self.length
        r = np.asarray(points, np.float64) - np.asarray(self.start)
        return d[0] * r[..., 1] - d[1] * r[..., 0]


@dataclass(frozen=True)
class Place:
    """``middle`` of a found pattern, px."""

    middle: tuple[float, float]


Found = Edges | Blobs | Circle | Line | Place

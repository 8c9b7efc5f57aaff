"""The outline of a surface defect, and its depth, over the tangent plane at its middle.

``level(x, y)``: below 0 inside, above 0 outside, 0 on the outline; its slope is at most ``slope``, so that a point with
level l is at least l / slope away from the outline. ``height(x, y)``: m along the outward normal, 0 on the outline and
outside.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Field = Callable[[np.ndarray, np.ndarray], np.ndarray]
OUTLINE = 64  # points that stand for the outline


def flat(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)))


@dataclass(frozen=True, eq=False)
class Footprint:
    """``reach``: (half) extents of a box around the outline, m. ``fine``: length of triangle edges that shows its
    shape, m. ``outline`` (N, 2) m: points on it."""

    level: Field
    reach: tuple[float, float]
    fine: float
    height: Field = flat
    slope: float = 1.0

    @property
    def is_flat(self) -> bool:
        return self.height is flat

    def gradient(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(..., 2) of the height, by central differences."""
        step = 1e-3 * self.fine
        return np.stack(
            [
                (self.height(x + step, y) - self.height(x - step, y)) / (2 * step),
                (self.height(x, y + step) - self.height(x, y - step)) / (2 * step),
            ],
            axis=-1,
        )

    def outline(self) -> np.ndarray:
        """(N, 2) m: where rays from the middle leave the inside."""
        angle = 2 * np.pi * np.arange(OUTLINE) / OUTLINE
        c, s = np.cos(angle), np.sin(angle)
        low, high = np.zeros(OUTLINE), np.full(OUTLINE, 2.0 * np.hypot(*self.reach))
        for _ in range(50):
            middle = (low + high) / 2
            inside = self.level(middle * c, middle * s) < 0
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        return np.stack([low * c, low * s], axis=-1)

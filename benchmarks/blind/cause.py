"""What a cause is, and the sensor's coordinates: shared by both ways of drawing cases."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

Image = np.ndarray
Shape = dict[str, Any]


@dataclass(frozen=True)
class Cause:
    name: str
    form: str
    amplitude: float = 0.0
    shape: Shape = field(default_factory=dict)
    place: str = ""  # what it is about: a lamp, a material, a part
    eye: int | None = None  # the camera that alone has it; all have it where there is none

    def at(self, amplitude: float) -> "Cause":
        return replace(self, amplitude=float(amplitude))

    def of(self, eye: int) -> bool:
        return self.eye in (None, eye)


@dataclass(frozen=True)
class Frame:
    """Normalised coordinates of a sensor: ``x``, ``y`` (h, w), half the diagonal is 1."""

    size: tuple[int, int]

    @property
    def half(self) -> float:
        return float(np.hypot(*self.size) / 2)

    @property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        w, h = self.size
        c, r = np.meshgrid(np.arange(w, dtype=float), np.arange(h, dtype=float))
        return (c - (w - 1) / 2) / self.half, (r - (h - 1) / 2) / self.half

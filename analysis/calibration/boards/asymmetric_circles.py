"""The staggered grid of discs: every other row is shifted by half a pitch. See ``circles`` for what a centroid is."""

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np

from analysis.calibration.boards.base import Board, Detection
from analysis.calibration.boards.discs import discs, found
from interchange.problems import BrightfieldError


@dataclass(frozen=True)
class AsymmetricCircles(Board):
    """Every other row is shifted by half of ``size``, and rows are half of it apart. ``diameter``: over ``size``."""

    name: ClassVar[str] = "asymmetric-circles"
    counts: ClassVar[str] = "discs of a row, rows"
    sizes: ClassVar[str] = "from disc to disc along a row"
    diameter: float = 0.35

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rows % 2 == 0:
            raise BrightfieldError(
                f"A staggered grid must have an odd number of rows, else its ends look alike; got {self.rows}."
            )
        if not 0 < self.diameter < 0.7:
            raise BrightfieldError(
                f"Discs must not touch: diameter / spacing below 0.7; got {self.diameter:g}."
            )

    @property
    def points(self) -> np.ndarray:
        column, row = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        x, y = (column + 0.5 * (row % 2)) * self.size, -row * self.size / 2
        return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=-1)

    @property
    def radius(self) -> float:
        return self.diameter * self.size / 2

    def detect(self, image: np.ndarray) -> Detection | None:
        return found(image, (self.columns, self.rows), cv2.CALIB_CB_ASYMMETRIC_GRID)

    def picture(self, fineness: int) -> tuple[np.ndarray, np.ndarray]:
        return discs(self.points, self.radius, self.size, fineness)

"""The grid of discs. The image of a disc is found by its centroid.

The centroid of a disc's image is not the image of its centre: perspective and distortion shift it by up to some tenths
of a pixel (Heikkilä: Geometric camera calibration using circular control points. PAMI 2000). The bundle adjustment
takes that away, given the discs' radius.
"""

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np

from analysis.calibration.boards.base import Board, Detection, lattice
from analysis.calibration.boards.discs import discs, found
from interchange.problems import BrightfieldError


@dataclass(frozen=True)
class Circles(Board):
    """``diameter``: of a disc over ``size``."""

    name: ClassVar[str] = "circles"
    counts: ClassVar[str] = "discs"
    sizes: ClassVar[str] = "from disc to disc along a row"
    diameter: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.diameter < 1:
            raise BrightfieldError(
                f"Discs must not touch: diameter / spacing below 1; got {self.diameter:g}."
            )

    @property
    def points(self) -> np.ndarray:
        return lattice(self.columns, self.rows, self.size)

    @property
    def radius(self) -> float:
        return self.diameter * self.size / 2

    def detect(self, image: np.ndarray) -> Detection | None:
        return found(image, (self.columns, self.rows), cv2.CALIB_CB_SYMMETRIC_GRID)

    def picture(self, fineness: int) -> tuple[np.ndarray, np.ndarray]:
        return discs(self.points, self.radius, self.size, fineness)

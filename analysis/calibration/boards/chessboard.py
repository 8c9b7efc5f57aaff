"""The chessboard: found as a whole, by its inner corners.

Duda, Frese: Accurate detection and localization of checkerboard corners for calibration. BMVC 2018
(cv2.findChessboardCornersSB); where that finds nothing, cv2.findChessboardCorners. Either way corners are then moved to
the saddle points of grey: on the real pictures in the assets, that takes outliers of up to 1.6 px from the board's rim.
"""

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np

from analysis.calibration.boards.base import Board, Detection, lattice, refined, spacing


@dataclass(frozen=True)
class Chessboard(Board):
    name: ClassVar[str] = "chessboard"
    counts: ClassVar[str] = "inner corners"
    sizes: ClassVar[str] = "side of a square"

    @property
    def points(self) -> np.ndarray:
        return lattice(self.columns, self.rows, self.size)

    def detect(self, image: np.ndarray) -> Detection | None:
        shape = (self.columns, self.rows)
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
        found, corners = cv2.findChessboardCornersSB(image, shape, flags=flags)
        if not found:
            flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
            found, corners = cv2.findChessboardCorners(image, shape, flags=flags)
            if not found:
                return None
        rough = np.asarray(corners, np.float64).reshape(-1, 2)
        pixels = refined(image, rough, int(np.clip(spacing(rough) / 3, 2, 11)))
        if self._begins_white(image, pixels):
            pixels = pixels[::-1]
        return Detection(np.arange(len(pixels)), pixels)

    def _begins_white(self, image: np.ndarray, pixels: np.ndarray) -> bool:
        """Whether the board is counted from its far end: with an odd and an even number of corners along its sides,
        the first square between corners is black and the last is white. Other boards look the same turned by 180°."""
        if (self.columns + self.rows) % 2 == 0:
            return False
        grid = pixels.reshape(self.rows, self.columns, 2)
        grey = []
        for square in (grid[:2, :2], grid[-2:, -2:]):
            x, y = np.rint(square.mean((0, 1))).astype(int)
            grey.append(float(image[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].mean()))
        return grey[0] > grey[1]

    def picture(self, fineness: int) -> tuple[np.ndarray, np.ndarray]:
        squares = np.indices((self.rows + 1, self.columns + 1)).sum(0) % 2
        fine = np.kron(squares, np.ones((fineness, fineness)))
        picture = np.pad(np.where(fine > 0, 255, 0).astype(np.uint8), fineness, constant_values=255)
        edge = 2 * self.size
        corners = np.array(
            [[-edge, edge], [(self.columns - 1) * self.size + edge, -(self.rows - 1) * self.size - edge]]
        )
        return picture, corners

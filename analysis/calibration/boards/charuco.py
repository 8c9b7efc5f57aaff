"""ChArUco: a chessboard with a marker in every white square, so that part of it is enough.

Garrido-Jurado and others: Automatic generation and detection of highly reliable fiducial markers under occlusion.
Pattern Recognition 2014; cv2.aruco.CharucoDetector.
"""

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np

from analysis.calibration.boards.base import Board, Detection, lattice, refined, spacing
from interchange.problems import BrightfieldError, did_you_mean

DICTIONARIES = tuple(sorted(n for n in dir(cv2.aruco) if n.startswith("DICT_")))


def dictionary_of(name: str) -> cv2.aruco.Dictionary:
    """One of OpenCV's predefined dictionaries; BrightfieldError for another name."""
    if name not in DICTIONARIES:
        raise BrightfieldError(
            f'There is no dictionary "{name}".{did_you_mean(name, DICTIONARIES)} '
            f"There are {', '.join(DICTIONARIES)}."
        )
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


@dataclass(frozen=True)
class Charuco(Board):
    """``marker``: a marker's side over a square's."""

    name: ClassVar[str] = "charuco"
    counts: ClassVar[str] = "squares"
    sizes: ClassVar[str] = "side of a square"
    marker: float = 0.75
    dictionary: str = "DICT_4X4_250"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.1 < self.marker < 1:
            raise BrightfieldError(
                f"A marker must be smaller than its square (0.1 to 1 of it); got {self.marker:g}."
            )
        markers = self.columns * self.rows // 2
        if markers > len(dictionary_of(self.dictionary).bytesList):
            raise BrightfieldError(
                f"{self.columns} x {self.rows} squares need {markers} markers; {self.dictionary} has fewer."
            )

    @property
    def points(self) -> np.ndarray:
        return lattice(self.columns - 1, self.rows - 1, self.size) + np.array([self.size, -self.size, 0])

    @property
    def _opencv(self) -> cv2.aruco.CharucoBoard:
        shape, side = (self.columns, self.rows), self.marker * self.size
        return cv2.aruco.CharucoBoard(shape, self.size, side, dictionary_of(self.dictionary))

    def detect(self, image: np.ndarray) -> Detection | None:
        corners, ids, _, _ = cv2.aruco.CharucoDetector(self._opencv).detectBoard(image)
        if ids is None or len(ids) < 6:  # four fix the pose, and say nothing of the lens
            return None
        # OpenCV 4.11 counts these from the pixel's corner: they are off by half a pixel, and refined here once more
        rough = np.asarray(corners, np.float64).reshape(-1, 2) - 0.5
        half = int(np.clip(0.5 * (1 - self.marker) * spacing(rough), 2, 9))  # up to the marker's edge
        return Detection(ids.ravel().astype(int), refined(image, rough, half))

    def picture(self, fineness: int) -> tuple[np.ndarray, np.ndarray]:
        size = (self.columns * fineness, self.rows * fineness)
        picture = np.pad(np.asarray(self._opencv.generateImage(size)), fineness, constant_values=255)
        corners = np.array([[-1, 1], [self.columns + 1, -self.rows - 1]]) * self.size
        return picture, corners

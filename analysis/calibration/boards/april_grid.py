"""AprilGrid, Kalibr's board: AprilTags of family 36h11 in rows, small black squares between their corners.

Tag 0 is at the lower left, numbers run to the right and then up; a tag's black border is two bits wide. Which corner
of a tag comes first is told by the grid itself, so that tags turned on the print are no harm. Any part is enough.

Olson: AprilTag: a robust and flexible visual fiducial system. ICRA 2011. Found with cv2.aruco.
"""

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np

from analysis.calibration.boards.base import Board, Detection, refined
from analysis.calibration.boards.charuco import dictionary_of
from interchange.problems import BrightfieldError


@dataclass(frozen=True)
class AprilGrid(Board):
    """``size``: side of a tag (its black border's outside). ``spacing``: gap between tags over ``size``.
    ``border``: width of a tag's border, bits. Points: four a tag, upper left first, clockwise."""

    name: ClassVar[str] = "apriltag"
    counts: ClassVar[str] = "tags"
    sizes: ClassVar[str] = "side of a tag"
    spacing: float = 0.3
    border: int = 2
    dictionary: str = "DICT_APRILTAG_36h11"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.spacing <= 2:
            raise BrightfieldError(
                f"The gap between tags over their side must lie in (0, 2]; got {self.spacing:g}."
            )
        if self.columns * self.rows > len(dictionary_of(self.dictionary).bytesList):
            raise BrightfieldError(f"{self.columns} x {self.rows} tags are more than {self.dictionary} has.")

    @property
    def points(self) -> np.ndarray:
        column, row = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        pitch = self.size * (1 + self.spacing)
        low = np.stack([column.ravel() * pitch, (row.ravel() - self.rows + 1) * pitch - self.size], axis=-1)
        corner = np.array([[0, 1], [1, 1], [1, 0], [0, 0]]) * self.size
        flat = (low[:, None] + corner).reshape(-1, 2)
        return np.column_stack([flat, np.zeros(len(flat))])

    def detect(self, image: np.ndarray) -> Detection | None:
        settings = cv2.aruco.DetectorParameters()
        settings.markerBorderBits = self.border
        settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
        detector = cv2.aruco.ArucoDetector(dictionary_of(self.dictionary), settings)
        corners, ids, _ = detector.detectMarkers(image)
        if ids is None:
            return None
        ids = ids.ravel()
        known = (ids < self.columns * self.rows) & (np.bincount(ids)[ids] == 1)
        ids, rough = ids[known], np.array(corners, np.float64).reshape(-1, 4, 2)[known]
        if len(ids) < 2:
            return None
        order = self._order(ids, rough)
        if order is None:
            return None
        rough = rough[:, order]
        sides = np.linalg.norm(rough - np.roll(rough, 1, axis=1), axis=-1)
        pixels = np.stack(
            [
                refined(image, tag, int(np.clip(0.45 * min(self.spacing, 0.5) * side.min(), 2, 9)))
                for tag, side in zip(rough, sides, strict=True)
            ]
        )
        good = np.abs(pixels - rough).max((1, 2)) < 0.15 * sides.min(1)  # else it slid to another corner
        if good.sum() < 2:
            return None
        return Detection((4 * ids[good, None] + np.arange(4)).ravel(), pixels[good].reshape(-1, 2))

    def _order(self, ids: np.ndarray, rough: np.ndarray) -> np.ndarray | None:
        """How a tag's corners are counted: the turn under which all of them lie on the plane of the board."""
        board = self.points.reshape(-1, 4, 3)[ids, :, :2]
        best, least = None, 0.1  # of a tag's side, rms; a wrong turn is off by some 0.5
        side = np.median(np.linalg.norm(rough - np.roll(rough, 1, axis=1), axis=-1))
        for turn in range(4):
            order = np.roll(np.arange(4), turn)
            pixels = rough[:, order].reshape(-1, 2)
            H, _ = cv2.findHomography(board.reshape(-1, 2), pixels)
            if H is None:
                continue
            there = cv2.perspectiveTransform(board.reshape(-1, 1, 2), H)[:, 0]
            error = float(np.sqrt(((there - pixels) ** 2).sum(-1).mean()) / side)
            if error < least:
                best, least = order, error
        return best

    def picture(self, fineness: int) -> tuple[np.ndarray, np.ndarray]:
        gap = max(1, round(self.spacing * fineness))
        if abs(gap / fineness - self.spacing) > 1e-9:
            raise BrightfieldError(f"spacing x fineness must be whole; got {self.spacing:g} x {fineness}.")
        pitch = fineness + gap
        width, height = self.columns * pitch + gap, self.rows * pitch + gap
        picture = np.full((height, width), 255, np.uint8)
        family = dictionary_of(self.dictionary)
        for k in range(self.columns * self.rows):
            column, row = k % self.columns, self.rows - 1 - k // self.columns
            y, x = gap + row * pitch, gap + column * pitch
            tag = cv2.aruco.generateImageMarker(family, k, fineness, borderBits=self.border)
            picture[y : y + fineness, x : x + fineness] = np.rot90(tag, 2)  # OpenCV's are turned by 180°
        for row in range(self.rows + 1):
            for column in range(self.columns + 1):
                picture[row * pitch : row * pitch + gap, column * pitch : column * pitch + gap] = 0
        picture = np.pad(picture, fineness // 2, constant_values=255)
        edge = (gap + fineness // 2) * self.size / fineness
        low = self.points[:, :2].min(0) - edge
        high = low + np.array(picture.shape[::-1]) * self.size / fineness
        return picture, np.array([[low[0], high[1]], [high[0], low[1]]])

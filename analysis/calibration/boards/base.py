"""What a board is: points on a plane that an image shows, each with a number of its own.

Board frame: x right, y up and z towards whoever looks at it, origin at the upper left of the pattern; metres. Points
count along the rows, from the upper left.
"""

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np

from interchange.problems import BrightfieldError


@dataclass(frozen=True, eq=False)
class Detection:
    """``ids`` (n,) int numbers of the points seen; ``pixels`` (n, 2) where, px, pixel centres whole."""

    ids: np.ndarray
    pixels: np.ndarray


@dataclass(frozen=True)
class Board:
    """``columns``, ``rows``: how many points, squares or tags; ``size`` m: from one to the next, or a tag's side."""

    name: ClassVar[str]
    counts: ClassVar[str]  # what columns and rows count
    sizes: ClassVar[str]  # what size measures
    columns: int
    rows: int
    size: float

    def __post_init__(self) -> None:
        if not (2 <= self.columns <= 500 and 2 <= self.rows <= 500):
            raise BrightfieldError(
                f"A board must have 2 to 500 columns and rows ({self.counts}); got {self.columns} x {self.rows}."
            )
        if not 0 < self.size < 100:
            raise BrightfieldError(
                f"A board's size ({self.sizes}) must lie between 0 and 100 m; got {self.size} m."
            )

    @property
    def points(self) -> np.ndarray:
        """(N, 3) m, z = 0."""
        raise NotImplementedError

    @property
    def radius(self) -> float:
        """m: of the discs whose centroids the points are; 0 where points are corners."""
        return 0.0

    def detect(self, image: np.ndarray) -> Detection | None:
        """The points in a grey image (H, W) uint8; None where the board is not found."""
        raise NotImplementedError

    def picture(self, fineness: int) -> tuple[np.ndarray, np.ndarray]:
        """The printed board with a margin: (h, w) uint8 with ``fineness`` px to ``size``, and its corners (2, 2) m:
        the board coordinates of the upper left and of the lower right edge."""
        raise NotImplementedError


def lattice(columns: int, rows: int, pitch: float) -> np.ndarray:
    """(rows * columns, 3) points of a square grid, the first at the origin."""
    column, row = np.meshgrid(np.arange(columns), np.arange(rows))
    return np.stack([column.ravel() * pitch, -row.ravel() * pitch, np.zeros(columns * rows)], axis=-1)


def refined(image: np.ndarray, corners: np.ndarray, half_window: int) -> np.ndarray:
    """Corners (n, 2) moved to the saddle points of grey near them (Förstner's condition, cv2.cornerSubPix)."""
    height, width = image.shape
    inside = (np.minimum(corners, [width - 1, height - 1] - corners) > half_window + 2).all(axis=-1)
    moved = corners.astype(np.float32).reshape(-1, 1, 2).copy()
    if inside.any():
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
        moved[inside] = cv2.cornerSubPix(image, moved[inside], (half_window, half_window), (-1, -1), stop)
    return np.asarray(moved[:, 0], np.float64)


def spacing(pixels: np.ndarray) -> float:
    """Distance of the two nearest of the points (n, 2), px."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(pixels).query(pixels, k=2)
    return float(distance[:, 1].min())

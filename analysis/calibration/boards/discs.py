"""Dark discs on white: finding them in an image, and painting them."""

import cv2
import numpy as np
from scipy.spatial import cKDTree

from analysis.calibration.boards.base import Detection


def found(image: np.ndarray, shape: tuple[int, int], kind: int) -> Detection | None:
    """Dark discs on white: cv2.findCirclesGrid with blobs of any size.

    ``shape``: columns and rows. OpenCV begins at any corner; rows are turned so that the board is seen from its front.
    """
    settings = cv2.SimpleBlobDetector.Params()
    settings.minArea, settings.maxArea = 9.0, image.size / 16
    settings.minDistBetweenBlobs = 3.0
    settings.filterByConvexity, settings.minConvexity = True, 0.8
    settings.filterByInertia, settings.minInertiaRatio = True, 0.05
    blobs = cv2.SimpleBlobDetector.create(settings)
    for extra in (0, cv2.CALIB_CB_CLUSTERING):
        ok, centres = cv2.findCirclesGrid(image, shape, flags=kind | extra, blobDetector=blobs)
        if ok:
            grid = np.asarray(centres, np.float64).reshape(shape[1], shape[0], 2)
            right, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
            if right[0] * down[1] < right[1] * down[0]:  # counted as if seen from behind
                grid = grid[::-1]
            pixels = centroids(image, grid.reshape(-1, 2))
            return Detection(np.arange(len(pixels)), pixels)
    return None


def centroids(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Centroids (n, 2) of the darkness around rough ones: finer than those of thresholded blobs.

    The window reaches half way to the next disc and is centred anew, so that what is left of the paper in it has no
    side. All grey counts: to leave out what is nearly white takes up to 0.03 px from small discs.
    """
    to_next, _ = cKDTree(pixels).query(pixels, k=2)
    moved = pixels.copy()
    for k, reach in enumerate(to_next[:, 1] / 2):
        x, y = pixels[k]
        for _ in range(2):
            low = np.maximum(np.floor([x - reach, y - reach]).astype(int), 0)
            high = np.minimum(np.ceil([x + reach, y + reach]).astype(int) + 1, image.shape[::-1])
            part = image[low[1] : high[1], low[0] : high[0]].astype(np.float64)
            column, row = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
            near = np.hypot(column - x, row - y) <= reach
            dark = np.maximum(np.percentile(part[near], 90) - part, 0) * near
            if not dark.any():
                break
            x, y = (dark * column).sum() / dark.sum(), (dark * row).sum() / dark.sum()
        moved[k] = x, y
    return moved


def discs(points: np.ndarray, radius: float, size: float, fineness: int) -> tuple[np.ndarray, np.ndarray]:
    """A picture of dark discs on white with a margin of one ``size``."""
    low, high = points[:, :2].min(0) - size, points[:, :2].max(0) + size
    width, height = np.rint((high - low) / size * fineness).astype(int)
    x = low[0] + (np.arange(width) + 0.5) * size / fineness
    y = high[1] - (np.arange(height) + 0.5) * size / fineness
    picture = np.full((height, width), 255.0)
    for px, py, _ in points:
        beyond = (np.hypot(x[None, :] - px, y[:, None] - py) - radius) * fineness / size  # texels
        picture = np.minimum(picture, 255 * np.clip(beyond + 0.5, 0, 1))
    return np.rint(picture).astype(np.uint8), np.array([[low[0], high[1]], [high[0], low[1]]])

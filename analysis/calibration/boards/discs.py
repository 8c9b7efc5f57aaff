"""Dark discs on white: finding them in an image, and painting them."""

import cv2
import numpy as np

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
            pixels = centroids(image, grid, staggered=bool(kind & cv2.CALIB_CB_ASYMMETRIC_GRID))
            return Detection(np.arange(len(pixels)), pixels)
    return None


def centroids(image: np.ndarray, grid: np.ndarray, staggered: bool = False) -> np.ndarray:
    """Centroids (n, 2) of the darkness around the rough ones of a grid (rows, columns, 2): finer than those of
    thresholded blobs.

    The window is the ellipse that a circle on the board becomes, half way to the next disc, and is centred anew, so
    that what is left of the paper in it has no side. A circle of pixels would cut discs of a board seen at a slant, or
    reach their neighbours (0.15 px). All grey counts: to leave out what is nearly white takes up to 0.03 px from small
    discs.
    """
    right = np.gradient(grid, axis=1)  # px from disc to disc
    if staggered:
        straight = grid - 0.5 * (np.arange(len(grid)) % 2)[:, None, None] * right
        down, reach = 2 * np.gradient(straight, axis=0), np.sqrt(0.5) / 2
    else:
        down, reach = np.gradient(grid, axis=0), 0.5
    moved = grid.reshape(-1, 2).astype(np.float64)
    turns = np.stack([right, down], axis=-1).reshape(-1, 2, 2)
    for k, pixels_from_board in enumerate(turns):
        x, y = moved[k]
        board_from_pixels = np.linalg.inv(pixels_from_board)
        half = reach * np.linalg.norm(pixels_from_board, axis=1)  # of the ellipse's bounding box
        for _ in range(2):
            low = np.maximum(np.floor(np.array([x, y]) - half).astype(int), 0)
            high = np.minimum(np.ceil(np.array([x, y]) + half).astype(int) + 1, image.shape[::-1])
            part = image[low[1] : high[1], low[0] : high[0]].astype(np.float64)
            column, row = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
            off = np.stack([column - x, row - y], axis=-1) @ board_from_pixels.T
            near = np.hypot(off[..., 0], off[..., 1]) <= reach
            if not near.any():
                break
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

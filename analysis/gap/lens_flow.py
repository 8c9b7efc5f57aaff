"""Where a lens that distorts otherwise than the scene says images what was rendered: exact, however far.

Brown's model moves a point by where it lies before the lens. To look its displacement up where the point lies after it
is the same for a part of a pixel alone: of k1 = -0.3 it makes k2 = -3 k1² - k2, which is -0.17 where there is +0.1.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.gap.state import State
from interchange.camera import Camera
from interchange.distortion import LensModel
from interchange.effects.lens_distortion import LensDistortion

CAUSE = LensDistortion.name()
NUMBERS = ("k1", "k2", "p1", "p2")


def has_numbers(camera: Camera) -> bool:
    """Whether a lens can be given them."""
    return camera.lens.model is LensModel.OPENCV


def unit_flow(state: State, number: int) -> tuple[np.ndarray, np.ndarray]:
    """px (columns, rows) that every pixel of ``state`` moves by for a unit of ``NUMBERS[number]``, by what it shows."""
    K = state.camera.K
    column, row = state.source
    x, y = (column - K[0, 2]) / K[0, 0], (row - K[1, 2]) / K[1, 1]
    if state.camera.lens.distorts:
        x, y = (np.nan_to_num(z) for z in state.camera.lens.undistort(x, y))
    r2 = x * x + y * y
    dx, dy = (
        (x * r2, y * r2),
        (x * r2 * r2, y * r2 * r2),
        (2 * x * y, r2 + 2 * y * y),
        (r2 + 2 * x * x, 2 * x * y),
    )[number]
    return K[0, 0] * dx, K[1, 1] * dy


def flow(camera: Camera, more: Sequence[float]) -> np.ndarray:
    """(H, W, 2) px that the image which ``camera`` would render moves by where its lens has ``more`` of ``NUMBERS``; 0
    where that lens images nothing."""
    own = LensDistortion.of(camera)
    there = replace(own, **{n: getattr(own, n) + x for n, x in zip(NUMBERS, more, strict=True)}).on(camera)
    K, (width, height) = camera.K, camera.sensor.resolution
    column, row = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    x, y = there.lens.undistort((column - K[0, 2]) / K[0, 0], (row - K[1, 2]) / K[1, 1])
    x, y = camera.lens.distort(x, y)
    moved = np.stack([column - K[0, 0] * x - K[0, 2], row - K[1, 1] * y - K[1, 2]], axis=-1)
    return np.nan_to_num(moved).astype(np.float32)

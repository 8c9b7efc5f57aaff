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
LEAST_SLOPE = 0.05  # of image height by field angle: a lens that is flatter hardly images anything there


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


def changed(camera: Camera, more: Sequence[float]) -> Camera:
    """The camera with ``more`` of ``NUMBERS``."""
    own = LensDistortion.of(camera)
    return replace(own, **{n: getattr(own, n) + x for n, x in zip(NUMBERS, more, strict=True)}).on(camera)


def folds(camera: Camera, more: Sequence[float]) -> bool:
    """Whether a lens with ``more`` of ``NUMBERS`` would turn back before it has reached the corners of the image, which
    no lens that is focused on a sensor does."""
    K, sizes = camera.K, camera.sensor.resolution
    corners = [
        ((x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1])
        for x in (-0.5, sizes[0] - 0.5)
        for y in (-0.5, sizes[1] - 0.5)
    ]
    lens, r = changed(camera, more).lens, np.linspace(0, 4, 801)
    for x, y in corners:
        far = float(np.hypot(x, y))
        height = np.hypot(*lens.distort(r * x / far, r * y / far))
        slope = np.gradient(height, r) * (1 + r * r)
        end = int(np.argmax(slope < LEAST_SLOPE)) if (slope < LEAST_SLOPE).any() else len(r)
        if height[:end].max(initial=0.0) < far:
            return True
    return False


def flow(camera: Camera, more: Sequence[float]) -> np.ndarray:
    """(H, W, 2) px that the image which ``camera`` would render moves by where its lens has ``more`` of ``NUMBERS``; 0
    where that lens images nothing."""
    there = changed(camera, more)
    K, (width, height) = camera.K, camera.sensor.resolution
    column, row = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    x, y = there.lens.undistort((column - K[0, 2]) / K[0, 0], (row - K[1, 2]) / K[1, 1])
    x, y = camera.lens.distort(x, y)
    moved = np.stack([column - K[0, 0] * x - K[0, 2], row - K[1, 1] * y - K[1, 2]], axis=-1)
    return np.nan_to_num(moved).astype(np.float32)

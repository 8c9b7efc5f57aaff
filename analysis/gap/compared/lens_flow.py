"""Where a lens that distorts otherwise than the scene says images what was rendered: exact, however far.

Brown's model moves a point by where it lies before the lens. To look its displacement up where the point lies after it
is the same for a part of a pixel alone: of k2 it makes k2 - 3 k1², with k1 = -0.3 that is -0.17 where there is +0.1.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from analysis.gap.compared.state import State
from interchange.camera import Camera, Lens
from interchange.distortion import LensModel, distort, padded
from interchange.effects.lens_distortion import LensDistortion

CAUSE = LensDistortion.name()
NUMBERS = ("k1", "k2", "p1", "p2")
NEAR = 0.2  # px: where a smaller motion is looked up makes 0.0005 px, as it changes by 1 % a px or less
LEAST_SLOPE = 0.05  # of image height by field angle: a lens that is flatter hardly images anything there


def has_numbers(camera: Camera) -> bool:
    """Whether a lens can be given them."""
    return camera.lens.model is LensModel.OPENCV


def unit_flow(state: State, number: int) -> tuple[np.ndarray, np.ndarray]:
    """px (columns, rows) that every pixel of ``state`` moves by for a unit of ``NUMBERS[number]``, by what it shows; 0
    where the lens images nothing. Of a lens that has no such numbers: what lies where the pixel shows it."""
    camera, K = state.camera, state.camera.K
    own: tuple[float, ...] = ()
    column, row = (np.asarray(place, np.float64) for place in state.source)
    x, y = (column - K[0, 2]) / K[0, 0], (row - K[1, 2]) / K[1, 1]
    if has_numbers(camera):
        (x, y), own = camera.lens.undistort(x, y), camera.lens.distortion
    dx, dy = _moved(own, [float(k == number) for k in range(len(NUMBERS))], x, y)
    return np.nan_to_num(K[0, 0] * dx), np.nan_to_num(K[1, 1] * dy)


def _moved(
    own: Sequence[float], more: Sequence[float], x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """By how much ``more`` of ``NUMBERS`` besides a lens's ``own`` moves what lies at (x, y) before it."""
    before = padded(own, LensModel.OPENCV)
    after = np.array(before)
    after[: len(NUMBERS)] += more
    (u, v), (u0, v0) = distort(x, y, tuple(after)), distort(x, y, before)
    return u - u0, v - v0


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
    where that lens images nothing. Kept, as conditions share a lens."""
    own, there = LensDistortion.of(camera), changed(camera, more)
    k = tuple(camera.K[[0, 1, 0, 1], [0, 1, 2, 2]])
    return _flow(own, camera.lens, LensDistortion.of(there), there.lens, k, camera.sensor.resolution)


@lru_cache(maxsize=4)
def _flow(
    own: LensDistortion,
    lens: Lens,
    new: LensDistortion,
    other: Lens,
    k: tuple[float, ...],
    size: tuple[int, int],
) -> np.ndarray:
    (fx, fy, cx, cy), (width, height) = k, size
    column, row = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    x, y = (column - cx) / fx, (row - cy) / fy
    more = [getattr(new, n) - getattr(own, n) for n in NUMBERS]
    near = _moved(lens.distortion, more, *lens.undistort(x, y))
    if not max(np.nanmax(np.abs(m) * f) for m, f in zip(near, (fx, fy), strict=True)) < NEAR:
        x, y = lens.distort(*other.undistort(x, y))
        near = ((column - cx) / fx - x, (row - cy) / fy - y)
    return np.nan_to_num(np.stack([fx * near[0], fy * near[1]], axis=-1)).astype(np.float32)

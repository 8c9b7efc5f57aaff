"""Lens distortion by way of a wide pinhole image: seen finer than the sensor, then gathered into its pixels.

Blender 5.0's programmable camera loses the data that shaders need to cast shadow rays (its globals are zeroed for
every camera ray), so a lens that Cycles' own camera does not have is drawn with a pinhole of finer pixels that
covers the field. Each fine pixel is carried through the lens model and counted to the pixels that it lies on, by
area: the box filter, on an image that is constant within a fine pixel.
"""

from dataclasses import replace

import numpy as np

from interchange.camera import Camera, Projection
from interchange.distortion import LensModel
from interchange.problems import BrightfieldError

MAX_PIXELS = 400_000_000


def is_native(camera: Camera) -> bool:
    """Whether Cycles' own camera draws this one: square pixels and no distortion."""
    K = camera.K
    return bool(abs(K[0, 0] / K[1, 1] - 1) < 1e-7) and not camera.lens.distorts


def oversampling(samples: int) -> int:
    """Fine pixels along the side of a pixel: enough that a pixel's samples are spread over it."""
    return int(np.clip(round(np.sqrt(samples / 2)), 2, 8))


def wide_camera(camera: Camera, fine: int) -> Camera:
    """The pinhole (or telecentric) camera that sees all that ``camera`` sees, ``fine`` pixels to one at its centre."""
    K, (width, height) = camera.K, camera.sensor.resolution
    border = np.concatenate(
        [
            np.stack([np.linspace(-0.5, width - 0.5, 4 * width), np.full(4 * width, y)], -1)
            for y in (-0.5, height - 0.5)
        ]
        + [
            np.stack([np.full(4 * height, x), np.linspace(-0.5, height - 0.5, 4 * height)], -1)
            for x in (-0.5, width - 0.5)
        ]
    )
    x, y = camera.lens.undistort((border[:, 0] - K[0, 2]) / K[0, 0], (border[:, 1] - K[1, 2]) / K[1, 1])
    if np.isnan(x).any() and camera.lens.model is LensModel.FISHEYE:
        raise BrightfieldError(
            f"A fisheye lens must see less than 180° on every pixel to be drawn through a pinhole image; focal lengths "
            f"{K[0, 0]:g}, {K[1, 1]:g} px with distortion {camera.lens.distortion} see more in the corners of "
            f"{width} x {height} px. ({camera.where or camera.name})"
        )
    if np.isnan(x).any():
        raise BrightfieldError(
            f"The lens distortion must be invertible over the whole image; {camera.lens.distortion} folds inside it. "
            f"({camera.where or camera.name})"
        )
    f = fine * max(K[0, 0], K[1, 1])  # px
    low = np.floor(np.array([x.min(), y.min()]) * f) - fine
    size = (np.ceil(np.array([x.max(), y.max()]) * f) + fine - low).astype(int)
    if size.prod() > MAX_PIXELS:
        raise BrightfieldError(
            f"The distorted image of {width} x {height} px would need a pinhole image of {size[0]} x {size[1]} px; "
            f"take fewer samples or a smaller image. ({camera.where or camera.name})"
        )
    perspective = camera.lens.projection is Projection.PERSPECTIVE
    pitch = (camera.lens.focal_length if perspective else 1.0) / f
    return replace(
        camera,
        lens=replace(camera.lens, distortion=(), model=LensModel.OPENCV),
        sensor=replace(camera.sensor, resolution=(int(size[0]), int(size[1])), pixel_pitch=(pitch, pitch)),
        principal_point=(float(-low[0] - 0.5), float(-low[1] - 0.5)),
    )


def gather(planes: dict[str, np.ndarray], wide: Camera, camera: Camera) -> dict[str, np.ndarray]:
    """Means (H, W, C) over the sensor's pixels of planes (h, w, C) seen by ``wide``."""
    (width, height), (w, h) = camera.sensor.resolution, wide.sensor.resolution
    fine, K = wide.K, camera.K
    column, row = np.meshgrid(np.arange(w), np.arange(h))
    x, y = (column - fine[0, 2]) / fine[0, 0], (row - fine[1, 2]) / fine[1, 1]
    u, v = camera.lens.distort(x, y)
    with np.errstate(invalid="ignore"):
        back_x, back_y = camera.lens.undistort(u, v)
        seen = np.hypot(back_x - x, back_y - y) < 1e-6  # else beyond the fold: another point is imaged here
    across = _shares(K[0, 0] * u + K[0, 2], axis=1)
    down = _shares(K[1, 1] * v + K[1, 2], axis=0)
    weights = np.zeros(width * height)
    sums = {name: np.zeros((plane.shape[2], width * height)) for name, plane in planes.items()}
    for i, share_i in across:
        for j, share_j in down:
            share = share_i * share_j
            inside = seen & (share > 0) & (i >= 0) & (i < width) & (j >= 0) & (j < height)
            target, share = (j[inside] * width + i[inside]).astype(np.int64), share[inside]
            weights += np.bincount(target, share, width * height)
            for name, plane in planes.items():
                for c in range(plane.shape[2]):
                    sums[name][c] += np.bincount(target, share * plane[..., c][inside], width * height)
    if (weights <= 0).any():
        raise BrightfieldError(
            f"{(weights <= 0).sum()} pixels of a distorted image were not covered; take more samples."
        )
    return {
        name: (total / weights).T.reshape(height, width, -1).astype(np.float32)
        for name, total in sums.items()
    }


def pick(plane: np.ndarray, wide: Camera, camera: Camera) -> np.ndarray:
    """(H, W, C) of a plane (h, w, C) seen by ``wide``, at the fine pixels nearest to the sensor's pixel centres."""
    (width, height), K, fine = camera.sensor.resolution, camera.K, wide.K
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    x, y = camera.lens.undistort((column - K[0, 2]) / K[0, 0], (row - K[1, 2]) / K[1, 1])
    i, j = np.rint(fine[0, 0] * x + fine[0, 2]).astype(int), np.rint(fine[1, 1] * y + fine[1, 2]).astype(int)
    return np.asarray(plane[j, i])


def _shares(place: np.ndarray, axis: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Along one axis, the two pixels that a fine pixel centred at ``place`` may lie on, and its share on each."""
    half = np.abs(np.gradient(place, axis=axis)) / 2
    first = np.floor(place - half + 0.5)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.clip((first + 0.5 - (place - half)) / (2 * half), 0, 1)
    return [(first, share), (first + 1, 1 - share)]

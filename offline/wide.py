"""Lens distortion by way of a wide pinhole image: seen finer than the sensor, then gathered into its pixels.

Blender 5.0's programmable camera loses the data that shaders need to cast shadow rays (its globals are zeroed for
every camera ray), so a lens that Cycles' own camera does not have is drawn with a pinhole of finer pixels that
covers the field, in bands of rows (``bands``), and carried through the lens model by ``offline.gathering``.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from interchange.camera import Camera, Projection
from interchange.distortion import LensModel
from interchange.problems import BrightfieldError

LONGEST = 200.0  # times its other side that a pixel may be long (Blender: RenderSettings.pixel_aspect_x)
MAX_PIXELS = 4_000_000_000
BAND = 8_000_000  # px that Cycles holds at once, some 100 bytes each
FINEST = 8  # fine pixels along the side of a pixel: its spread is then 2 % more than that of its square
FINEST_DENOISED = 4  # the same, 9 % more: denoising takes time by the fine pixel (8: three times as long)


def is_native(camera: Camera) -> bool:
    """Whether Cycles' own camera draws this one: no distortion, and pixels that are no longer than Blender's may be."""
    K = camera.K
    return not camera.lens.distorts and bool(1 / LONGEST <= K[0, 0] / K[1, 1] <= LONGEST)


def oversampling(samples: int, denoised: bool = False) -> tuple[int, int]:
    """Fine pixels along the side of a pixel, and samples of each: together as near to ``samples`` as 2 to 8 (4, where
    each is ``denoised``) allow."""
    finest = FINEST_DENOISED if denoised else FINEST
    each = {fine: max(1, round(samples / fine**2)) for fine in range(2, finest + 1)}
    fine = min(each, key=lambda f: (abs(f**2 * each[f] - samples), -f))
    return fine, each[fine]


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


def bands(wide: Camera) -> Iterator[tuple[int, Camera]]:
    """The first row of each band, and the camera that sees it alone."""
    width, height = wide.sensor.resolution
    cx, cy = wide.K[0, 2], wide.K[1, 2]
    rows = max(1, BAND // width)
    for first in range(0, height, rows):
        size = (width, min(rows, height - first))
        yield (
            first,
            replace(
                wide,
                sensor=replace(wide.sensor, resolution=size),
                principal_point=(float(cx), float(cy - first)),
            ),
        )

"""How far the image moves while the shutter is open, by which follows how many renderings an exposure needs.

    n = ⌈path⌉, at least 2, for a path of a quarter of a pixel or more; else 1

Renderings that are one pixel apart, each the mean over its pixels, are the blurred image: a box of one pixel at every
pixel of a line is the line's own box.
"""

import itertools

import numpy as np

from interchange.camera import Camera
from interchange.frames import apply
from interchange.scene import Scene

STILL = 0.25  # px: what one rendering stands for
ACROSS = 5  # rays along a side of what is looked at


def renderings(path: float, most: int) -> int:
    """Of an exposure in which the image moves ``path`` px."""
    return 1 if path < STILL else int(np.clip(np.ceil(path - 1e-6), min(2, most), most))


def longest_path(begin: tuple[Scene, Camera], end: tuple[Scene, Camera]) -> float:
    """px that what the camera sees moves at most, from one state of a scene to another one of the same bodies.

    Bodies of one motion are looked at together, through rays over the part of the image that their box fills, at its
    least and greatest depth.
    """
    return max(_path(*begin, *end), _path(*end, *begin))


def _path(scene: Scene, camera: Camera, later: Scene, camera_later: Camera) -> float:
    there = {b.name: b for b in later.bodies}
    same_view = np.array_equal(camera.world_from_camera, camera_later.world_from_camera)
    together: dict[bytes, tuple[np.ndarray, list[np.ndarray]]] = {}
    for body in scene.bodies:
        after = there.get(body.name)
        if after is None or not len(body.mesh.vertices):
            continue
        still = np.array_equal(body.world_from_body, after.world_from_body)
        if still and same_view:
            continue
        motion = np.eye(4) if still else after.world_from_body @ np.linalg.inv(body.world_from_body)
        _, boxes = together.setdefault(np.round(motion, 9).tobytes(), (motion, []))
        corners = np.array(list(itertools.product(*body.mesh.bounds.T)))
        boxes.append(apply(body.world_from_body, corners))
    return max(
        (_shift(camera, camera_later, m, np.concatenate(b)) for m, b in together.values()), default=0.0
    )


def _shift(camera: Camera, later: Camera, motion: np.ndarray, corners: np.ndarray) -> float:
    """px that points within ``corners`` (N, 3) move at most by ``motion`` (4, 4) of the world."""
    depth = apply(camera.camera_from_world, corners)[:, 2]
    near, far = max(float(depth.min()), camera.clip[0]), float(depth.max())
    if far <= camera.clip[0]:
        return 0.0
    low, high = np.zeros(2), np.array(camera.sensor.resolution) - 1.0
    shown = camera.project(corners)
    if depth.min() > 0 and np.isfinite(shown).all():
        low, high = np.maximum(low, shown.min(axis=0)), np.minimum(high, shown.max(axis=0))
    if (low > high).any():
        return 0.0
    columns, rows = np.meshgrid(*np.linspace(low, high, ACROSS).T)
    pixels = np.stack([columns, rows], axis=-1).reshape(-1, 2)
    origin, direction = camera.rays(pixels)
    forward = camera.world_from_camera[:3, 2]
    begins = (origin - camera.world_from_camera[:3, 3]) @ forward
    longest = 0.0
    for at in (near, far):
        points = origin + direction * ((at - begins) / (direction @ forward))[:, None]
        moved = later.project(apply(motion, points)) - pixels
        longest = max(longest, float(np.nanmax(np.linalg.norm(moved, axis=1), initial=0.0)))
    return longest

"""Which frusta a lamp's shadow maps need, so that their texels fall where the camera looks.

A lamp that sees the whole scene within a cone gets one map along that cone, any other six around it; parallel light
gets one telecentric map. Of the full square only the part in which something is seen is drawn: one of a fixed
family of tiles, halved up to four times, so that a camera that moves a little keeps its maps.

    texture depth = near / Z for a lamp with a place, linear for parallel light; 1 is nearest to the lamp
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from realtime import polytope

WIDEST = np.cos(np.radians(55))  # half-angle of a cone that one map may cover
MARGIN = 1.1  # of a cube's faces, for lamps that have an extent
HALVINGS = 5
STEP = 256  # texels, of the side of a map's cropped part
RIM = 2  # texels around what casts shadows
WIDEST_CROPPED = 4096  # texels: a first column and row then fit into one 32-bit float

# rows: right, up, forward of the six faces, in the order that shaders/lights.glsl looks them up
FACES = np.array(
    [
        [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 1, 0], [1, 0, 0], [0, 0, -1]],
    ],
    np.float64,
)


@dataclass(frozen=True)
class Visible:
    """``bounds`` (2, 3) of all bodies; ``seen``: the part of that box which the camera can see."""

    bounds: np.ndarray
    seen: polytope.Polygons

    @cached_property
    def points(self) -> np.ndarray:
        return np.concatenate(self.seen)

    @cached_property
    def corners(self) -> np.ndarray:
        return np.concatenate(polytope.box(self.bounds))

    @cached_property
    def extent(self) -> float:
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))


@dataclass(frozen=True)
class Frustum:
    """``clip_from_world`` (4, 4) of one map along ``axis`` (3,); ``tangent``: half its width at unit distance
    (parallel light: m). ``slopes`` (3, 4): how a receiver's plane lies in it, see shaders/lights.glsl (per unit of
    clip space). ``crop``: first column, first row and side of the part that is kept, texels; beyond it nothing casts
    a shadow. None: all of it."""

    clip_from_world: np.ndarray
    slopes: np.ndarray
    axis: np.ndarray
    tangent: float
    crop: tuple[int, int, int] | None = None


def cone_to(place: np.ndarray, bounds: np.ndarray) -> tuple[np.ndarray, float]:
    """The axis (3,) and the cosine of the half-angle of the cone in which ``place`` sees the box; -1 from inside."""
    corners = np.concatenate(polytope.box(bounds)) - place
    axis = bounds.mean(axis=0) - place
    distance = float(np.linalg.norm(axis))
    if distance < 1e-12 or ((place >= bounds[0]) & (place <= bounds[1])).all():
        return np.array([0.0, 0.0, -1.0]), -1.0
    axis = axis / distance
    along = corners / np.maximum(np.linalg.norm(corners, axis=1, keepdims=True), 1e-30)
    return axis, float((along @ axis).min())


def around(axis: np.ndarray) -> np.ndarray:
    """(3, 3) rows right, up, forward with forward along ``axis``."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    right = polytope.cross(helper, axis)
    right /= np.linalg.norm(right)
    return np.stack([right, polytope.cross(axis, right), axis])


def place_frustum(
    place: np.ndarray, rotation: np.ndarray, tangent: float, visible: Visible
) -> Frustum | None:
    """The map of a lamp at ``place`` along ``rotation``'s forward; None where nothing that is seen lies in it."""
    if not visible.seen or tangent <= 0:  # a box without extent is a scene without bodies
        return None
    near = 1e-5 * max(visible.extent, 1e-9)
    eye_from_world = np.eye(4)
    eye_from_world[:3, :3], eye_from_world[:3, 3] = rotation, -rotation @ place
    projection = np.array([[1 / tangent, 0, 0, 0], [0, 1 / tangent, 0, 0], [0, 0, 0, near], [0, 0, 1, 0]])
    full = projection @ eye_from_world
    p = visible.points @ full[:, :3].T + full[:, 3]
    if (p[:, 3] < near).any() or (np.abs(p[:, :2]) > p[:, 3:]).any():
        sides = np.array([[1.0, 0, 0, 1], [-1, 0, 0, 1], [0, 1, 0, 1], [0, -1, 0, 1]]) @ full
        inside = polytope.cut(visible.seen, np.concatenate([sides, [eye_from_world[2] - [0, 0, 0, near]]]))
        if not inside:
            return None
        p = np.concatenate(inside) @ full[:, :3].T + full[:, 3]
    ndc = p[:, :2] / p[:, 3:]
    zoom, size = _tile(ndc.min(axis=0), ndc.max(axis=0))
    slopes = np.zeros((3, 4))
    slopes[:2, :3], slopes[2, :3], slopes[0, 3] = rotation[:2] * tangent * size, place, near
    return Frustum(zoom @ full, slopes, rotation[2], tangent * size)


def parallel_frustum(direction: np.ndarray, visible: Visible) -> Frustum | None:
    """The map of light that travels along ``direction``."""
    if not visible.seen:
        return None
    rotation = around(direction)
    corners = visible.corners @ rotation.T
    middle, half = visible.bounds.mean(axis=0) @ rotation.T, 0.505 * max(visible.extent, 1e-9)
    low, high = corners[:, 2].min() - 0.01 * half, corners[:, 2].max() + 0.01 * half
    full = np.eye(4)
    full[:2, :3] = rotation[:2] / half
    full[:2, 3] = -middle[:2] / half
    full[2, :3], full[2, 3] = -rotation[2] / (high - low), high / (high - low)
    p = visible.points @ full[:2, :3].T + full[:2, 3]
    zoom, size = _tile(np.clip(p.min(axis=0), -1, 1), np.clip(p.max(axis=0), -1, 1))
    slopes = np.zeros((3, 4))
    slopes[:2, :3], slopes[2, :3] = rotation[:2] * half * size / (high - low), rotation[2]
    slopes[2, 3] = 1 / (high - low)
    return Frustum(zoom @ full, slopes, direction, half * size)


def _tile(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, float]:
    """The smallest tile of the family that holds [low, high] of the square [-1, 1]²: its zoom and relative size."""
    for halving in range(HALVINGS, 0, -1):
        size = 2.0**-halving
        start = np.clip(
            np.floor((low + 1) / size), 0, 2 / size - 2
        )  # tiles start at every half of their side
        left = start * size - 1
        if (high <= left + 2 * size).all():
            zoom = np.eye(4)
            zoom[0, 0] = zoom[1, 1] = 1 / size
            zoom[:2, 3] = -(left + size) / size
            return zoom, size
    return np.eye(4), 1.0


def cropped(frustum: Frustum, corners: np.ndarray, side: int) -> Frustum:
    """The frustum with the part of its map of ``side``² texels in which the boxes ``corners`` (n, 8, 3) lie: a square
    whose side is a multiple of ``STEP``, so that maps are used again when a body turns."""
    p = corners @ frustum.clip_from_world[:, :3].T + frustum.clip_from_world[:, 3]
    p = p[np.isfinite(p).all(axis=(1, 2)) & (p[..., 3] > 0).any(axis=1)].reshape(-1, 4)
    if (p[:, 3] <= 0).any():  # a box about the lamp
        return frustum
    at = (p[:, :2] / p[:, 3:] * 0.5 + 0.5) * side
    low = np.clip(at.min(axis=0, initial=side), 0, side)
    high = np.clip(at.max(axis=0, initial=0), 0, side)
    kept = STEP * int(np.ceil((max(*(high - low), 0) + 2 * RIM) / STEP))
    if kept >= side or side > WIDEST_CROPPED:
        return frustum
    column, row = np.clip(np.round((low + high - kept) / 2), 0, side - kept).astype(int).tolist()
    return replace(frustum, crop=(column, row, kept))

"""Which part of a workpiece a camera sees, and what keeps it from the rest: the field's edge, a housing, itself.

Points are spread over the workpiece, evenly by area. Each that faces the camera is outside the field, or hidden by the
workpiece itself, or by another body, or seen; the shares add up to 1 and any can be a constraint of an optimiser. Depth
comes from a renderer: a point is hidden where the image shows something nearer than the point's own tangent plane.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from interchange.camera import Camera
from interchange.frames import apply
from interchange.image import Image
from interchange.mesh import face_normals
from interchange.problems import BrightfieldError, did_you_mean
from interchange.scene import Body, Scene

NEARER = 2e-3  # of the depth: what two surfaces must differ by to hide one another
LISTED = 8  # bodies, in an error


class Renderer(Protocol):
    def render(self, scene: Scene, camera: Camera, passes: list[str], *, samples: int) -> Image: ...


@dataclass(frozen=True, eq=False)
class Visibility:
    """Shares of the surface that faces the camera; ``hidden`` names what stands before it. ``mask`` (H, W): pixels that
    show another body where the workpiece alone would be seen. ``facing``: m² that face the camera."""

    seen: float
    outside: float
    by_itself: float
    hidden: dict[str, float]
    facing: float
    mask: np.ndarray


def visibility(
    renderer: Renderer, scene: Scene, camera: Camera, of: list[str], count: int = 20_000, seed: int = 0
) -> Visibility:
    """``of``: what makes up the workpiece, as ``named`` takes it; ``count`` points tell a share within
    sqrt(share (1 - share) / count) or better. Raises BrightfieldError for a name that the scene lacks and for a
    workpiece of which nothing faces the camera."""
    wanted = named(scene, of)
    own_names = {b.name for b in wanted}
    points, normals, facing = _points(wanted, camera, count, np.random.default_rng(seed))
    passes = ["depth", "object_id"]
    sharp = replace(camera, lens=replace(camera.lens, f_stop=0.0))  # depth is a matter of pinholes
    full = renderer.render(scene, sharp, passes, samples=1)
    alone = renderer.render(replace(scene, bodies=tuple(wanted)), sharp, passes, samples=1)
    width, height = camera.sensor.resolution
    pixel = camera.project(points)
    with np.errstate(invalid="ignore"):
        near = np.rint(pixel)
        inside = (near >= 0).all(axis=-1) & (near[:, 0] < width) & (near[:, 1] < height)
    column, row = np.where(inside[:, None], near, 0).astype(int).T
    limit = _nearest_depth(points, normals, column, row, camera)

    def covered(image: Image) -> np.ndarray:
        shown = np.asarray(image.passes["depth"], np.float64).reshape(height, width)[row, column]
        return inside & (_ids(image)[row, column] >= 0) & (shown < limit)

    itself = covered(alone)
    others = covered(full) & ~itself
    names = np.array([*full.object_names, ""])
    ids = _ids(full)[row, column]
    hidden = {
        str(name): float((others & (names[ids] == name)).mean()) for name in np.unique(names[ids[others]])
    }
    mask = (_ids(alone) >= 0) & ~np.isin(names[_ids(full)], list(own_names))
    seen = inside & ~itself & ~others
    return Visibility(float(seen.mean()), float((~inside).mean()), float(itself.mean()), hidden, facing, mask)


def named(scene: Scene, words: list[str]) -> list[Body]:
    """The bodies of these prim paths, of what lies below them, or of these last parts of a path. Raises
    BrightfieldError for one that the scene lacks."""
    found: dict[int, Body] = {}
    for word in words:
        fits = [
            b
            for b in scene.bodies
            if b.name == word
            or b.name.startswith(word.rstrip("/") + "/")
            or b.name.rsplit("/", 1)[-1] == word
        ]
        if not fits:
            names = [b.name for b in scene.bodies]
            few = names[:LISTED] + ["…"] * (len(names) > LISTED)
            hint = did_you_mean(word, names) or f" Its bodies are {', '.join(few) or 'none'}."
            raise BrightfieldError(f'The scene has no body "{word}".{hint} ({scene.source})')
        found |= {id(b): b for b in fits}
    return list(found.values())


def _ids(image: Image) -> np.ndarray:
    """(H, W) index into ``object_names``, -1 for nothing."""
    ids = np.asarray(image.passes["object_id"])
    return np.nan_to_num(ids.reshape(ids.shape[:2]).astype(np.float64), nan=-1).astype(int)


def _points(
    bodies: list[Body], camera: Camera, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, float]:
    """Points on faces that face the camera with the faces' normals (count, 3), and the faces' area, m²."""
    corners = np.concatenate([apply(b.world_from_body, b.mesh.vertices[b.mesh.faces]) for b in bodies])
    flat = corners.reshape(-1, 3)
    normals = face_normals(flat, np.arange(len(flat)).reshape(-1, 3))
    turned = [np.full(len(b.mesh.faces), np.sign(np.linalg.det(b.world_from_body[:3, :3]))) for b in bodies]
    normals = normals * np.concatenate(turned)[:, None]  # a mirrored body's faces run the other way round
    middle = corners.mean(axis=1)
    _, direction = camera.rays(camera.project(middle))
    ahead = np.isfinite(direction[:, 0])
    toward = np.where(ahead[:, None], -direction, camera.world_from_camera[:3, 3] - middle)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1) / 2
    area = np.where(np.sum(normals * toward, axis=-1) > 0, area, 0.0)
    total = float(area.sum())
    if total <= 0:
        raise BrightfieldError("Nothing of the workpiece faces the camera.")
    # one point in each of ``count`` equal shares of the area
    face = np.searchsorted(np.cumsum(area), (np.arange(count) + rng.random(count)) / count * total)
    face = np.minimum(face, len(area) - 1)
    u, v = rng.random((2, count))
    turn = u + v > 1
    u, v = np.where(turn, 1 - u, u), np.where(turn, 1 - v, v)
    a, b, c = corners[face].transpose(1, 0, 2)
    return a + u[:, None] * (b - a) + v[:, None] * (c - a), normals[face], total


def _nearest_depth(
    points: np.ndarray, normals: np.ndarray, column: np.ndarray, row: np.ndarray, camera: Camera
) -> np.ndarray:
    """Depth, m along the axis, nearer than which a pixel shows something before the point: that at which its middle ray
    meets the point's tangent plane, less what a curved surface may leave that plane by within a pixel."""
    axis, eye = camera.world_from_camera[:3, 2], camera.world_from_camera[:3, 3]
    origin, direction = camera.rays(np.stack([column, row], axis=-1).astype(float))
    slope = np.minimum(
        np.sum(direction * normals, axis=-1), -0.02
    )  # they face the camera, some nearly edge-on
    along = np.sum((points - origin) * normals, axis=-1) / slope
    met = (origin + along[:, None] * direction - eye) @ axis
    own = (points - eye) @ axis
    return np.minimum(met, own) - NEARER * own - np.abs(met - own)

"""Where on an object a defect lies: an anchor that the object carries along, and the surface that is met there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.sweep.footprint import Footprint
from interchange.formats.bop import rigid_and_stretch
from interchange.frames import apply
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene

STEEP = 0.3  # least cosine between the normals of one defect's surface


class OffSurface(BrightfieldError):
    """A defect for which there is no room on its object."""


@dataclass(frozen=True)
class Anchor:
    """In the object's rigid frame: a point, m, the direction from which the surface is looked at, outwards, and what is
    right in that view."""

    at: tuple[float, float, float]
    normal: tuple[float, float, float]
    right: tuple[float, float, float]


def anchor_of(
    scene: Scene, target: str, at: Sequence[float] | None, normal: Sequence[float] | None
) -> Anchor:
    """From world coordinates of ``scene``, m; by default the middle of the object's box, looked at from above."""
    bodies = [b for b in scene.bodies if b.name == target]
    box = Scene(tuple(bodies)).bounds
    point = box.mean(axis=0) if at is None else np.asarray(at, np.float64)
    n = np.array([0.0, 0, 1]) if normal is None else np.asarray(normal, np.float64)
    n = n / np.linalg.norm(n)
    right = _right_of(n)
    R = rigid_and_stretch(bodies[0].world_from_body)[0]
    back = np.linalg.inv(R)
    turn = back[:3, :3]
    return Anchor(_triple(apply(back, point)), _triple(turn @ n), _triple(turn @ right))


def _triple(v: np.ndarray) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])


def _right_of(n: np.ndarray) -> np.ndarray:
    """World x for whoever looks down; else horizontal, so that up in the view is upwards."""
    right = np.cross([0.0, 0, 1], n)
    return np.array([1.0, 0, 0]) if np.linalg.norm(right) < 1e-6 else right / np.linalg.norm(right)


def frame_at(bodies: Sequence[Body], anchor: Anchor, x: float, y: float, angle: float) -> np.ndarray:
    """``defect_from_world`` (4, 4) at the surface that is met at (x, y) m of the view. Raises OffSurface."""
    R = rigid_and_stretch(bodies[0].world_from_body)[0]
    n, right = R[:3, :3] @ anchor.normal, R[:3, :3] @ anchor.right
    up = np.cross(n, right)
    through = apply(R, np.array(anchor.at)) + x * right + y * up
    hit = first_hit(bodies, through[None], -n)
    if not np.isfinite(hit[0][0]).all():
        place = f"({x * 1e3:g}, {y * 1e3:g}) mm"
        raise OffSurface(f"A defect must lie on {bodies[0].name}; at {place} there is no surface.")
    point, z = hit[0][0], hit[1][0]
    z = z / np.linalg.norm(z)
    ex = right - z * (right @ z)
    ex /= np.linalg.norm(ex)
    ey = np.cross(z, ex)
    c, s = np.cos(angle), np.sin(angle)
    world_from_defect = np.eye(4)
    world_from_defect[:3, :3] = np.stack([c * ex + s * ey, c * ey - s * ex, z], axis=1)
    world_from_defect[:3, 3] = point
    return np.linalg.inv(world_from_defect)


def runs_over_edge(bodies: Sequence[Body], defect_from_world: np.ndarray, shape: Footprint) -> bool:
    """Whether somewhere on the outline there is no surface, or one that looks elsewhere."""
    outline = shape.outline() * 1.001
    world_from_defect = np.linalg.inv(defect_from_world)
    n = world_from_defect[:3, 2]
    points = apply(world_from_defect, np.column_stack([outline, np.zeros(len(outline))]))
    hit, normals = first_hit(bodies, points, -n)
    off = np.abs((hit - points) @ n)
    return bool((~np.isfinite(off) | (off > max(shape.reach)) | (normals @ n < STEEP)).any())


def first_hit(
    bodies: Sequence[Body], through: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where lines ``through`` (N, 3) along ``direction`` (3,) first meet the bodies' front: points and shading normals
    (N, 3), world; NaN where they do not. Möller, Trumbore: Fast, minimum storage ray/triangle intersection. 1997."""
    best = np.full(len(through), np.inf)
    normals = np.full((len(through), 3), np.nan)
    for body in bodies:
        corners = apply(body.world_from_body, body.mesh.vertices)[body.mesh.faces]
        n = body.mesh.normals @ np.linalg.inv(body.world_from_body[:3, :3])
        a, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        p = np.cross(direction, e2)
        det = np.sum(e1 * p, axis=1)
        good = np.abs(det) > 1e-30
        inverse = np.where(good, 1 / np.where(good, det, 1), 0)
        for k, point in enumerate(through):
            s = point - a
            u = np.sum(s * p, axis=1) * inverse
            q = np.cross(s, e1)
            v = (q @ direction) * inverse
            t = np.sum(e2 * q, axis=1) * inverse
            met = good & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
            t = np.where(met, t, np.inf)
            f = int(np.argmin(t))
            if t[f] < best[k]:
                best[k] = t[f]
                w = np.array([1 - u[f] - v[f], u[f], v[f]])
                normal = w @ n[body.mesh.faces[f]]
                normals[k] = normal / np.linalg.norm(normal)
    along = np.where(np.isfinite(best), best, np.nan)
    points = through + along[:, None] * direction
    facing = np.sum(normals * -direction, axis=1)
    return points, np.where((facing < 0)[:, None], -normals, normals)

"""Parts do not meet: no triangles cross, none lies inside another, and the distance is at least the clearance.

Touching is meeting. Triangles by trimesh and FCL (Pan, Chitta, Manocha: FCL: a general purpose library for
collision and proximity queries. ICRA 2012); a part inside another by the winding number of one of its points (van
Oosterom, Strackee: The solid angle of a plane triangle. 1983).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from analysis.sweep.constraint import Constraint, Moment
from analysis.sweep.pieces import object_of, pieces_of
from interchange.formats.bop import rigid_and_stretch
from interchange.frames import apply
from interchange.mesh import Mesh
from interchange.parameter import parameter
from interchange.scene import Body, Scene


@dataclass(frozen=True)
class NoCollision(Constraint):
    cost = 1
    word = "with"

    clearance: float = parameter(0.0, "c", "mm", 0, 1e5, "least distance")

    def breaks(self, moment: Moment) -> bool:
        own = list(pieces_of(moment.scene, self.of))
        rest = [b for b in moment.scene.bodies if object_of(b.name) not in self.of]
        others = [b for b in rest if not self.against or object_of(b.name) in self.against]
        if not own or not others or _apart(own, others, 1e-3 * self.clearance):
            return False
        a, b = _manager(own), _manager(others)
        if a.in_collision_other(b):
            return True
        if self.clearance > 0 and a.min_distance_other(b) < 1e-3 * self.clearance:
            return True
        return any(_inside(x, y) or _inside(y, x) for x in own for y in others)


def _apart(a: list[Body], b: list[Body], clearance: float) -> bool:
    """Whether already the boxes are."""
    (low, high), (other_low, other_high) = Scene(tuple(a)).bounds, Scene(tuple(b)).bounds
    return bool(((low - clearance > other_high) | (other_low - clearance > high)).any())


def _manager(bodies: list[Body]) -> Any:
    from trimesh import collision

    library: Any = collision  # without annotations
    manager = library.CollisionManager()
    for k, body in enumerate(bodies):
        rigid, stretch = rigid_and_stretch(body.world_from_body)
        manager.add_object(str(k), _solid(body.mesh, tuple(np.round(stretch[:3, :3], 12).ravel())), rigid)
    return manager


@lru_cache(maxsize=256)
def _solid(mesh: Mesh, stretch: tuple[float, ...]) -> Any:
    import trimesh

    vertices = mesh.vertices @ np.reshape(stretch, (3, 3)).T
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def _inside(a: Body, b: Body) -> bool:
    """Whether ``a``, which crosses no triangle of ``b``, lies in it."""
    point = apply(a.world_from_body, a.mesh.vertices[:1])[0]
    return abs(winding_number(point, apply(b.world_from_body, b.mesh.vertices)[b.mesh.faces])) > 0.5


def winding_number(point: np.ndarray, corners: np.ndarray) -> float:
    """How often triangles (F, 3, 3) go round a point (3,): the solid angle of all over 4 π."""
    a, b, c = (corners - point).transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.sum(a * np.cross(b, c), axis=1)
    rest = la * lb * lc + np.sum(a * b, axis=1) * lc + np.sum(b * c, axis=1) * la + np.sum(c * a, axis=1) * lb
    return float(np.sum(2 * np.arctan2(volume, rest)) / (4 * np.pi))

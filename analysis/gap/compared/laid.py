"""Where pixels of a material lie on its bodies: along the two longest sides of each one's own box."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from interchange.camera import Camera
from interchange.effects.texture import box_uv, sides
from interchange.effects.translucency import Translucency
from interchange.frames import apply
from interchange.mesh import Mesh

LARGEST = 1024  # texels a side

Laid = tuple[str, tuple[np.ndarray, ...], np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Part:
    """What is seen of a body: ``low`` and ``high`` (2,) are the least and the largest of its box coordinates there;
    ``shape``: rows and columns that it has, each as large as a pixel of the view that shows it largest."""

    low: np.ndarray
    high: np.ndarray
    shape: tuple[int, int]

    def texel(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns and rows of box coordinates, 0 in the middle of the first."""
        x, y = self.share(u, v)
        return x * self.shape[1] - 0.5, y * self.shape[0] - 0.5

    def share(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of the part's sides, from 0 to 1."""
        wide, high = np.maximum(self.high - self.low, 1e-12)
        return (u - self.low[0]) / wide, (v - self.low[1]) / high

    def and_also(self, other: "Part") -> "Part":
        rows, columns = (max(a, b) for a, b in zip(self.shape, other.shape, strict=True))
        return Part(np.minimum(self.low, other.low), np.maximum(self.high, other.high), (rows, columns))


def laid(s: State, name: str) -> list[Laid]:
    """Of each body of a material: its name, where it is in the image (h, w), and its box coordinates (n,) there."""
    key = ("laid", name)
    if key not in s.kept:
        s.kept[key] = list(_found(s, name))
    found: list[Laid] = s.kept[key]
    return found


def parts(conditions: Sequence[Condition], names: Sequence[str]) -> dict[str, dict[str, Part]]:
    """Of each body that is seen of the materials ``names``, by material."""
    out: dict[str, dict[str, Part]] = {name: {} for name in names}
    for c in {(id(c.shown), c.camera.name): c for c in conditions}.values():
        state, meshes = State(c), {b.name: b.mesh for b in c.shown.scene.bodies}
        for name in (n for n in names if n in c.shown.scene.material_names):
            for body, own, u, v in laid(state, name):
                if len(u):
                    seen = _part(meshes[body], c.shown.passes["depth"][own], c.camera, u, v)
                    out[name][body] = seen.and_also(out[name].get(body, seen))
    return out


def _part(mesh: Mesh, depth: np.ndarray, camera: Camera, u: np.ndarray, v: np.ndarray) -> Part:
    low, high = np.array([u.min(), v.min()]), np.array([u.max(), v.max()])
    size = 1e3 * np.ptp(mesh.bounds, axis=0)[list(sides(mesh))] * (high - low)  # mm
    px = np.median(Translucency(1.0).sigma_px(depth, camera))  # a mm
    columns, rows = np.clip(np.ceil(size * px), 1, LARGEST).astype(int)
    return Part(low, high, (int(rows), int(columns)))


def _found(s: State, name: str) -> Iterator[Laid]:
    scene = s.shown.scene
    mask = s.take(s.shown.passes["material_id"]) == scene.material_names.index(name)
    objects = s.take(s.shown.passes["object_id"])
    for body in scene.bodies:
        if body.material.name == name:
            own = np.nonzero(mask & (objects == scene.object_names.index(body.name)))
            at = apply(np.linalg.inv(body.world_from_body), s.position[own])
            u, v = np.moveaxis(box_uv(body.mesh, at).astype(np.float32), -1, 0)
            yield body.name, own, u, v

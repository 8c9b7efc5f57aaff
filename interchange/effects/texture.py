"""A material's albedo varies over its surface, which the scene says to be even.

ρ' = ρ (1 + Σ c_ij cos(π i u) cos(π j v)),    u, v from 0 to 1 along the two longest sides of the object's box
ρ' = ρ f(u, v)                                of a pattern that has no formula (``painted``)
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_materials
from interchange.material import Material, Wrap
from interchange.material import Texture as Map
from interchange.mesh import Mesh
from interchange.parameter import parameter
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene

SIDE = 128  # px of the map
WAVES = {"c10": (1, 0), "c01": (0, 1), "c20": (2, 0), "c02": (0, 2), "c11": (1, 1)}  # half waves along u, v


@dataclass(frozen=True)
class Texture(Effect):
    """Laid flat onto the object. A material with textures of its own cannot have it."""

    stage = Stage.MATERIAL
    order = 40
    source = "Ahmed, Natarajan, Rao: Discrete cosine transform. IEEE Trans. Computers C-23(1), 1974."
    identified_by = (
        "A pattern that moves with the surface and is the same under every lamp and in every pose."
    )
    confused_with = ("albedo", "light_beam", "translucency")
    separated_by = "the same object moved or turned under the same lamps"

    c10: float = parameter(0.0, "c_10", "1", -0.9, 0.9, "from one end of the longest side to the other")
    c01: float = parameter(0.0, "c_01", "1", -0.9, 0.9, "from one end of the second side to the other")
    c20: float = parameter(0.0, "c_20", "1", -0.9, 0.9, "ends of the longest side against its middle")
    c02: float = parameter(0.0, "c_02", "1", -0.9, 0.9, "ends of the second side against its middle")
    c11: float = parameter(0.0, "c_11", "1", -0.9, 0.9, "corners against their neighbours")

    def factor(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Albedo over the scene's, at box coordinates."""
        total = np.ones(np.broadcast(u, v).shape)
        for name, (i, j) in WAVES.items():
            total = total + getattr(self, name) * np.cos(np.pi * i * u) * np.cos(np.pi * j * v)
        return np.maximum(total, 0)

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        painted = with_materials(scene, target, self._painted)
        meshes: dict[int, Mesh] = {}
        pairs = zip(painted.bodies, scene.bodies, strict=True)
        return replace(painted, bodies=tuple(b if b is old else _laid(b, meshes) for b, old in pairs))

    def _painted(self, material: Material) -> Material:
        at = (np.arange(SIDE) + 0.5) / SIDE
        return _with_map(material, self.factor(at[None, :], at[::-1, None]))


def painted(scene: Scene, target: str, patterns: Mapping[str, np.ndarray]) -> Scene:
    """The material ``target`` with a pattern of no formula: ``patterns`` {body: (h, w)} is albedo over the scene's,
    from 0 to 1 along the two longest sides of the body's box, row 0 where v is 0. What bodies share one material have
    their patterns one above the other in one texture; those without one stay as the scene says.

    Raises BrightfieldError where the material cannot have a texture.
    """
    bodies = [b.name for b in scene.bodies if b.material.name == target]
    planes = [np.pad(patterns.get(name, np.ones((1, 1))), 1, mode="edge") for name in dict.fromkeys(bodies)]
    h, w = sum(len(x) for x in planes), max(x.shape[1] for x in planes)
    atlas, first, where = np.ones((h, w)), 0, {}
    for name, plane in zip(dict.fromkeys(bodies), planes, strict=True):
        rows, columns = plane.shape
        atlas[first : first + rows, :columns] = plane
        size = np.array([columns - 2, rows - 2])
        where[name] = (np.array([1, first + 1]) / (w, h), size / (w, h))
        first += rows
    changed = with_materials(scene, target, lambda material: _with_map(material, atlas[::-1]))
    laid = []
    for body in changed.bodies:
        if body.material.name == target:
            low, size = where[body.name]
            uv = low + size * box_uv(body.mesh, body.mesh.vertices)
            body = replace(body, mesh=replace(body.mesh, uv=uv))
        laid.append(body)
    return replace(changed, bodies=tuple(laid))


def _with_map(material: Material, factor: np.ndarray) -> Material:
    """``factor`` (h, w) times its body colour, row 0 on top."""
    if not material.brdf.matte or material.maps or material.normal_map is not None:
        raise BrightfieldError(
            f"A texture needs a material with a body colour and without textures of its own; got {material.name}."
        )
    rho = np.asarray(getattr(material.brdf, material.brdf.matte))
    pixels = np.clip(factor[..., None] * rho, 0, 1).astype(np.float32)
    return replace(material, maps={material.brdf.matte: Map(pixels, (Wrap.CLAMP, Wrap.CLAMP))})


def sides(mesh: Mesh) -> tuple[int, int]:
    """The axes of the two longest sides of a mesh's box."""
    order = np.argsort(-np.ptp(mesh.bounds, axis=0), kind="stable")
    return int(order[0]), int(order[1])


def box_uv(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """(..., 2): where points (..., 3) of the body's frame lie along the two longest sides of its box, 0 to 1."""
    low, high = mesh.bounds[:, list(sides(mesh))]
    return (points[..., list(sides(mesh))] - low) / np.maximum(high - low, 1e-12)


def _laid(body: Body, meshes: dict[int, Mesh]) -> Body:
    mesh = body.mesh
    if id(mesh) not in meshes:
        meshes[id(mesh)] = replace(mesh, uv=box_uv(mesh, mesh.vertices))
    return replace(body, mesh=meshes[id(mesh)])

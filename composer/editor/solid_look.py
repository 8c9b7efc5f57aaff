"""The overview's plain look: surfaces matte in their colour, lit from the eye, so that shape is seen without lamps."""

from dataclasses import replace
from typing import Any

import numpy as np

from interchange.brdf.lambert import Lambert
from interchange.formats.usd_preview import preview_of
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene


class SolidLook:
    """Keeps what it made of a material and of a body, so that a renderer finds them again."""

    def __init__(self) -> None:
        self._materials: dict[int, tuple[Material, Material]] = {}
        self._bodies: dict[int, tuple[Body, Body]] = {}

    def scene(self, scene: Scene, world_from_camera: np.ndarray) -> Scene:
        """``scene`` with matte bodies and a headlight; the lamps' own light is left out."""
        bodies = {id(b): self._bodies.get(id(b)) or (b, self._body(b)) for b in scene.bodies}
        self._bodies = bodies
        shown = tuple(bodies[id(b)][1] for b in scene.bodies)
        return replace(scene, bodies=shown, lights=headlights(world_from_camera))

    def _body(self, body: Body) -> Body:
        return replace(body, material=self._material(body.material))

    def _material(self, material: Material) -> Material:
        found = self._materials.get(id(material))
        if found is None:
            keeps = bool(material.maps) or bool(material.glsl)
            matte = material if keeps else Material(material.name, Lambert(color_of(material)))
            found = self._materials[id(material)] = (material, matte)
            if len(self._materials) > 4096:
                self._materials = {id(material): found}
        return found[1]


def color_of(material: Material) -> tuple[float, float, float]:
    """Of the preview surface that looks like it, lightened: the shape of black things is seen, too."""
    r, g, b = (max(0.20, min(0.80, 0.15 + 0.85 * float(x))) for x in preview_of(material.brdf).diffuseColor)
    return r, g, b


def headlights(world_from_camera: np.ndarray) -> tuple[Light, ...]:
    """From over the left shoulder, and a weaker one from the right: a matte white surface is about 1."""
    found: list[Any] = []
    for name, (x, y, z), irradiance in (
        ("key", (0.35, 0.5, 1.0), 0.80 * np.pi),
        ("fill", (-0.8, -0.1, 0.5), 0.28 * np.pi),
    ):
        n = np.array([x, y, z]) / np.linalg.norm([x, y, z])  # towards the scene, in the camera's frame
        side = np.cross([0.0, 1.0, 0.0], -n)
        side /= np.linalg.norm(side)
        local = np.eye(4)
        local[:3, :3] = np.stack([side, np.cross(-n, side), -n], axis=1)
        pose = world_from_camera @ local
        color = (irradiance, irradiance, irradiance)
        found.append(Light(name, LightKind.DISTANT, color, pose, casts_shadows=False))
    return tuple(found)

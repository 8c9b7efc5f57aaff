"""A lamp shines less to the side than the scene says: I(θ) = I(0) cos^m θ about its axis.

A lamp without a beam of its own is turned to the scene's middle.
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_lights
from interchange.light import Light, LightKind
from interchange.parameter import parameter
from interchange.scene import Scene


@dataclass(frozen=True)
class LightBeam(Effect):
    """Distant light and domes have no beam and stay. m < 0 is a lamp that is brighter to the side."""

    stage = Stage.SCENE
    order = 60
    source = "Moreno, Sun: Modeling the radiation pattern of LEDs. Optics Express 16(3), 2008."
    identified_by = "A fall-off that is fixed to the lamp: it stays on the part when the camera moves."
    confused_with = ("vignetting", "light_position", "albedo")
    separated_by = "the same lamp from another pose of the camera, a flat plate in view"

    m: float = parameter(0.0, "m", "1", -0.9, 1e3, "exponent of the cosine, beside the lamp's own")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        middle = scene.bounds.mean(axis=0)

        def change(light: Light) -> Light:
            if light.kind in (LightKind.DISTANT, LightKind.DOME):
                return light
            axes = beam_axes(light, middle)
            there = light.world_from_light.copy()
            there[:3, :3] = axes
            return replace(light, world_from_light=there, focus=light.focus + self.m)

        return with_lights(scene, target, change)


def beam_axes(light: Light, middle: np.ndarray) -> np.ndarray:
    """(3, 3): the lamp's axes in the world, z against its beam, which points to ``middle`` (3,) m where a lamp shines
    everywhere alike."""
    own = light.kind in (LightKind.DISK, LightKind.RECT, LightKind.CYLINDER) or light.focus != 0
    if own or light.cone_angle < np.pi or light.beam is not None:
        return light.world_from_light[:3, :3]
    z = light.world_from_light[:3, 3] - middle
    z = z / max(float(np.linalg.norm(z)), 1e-12)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)

"""A lamp stands elsewhere than the scene says; where it points to stays."""

from dataclasses import dataclass, replace

import numpy as np

from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_lights
from interchange.light import Light, LightKind
from interchange.parameter import parameter
from interchange.scene import Scene


@dataclass(frozen=True)
class LightPosition(Effect):
    """Distant light and domes have no position and stay."""

    stage = Stage.SCENE
    order = 40
    source = (
        "Powell, Sarkar, Goldgof: A simple strategy for calibrating the geometry of light sources. PAMI 2001."
    )
    identified_by = "Shadow edges and highlights of one lamp shift, and its light falls off to another side."
    confused_with = ("light_beam", "light_intensity", "object_pose")
    separated_by = "the lamp alone, with an object that casts a shadow in view"

    x: float = parameter(0.0, "x", "mm", -1e6, 1e6, "moved along the world's x axis")
    y: float = parameter(0.0, "y", "mm", -1e6, 1e6, "moved along the world's y axis")
    z: float = parameter(0.0, "z", "mm", -1e6, 1e6, "moved upwards")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene

        def change(light: Light) -> Light:
            if light.kind in (LightKind.DISTANT, LightKind.DOME):
                return light
            there = light.world_from_light.copy()
            there[:3, 3] += 1e-3 * np.array([self.x, self.y, self.z])
            return replace(light, world_from_light=there)

        return with_lights(scene, target, change)

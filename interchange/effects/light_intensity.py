"""A lamp is brighter or darker than the scene says, alike in all channels: I' = scale I."""

from dataclasses import dataclass, replace

from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_lights
from interchange.light import Light
from interchange.parameter import parameter
from interchange.scene import Scene


@dataclass(frozen=True)
class LightIntensity(Effect):
    stage = Stage.SCENE
    order = 50
    source = "CIE 070-1987: The measurement of absolute luminous intensity distributions."
    identified_by = "All that one lamp lights is brighter by one factor, and its shadows stay as they are."
    confused_with = ("exposure", "albedo", "light_position")
    separated_by = "each lamp alone, at the same exposure"

    scale: float = parameter(1.0, "s", "1", 0, 1e3, "intensity over the one that the scene gives")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene

        def change(light: Light) -> Light:
            r, g, b = (self.scale * x for x in light.intensity)
            return replace(light, intensity=(r, g, b))

        return with_lights(scene, target, change)

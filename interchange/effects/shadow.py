"""A lamp's shadows are lighter than the scene says: a share of its light goes through what should stop it.

L' = (1 - share) L + share L_unshadowed,    L_unshadowed: the lamp without shadows

Occluders that reality lacks, shadow that a renderer draws too dark, or light that goes round an edge.
"""

from dataclasses import dataclass, replace

from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_lights
from interchange.light import Light
from interchange.parameter import parameter
from interchange.scene import Scene

TWIN = "_unshadowed"  # what the name of the lamp that lights the shadows ends with


@dataclass(frozen=True)
class Shadow(Effect):
    """The scene has the share as a second lamp in the first one's place, which casts no shadows."""

    stage = Stage.SCENE
    order = 75
    source = "Woo, Poulin, Fournier: A survey of shadow algorithms. IEEE CG&A 10(6), 1990."
    identified_by = "Only what lies in one lamp's shadow is brighter, by a share of that lamp's light."
    confused_with = ("ambient_light", "interreflection", "light_size", "veiling_glare")
    separated_by = "each lamp alone, the occluder in place and taken away"

    share: float = parameter(0.0, "s", "1", 0, 1, "of the lamp's light that reaches its shadows")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        twins: list[Light] = []

        def change(light: Light) -> Light:
            r, g, b = (self.share * x for x in light.intensity)
            twins.append(replace(light, name=light.name + TWIN, intensity=(r, g, b), casts_shadows=False))
            left = 1 - self.share
            return replace(light, intensity=tuple(left * x for x in light.intensity))  # type: ignore[arg-type]

        kept = with_lights(scene, target, change)
        return replace(kept, lights=(*kept.lights, *twins))

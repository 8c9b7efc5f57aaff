"""A lamp is larger than the scene says: penumbrae and highlights are wider, its intensity is the same.

r'² = r² + s² sign(s)  (sphere, disk, cylinder);    (w / 2)'² = (w / 2)² + s² sign(s) a side of a rect
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_lights
from interchange.light import Light, LightKind
from interchange.parameter import parameter
from interchange.scene import Scene


@dataclass(frozen=True)
class LightSize(Effect):
    """In squares, as widths of penumbrae add up. Distant light and domes stay."""

    stage = Stage.SCENE
    order = 70
    source = "Hasenfratz, Lapierre, Holzschuch, Sillion: A survey of real-time soft shadows. CGF 22(4), 2003."
    identified_by = "Shadow edges blur, the more the farther the occluder; edges of objects stay sharp."
    confused_with = ("defocus", "gloss", "translucency", "shadow")
    separated_by = "one lamp alone, with an edge near a surface and one far above it in view"

    spread: float = parameter(
        0.0, "s", "mm", -1e5, 1e5, "growth of its half width, in squares; negative: smaller"
    )

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        return with_lights(scene, target, self._grown) if self.is_there else scene

    def _grown(self, light: Light) -> Light:
        match light.kind:
            case LightKind.SPHERE | LightKind.DISK | LightKind.CYLINDER:
                return replace(light, radius=self._half(light.radius))
            case LightKind.RECT:
                w, h = (2 * self._half(x / 2) for x in (light.width, light.height))
                return replace(light, width=w, height=h)
            case _:
                return light

    def _half(self, half: float) -> float:
        square = half**2 + np.sign(self.spread) * (1e-3 * self.spread) ** 2
        return float(np.sqrt(max(square, 0.0)))

"""An object is larger or smaller than the scene says; it still stands where it stood.

X' = c + scale diag(1, 1, height) (X - c),    c the middle of its underside, z upwards
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.effects.base import Effect, Stage
from interchange.effects.parts import bounds, with_bodies
from interchange.parameter import parameter
from interchange.scene import Body, Scene


@dataclass(frozen=True)
class Geometry(Effect):
    stage = Stage.SCENE
    order = 30
    source = "ISO 14405-1:2016: Geometrical product specifications, linear sizes."
    identified_by = "Opposite edges of one object move apart, and its shadow grows with its height."
    confused_with = ("object_pose", "camera_pose", "shadow")
    separated_by = "the same object from above and from the side, or a gauge block of known size beside it"

    scale: float = parameter(1.0, "s", "1", 0.01, 100, "size over the one that the scene gives")
    height: float = parameter(1.0, "h", "1", 0.01, 100, "height over the one of that size")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene

        def change(body: Body) -> Body:
            low, high = bounds(scene, target or body.name)
            fixed = np.array([*(low[:2] + high[:2]) / 2, low[2]])
            grown = np.diag([self.scale, self.scale, self.scale * self.height, 1.0])
            grown[:3, 3] = fixed - np.diag(grown)[:3] * fixed
            return replace(body, world_from_body=grown @ body.world_from_body)

        return with_bodies(scene, target, change)

"""An object lies elsewhere than the scene says: moved, and turned about axes through its middle, the vertical one last.

Several objects named together are one that moves as a whole: a workpiece of many parts.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from interchange.effects.base import Effect, Stage
from interchange.effects.parts import bounds, with_bodies
from interchange.parameter import parameter
from interchange.scene import Body, Scene


@dataclass(frozen=True)
class ObjectPose(Effect):
    stage = Stage.SCENE
    order = 20
    source = "Hartley, Zisserman: Multiple View Geometry, 2nd ed., 2004, section 2.4."
    identified_by = (
        "One object's outline and shadow shift, its shading changes as it tilts; what surrounds it stays."
    )
    confused_with = ("camera_pose", "geometry")
    separated_by = "the same object seen from a second camera"

    x: float = parameter(0.0, "x", "mm", -1e5, 1e5, "moved along the world's x axis")
    y: float = parameter(0.0, "y", "mm", -1e5, 1e5, "moved along the world's y axis")
    z: float = parameter(0.0, "z", "mm", -1e5, 1e5, "moved upwards")
    rz: float = parameter(
        0.0, "r_z", "mrad", -3200, 3200, "turned about the vertical, counter-clockwise from above"
    )

    rx: float = parameter(0.0, "r_x", "mrad", -3200, 3200, "tilted about the world's x axis, first of all")
    ry: float = parameter(0.0, "r_y", "mrad", -3200, 3200, "tilted about the world's y axis")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        turned = np.eye(4)
        turned[:3, :3] = Rotation.from_euler(
            "xyz", [1e-3 * self.rx, 1e-3 * self.ry, 1e-3 * self.rz]
        ).as_matrix()

        def change(body: Body) -> Body:
            middle = bounds(scene, target or body.name).mean(axis=0)
            there = turned.copy()
            there[:3, 3] = middle - turned[:3, :3] @ middle + 1e-3 * np.array([self.x, self.y, self.z])
            return replace(body, world_from_body=there @ body.world_from_body)

        return with_bodies(scene, target, change)

"""A part that lies elsewhere, moved and turned about the middle of its box. Its ground truth is where it is seen and
where it should be seen, together."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from analysis.sweep.defect import Defect, Placed
from analysis.sweep.pieces import names_of, pieces_of
from analysis.sweep.pose import Pose
from analysis.sweep.surface import Anchor
from analysis.sweep.truth import alone, drawn_mask, mask_of
from interchange.camera import Camera
from interchange.image import Image
from interchange.parameter import parameter
from interchange.scene import Scene


@dataclass(frozen=True)
class Misplacement(Defect):
    source = "Hartley, Zisserman: Multiple View Geometry, 2nd ed., 2004, section 2.4."

    tx: float = parameter(0.0, "t_x", "mm", -1e5, 1e5, "moved along the world's x axis")
    ty: float = parameter(0.0, "t_y", "mm", -1e5, 1e5, "moved along the world's y axis")
    tz: float = parameter(0.0, "t_z", "mm", -1e5, 1e5, "moved upwards")
    rx: float = parameter(0.0, "r_x", "mrad", -3600, 3600, "turned about the world's x axis")
    ry: float = parameter(0.0, "r_y", "mrad", -3600, 3600, "turned about the world's y axis")
    rz: float = parameter(0.0, "r_z", "mrad", -3600, 3600, "turned about the vertical")

    def on(self, scene: Scene, target: str, anchor: Anchor, label: str) -> Placed:
        pose = Pose(self.tx, self.ty, self.tz, self.rx, self.ry, self.rz)
        own = pieces_of(scene, [target])
        middle = Scene(own).bounds.mean(axis=0)
        moved = tuple(
            replace(b, world_from_body=pose.in_world(b.world_from_body, middle)) if b in own else b
            for b in scene.bodies
        )
        after = replace(scene, bodies=moved)

        def truth(live: Any, camera: Camera, image: Image) -> tuple[np.ndarray, np.ndarray]:
            names = names_of(scene.object_names, target)
            should = drawn_mask(live, scene, camera, names)
            both = alone(live, scene, camera, names) | alone(live, after, camera, names)
            return mask_of(image, names_of(image.object_names, target)) | should, both

        return Placed(after, truth)

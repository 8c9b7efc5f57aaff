"""The camera stands elsewhere than the scene says: what it sees moves as a rigid body in its frame.

X' = R(r) X + t,    X a point in the camera's frame (x right, y down, z forward)
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_cameras
from interchange.parameter import parameter
from interchange.scene import Scene


@dataclass(frozen=True)
class CameraPose(Effect):
    stage = Stage.SCENE
    order = 10
    source = "Hartley, Zisserman: Multiple View Geometry, 2nd ed., 2004, section 6.1."
    identified_by = (
        "Every edge shifts, near ones more than far ones; each stand of the camera has its own shift."
    )
    confused_with = ("object_pose", "principal_point", "lens_distortion", "geometry")
    separated_by = "the same scene from a second pose of the camera"

    tx: float = parameter(0.0, "t_x", "mm", -1e5, 1e5, "what is seen moves to the right")
    ty: float = parameter(0.0, "t_y", "mm", -1e5, 1e5, "what is seen moves down")
    tz: float = parameter(0.0, "t_z", "mm", -1e5, 1e5, "what is seen moves away")
    rx: float = parameter(0.0, "r_x", "mrad", -3200, 3200, "and turns about the camera's x axis")
    ry: float = parameter(0.0, "r_y", "mrad", -3200, 3200, "and turns about the camera's y axis")
    rz: float = parameter(0.0, "r_z", "mrad", -3200, 3200, "and turns about the camera's z axis")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        moved = np.eye(4)
        moved[:3, :3] = Rotation.from_rotvec(1e-3 * np.array([self.rx, self.ry, self.rz])).as_matrix()
        moved[:3, 3] = 1e-3 * np.array([self.tx, self.ty, self.tz])
        back = np.linalg.inv(moved)

        def change(camera: Camera) -> Camera:
            return replace(camera, world_from_camera=camera.world_from_camera @ back)

        return with_cameras(scene, target, change)

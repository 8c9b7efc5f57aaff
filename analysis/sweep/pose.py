"""A thing moved and turned from where the scene has it: by six numbers, all 0 where it stays.

pose:  along the world's axes, turned about its own pivot      x' = R(r) (x - c) + c + t
own:   along its own axes, turned about its own origin         world_from_thing' = world_from_thing [R(r) t; 0 1]

r is a rotation vector: its direction the axis, its length the angle. A camera has x right, y down, z forward; a
lamp shines along its own -z.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from interchange.parameter import freeze, parameter

FAR = 1e5  # mm
TURN = 3600.0  # mrad: a little more than half a turn


@dataclass(frozen=True)
class Pose:
    tx: float = parameter(0.0, "t_x", "mm", -FAR, FAR, "moved along x")
    ty: float = parameter(0.0, "t_y", "mm", -FAR, FAR, "moved along y")
    tz: float = parameter(0.0, "t_z", "mm", -FAR, FAR, "moved along z")
    rx: float = parameter(0.0, "r_x", "mrad", -TURN, TURN, "turned about x")
    ry: float = parameter(0.0, "r_y", "mrad", -TURN, TURN, "turned about y")
    rz: float = parameter(0.0, "r_z", "mrad", -TURN, TURN, "turned about z")

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def matrix(self) -> np.ndarray:
        """(4, 4), m."""
        moved = np.eye(4)
        moved[:3, :3] = Rotation.from_rotvec(1e-3 * np.array([self.rx, self.ry, self.rz])).as_matrix()
        moved[:3, 3] = 1e-3 * np.array([self.tx, self.ty, self.tz])
        return moved

    def in_world(self, world_from_thing: np.ndarray, pivot: np.ndarray) -> np.ndarray:
        """``pivot`` (3,): the world point that is only moved, m."""
        there = self.matrix
        there[:3, 3] += pivot - there[:3, :3] @ pivot
        return there @ world_from_thing

    def in_own(self, world_from_thing: np.ndarray) -> np.ndarray:
        return world_from_thing @ self.matrix

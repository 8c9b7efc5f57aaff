"""The frames that the program meets, and the named matrices between them.

Inside: world right-handed, z up, metres. Camera x right, y down, z forward. A transform is called
``a_from_b`` and maps column vectors: ``p_a = a_from_b @ p_b``, so names chain.
"""

import numpy as np

# OpenGL, USD and Blender cameras look along -z with y up
gl_from_camera = np.diag([1.0, -1.0, -1.0, 1.0])
camera_from_gl = gl_from_camera

# a y-up world (USD's and COLLADA's default) brought to z up: x stays, y becomes z
z_up_from_y_up = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
# an x-up world (COLLADA's X_UP: right is -y, in is z) brought to z up
z_up_from_x_up = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])


def apply(a_from_b: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (..., 3) of frame b in frame a."""
    return points @ a_from_b[:3, :3].T + a_from_b[:3, 3]


def look_at(eye: np.ndarray, target: np.ndarray, up: tuple[float, float, float] = (0, 0, 1)) -> np.ndarray:
    """``world_from_camera`` (4, 4) of a camera at ``eye`` whose axis meets ``target``; image up is along ``up``.

    ``up`` parallel to the axis is replaced by y.
    """
    eye = np.asarray(eye, np.float64)
    z = np.asarray(target, np.float64) - eye
    z /= np.linalg.norm(z)
    x = np.cross(z, up)
    if np.linalg.norm(x) < 1e-9:
        x = np.cross(z, (0.0, 1.0, 0.0))
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    pose[:3, 3] = eye
    return pose

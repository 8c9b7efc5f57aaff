"""Poses as a person types them: position, rotation about x, then y, then z, and scale.

world_from_prim = T(position) Rz Ry Rx S(scale)
"""

from collections.abc import Sequence

import numpy as np

from interchange.frames import look_at
from interchange.problems import BrightfieldError

Numbers = Sequence[float] | np.ndarray


def from_position(position: Sequence[float], target: Sequence[float]) -> np.ndarray:
    """``world_from_camera`` (4, 4) at ``position`` that looks at ``target``, m."""
    eye, at = np.asarray(position, np.float64), np.asarray(target, np.float64)
    if eye.shape != (3,) or at.shape != (3,) or not np.isfinite([eye, at]).all():
        raise BrightfieldError(f"A position must be three finite numbers; got {position} and {target}.")
    return look_at(eye, at if np.linalg.norm(at - eye) > 1e-12 else eye - [0.0, 0.0, 1.0])


def split(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(position m, rotation degrees, scale), (3,) each, of a pose without shear; a mirror has a negative x scale."""
    linear = pose[:3, :3]
    scale = np.linalg.norm(linear, axis=0)
    scale = np.where(scale > 0, scale, 1.0) * [np.sign(np.linalg.det(linear)) or 1.0, 1, 1]
    R = linear / scale
    y = np.arcsin(np.clip(-R[2, 0], -1, 1))
    if abs(R[2, 0]) < 1 - 1e-9:
        x, z = np.arctan2(R[2, 1], R[2, 2]), np.arctan2(R[1, 0], R[0, 0])
    else:  # z and x turn about one axis
        x, z = np.arctan2(-R[1, 2], R[1, 1]), 0.0
    return pose[:3, 3].copy(), np.degrees([x, y, z]), scale


def rotation(degrees: Numbers) -> np.ndarray:
    """(3, 3) about x, then y, then z."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    X = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    Y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    Z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(Z @ Y @ X)


def pose_of(
    now: np.ndarray,
    position: Sequence[float] | None,
    degrees: Sequence[float] | None,
    scale: Sequence[float] | None,
) -> np.ndarray:
    """``now`` with what is given replaced."""
    for values in (position, degrees, scale):
        if values is not None and (np.shape(values) != (3,) or not np.isfinite(values).all()):
            raise BrightfieldError(f"A placement must be three finite numbers; got {values}.")
    if scale is not None and not np.all(np.asarray(scale) != 0):
        raise BrightfieldError(f"A scale must not be 0; got {tuple(scale)}.")
    own = split(now)
    pose = np.eye(4)
    pose[:3, 3] = own[0] if position is None else position
    if degrees is None and scale is None:
        pose[:3, :3] = now[:3, :3]
    else:
        pose[:3, :3] = rotation(own[1] if degrees is None else degrees) * (own[2] if scale is None else scale)
    return pose


def turned(axis: Numbers, degrees: float, about: Numbers) -> np.ndarray:
    """(4, 4): a turn by ``degrees`` about ``axis`` through the point ``about``, m."""
    n = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    a = np.radians(degrees)
    K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    R = np.eye(3) + np.sin(a) * K + (1 - np.cos(a)) * K @ K
    return around(R, about)


def around(linear: np.ndarray, about: Numbers) -> np.ndarray:
    """(4, 4): a linear map (3, 3) that leaves the point ``about`` where it is."""
    by = np.eye(4)
    by[:3, :3] = linear
    by[:3, 3] = np.asarray(about) - linear @ np.asarray(about)
    return by


def shifted(by: Numbers) -> np.ndarray:
    """(4, 4): a translation, m."""
    motion = np.eye(4)
    motion[:3, 3] = by
    return motion

"""Reading attributes of a stage while keeping every problem with its place."""

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd

from interchange.problems import Problem, Severity, Where


class Finder:
    """Collects what is wrong or left out while a stage is read."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.problems: list[Problem] = []

    def where(self, prim: Any, attribute: str = "") -> Where:
        return Where(self.file, str(prim.GetPath()), attribute)

    def _add(self, severity: Severity, message: str, prim: Any, attribute: str) -> None:
        problem = Problem(message, self.where(prim, attribute), severity)
        if problem not in self.problems:
            self.problems.append(problem)

    def error(self, message: str, prim: Any, attribute: str = "") -> None:
        self._add(Severity.ERROR, message, prim, attribute)

    def loss(self, message: str, prim: Any, attribute: str = "") -> None:
        self._add(Severity.LOSS, message, prim, attribute)

    def note(self, message: str, prim: Any, attribute: str = "") -> None:
        self._add(Severity.NOTE, message, prim, attribute)

    def value(self, prim: Usd.Prim, name: str, time: Usd.TimeCode) -> Any:
        attribute = prim.GetAttribute(name)
        return attribute.Get(time) if attribute and attribute.HasValue() else None


def matrix(m: Gf.Matrix4d) -> np.ndarray:
    """USD's row-vector matrix as our column-vector one."""
    return np.array(m, np.float64).T


def rigid(world_from_prim: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A transform split into a rigid pose (4, 4) and the lengths (3,) of its axes.

    A mirrored frame keeps its z axis; its x axis is turned round.
    """
    linear = world_from_prim[:3, :3]
    scale = np.linalg.norm(linear, axis=0)
    z = linear[:, 2] / (scale[2] or 1.0)
    y = linear[:, 1] - z * (linear[:, 1] @ z)
    y /= np.linalg.norm(y) or 1.0
    pose = np.eye(4)
    pose[:3, :3] = np.stack([np.cross(y, z), y, z], axis=1)
    pose[:3, 3] = world_from_prim[:3, 3]
    return pose, scale


def asset(attribute: Usd.Attribute, time: Usd.TimeCode) -> tuple[str, str]:
    """(as written, resolved file or "") of an asset attribute."""
    value = attribute.Get(time)
    if not isinstance(value, Sdf.AssetPath) or not value.path:
        return "", ""
    resolved = value.resolvedPath
    return value.path, resolved if resolved and (Path(resolved).exists() or "[" in resolved) else ""

"""Grab, rotate, scale as in Blender: a key, then the mouse; x, y or z holds to an axis, digits say how far.

move    the cursor's way on the plane across the line of sight through the pivot, or along the axis
rotate  the angle that the cursor goes round the pivot, about the line of sight or the axis
scale   the ratio of the cursor's distances from the pivot
"""

from dataclasses import dataclass, replace

import numpy as np

from composer.editor.poses import around, shifted, turned
from interchange.camera import Camera, Projection

AXES = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "z": np.array([0, 0, 1.0])}
Point = tuple[float, float]


@dataclass(frozen=True)
class Modal:
    """``pivot``: m, world; ``start``: px in the view; ``typed``: mm, degrees or a factor."""

    kind: str  # move, rotate, scale
    pivot: tuple[float, float, float]
    start: Point
    axis: str = ""
    typed: str = ""

    def held_to(self, axis: str) -> "Modal":
        """To an axis, or free again if it was held to it already."""
        return replace(self, axis="" if self.axis == axis else axis)

    def with_key(self, key: str) -> "Modal":
        """A digit, a point, a minus sign, or backspace."""
        if key == "backspace":
            return replace(self, typed=self.typed[:-1])
        if key == "-":
            return replace(self, typed=self.typed[1:] if self.typed.startswith("-") else f"-{self.typed}")
        return self if key == "." and "." in self.typed else replace(self, typed=self.typed + key)

    @property
    def number(self) -> float | None:
        try:
            return float(self.typed)
        except ValueError:
            return None

    def motion(self, camera: Camera, cursor: Point, snap: float = 0.0) -> np.ndarray:
        """(4, 4) of the world, m. ``snap``: steps of mm, degrees or a tenth, 0 for none."""
        pivot = np.asarray(self.pivot)
        axis = AXES.get(self.axis)
        match self.kind:
            case "move":
                return shifted(self._offset(camera, cursor, pivot, axis, snap))
            case "rotate":
                angle = self.number
                about = axis if axis is not None else camera.world_from_camera[:3, 2]
                if angle is None:
                    a, b = (np.asarray(p) - self._on_screen(camera, pivot) for p in (self.start, cursor))
                    angle = float(np.degrees(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)))
                    towards = float(about @ camera.world_from_camera[:3, 2])
                    angle = angle if towards >= 0 else -angle
                    angle = _snapped(angle, snap)
                return turned(about, angle, self.pivot)
            case _:
                factor = self.number
                if factor is None:
                    middle = self._on_screen(camera, pivot)
                    first = np.linalg.norm(np.asarray(self.start) - middle)
                    factor = float(np.linalg.norm(np.asarray(cursor) - middle)) / max(float(first), 1.0)
                    factor = _snapped(factor, snap)
                factor = factor if abs(factor) > 1e-4 else 1e-4
                scale = np.ones(3) if axis is None else 1 - axis
                scale = np.full(3, factor) if axis is None else scale + factor * axis
                return around(np.diag(scale), self.pivot)

    def _offset(
        self, camera: Camera, cursor: Point, pivot: np.ndarray, axis: np.ndarray | None, snap: float
    ) -> np.ndarray:
        drag = np.asarray(cursor) - self.start
        pose, K = camera.world_from_camera, camera.K
        depth = 1.0
        if camera.lens.projection is Projection.PERSPECTIVE:
            depth = max(float((pivot - pose[:3, 3]) @ pose[:3, 2]), 1e-6)
        free = pose[:3, 0] * drag[0] * depth / K[0, 0] + pose[:3, 1] * drag[1] * depth / K[1, 1]
        if axis is None:
            if self.number is not None:
                return np.asarray(pose[:3, 0] * self.number * 1e-3)
            return np.round(free / (snap * 1e-3)) * snap * 1e-3 if snap else free
        if self.number is not None:
            return axis * self.number * 1e-3
        seen = pose[:3, :2].T @ axis  # the axis as it lies in the picture
        along = float((pose[:3, :2].T @ free) @ seen / max(float(seen @ seen), 1e-4))
        return axis * _snapped(along * 1e3, snap) * 1e-3

    @staticmethod
    def _on_screen(camera: Camera, point: np.ndarray) -> np.ndarray:
        return np.nan_to_num(camera.project(point)) + 0.5

    def told(self) -> str:
        """What the status bar says meanwhile."""
        unit = {"move": "mm", "rotate": "°", "scale": "×"}[self.kind]
        axis = f" along {self.axis.upper()}" if self.axis else ""
        typed = f"  {self.typed or '…'} {unit}" if self.typed else ""
        return (
            f"{self.kind.capitalize()}{axis}{typed}   ·   X Y Z: hold to an axis   ·   digits: {unit}   ·   "
            "click or Enter: done   ·   Esc: cancel"
        )


def meant(operation: str, start: np.ndarray, now: np.ndarray) -> np.ndarray:
    """The motion (4, 4) of the world between two poses that a gizmo gives in single precision, without what it was
    not asked for: a move does not turn, a turn does not move or stretch its pivot."""
    pivot = start[:3, 3]
    if operation == "move":
        return shifted(now[:3, 3] - pivot)
    before = start[:3, :3] / np.linalg.norm(start[:3, :3], axis=0)
    if operation == "rotate":
        u, _, vt = np.linalg.svd(now[:3, :3] / np.linalg.norm(now[:3, :3], axis=0) @ before.T)
        return around(u @ vt, pivot)
    factors = np.linalg.norm(now[:3, :3], axis=0) / np.linalg.norm(start[:3, :3], axis=0)
    return around(before @ np.diag(factors) @ np.linalg.inv(before), pivot)


def _snapped(value: float, step: float) -> float:
    return round(value / step) * step if step else value

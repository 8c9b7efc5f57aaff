"""What a scene of the benchmark is: plain records, mm and the numbers of its scene file."""

from dataclasses import dataclass, field

import numpy as np

from benchmarks.blind.solids import Solid

Color = tuple[float, float, float]
Lobe = tuple[Color, Color, float]  # weight, C, n


@dataclass(frozen=True, eq=False)
class Matter:
    """A material. ``model``: "Lambert", "Lafortune" or "UsdPreviewSurface"; ``texture`` (h, w, 3) in place of
    ``diffuse``, row 0 at v = 1; ``roughness`` of the last."""

    name: str
    model: str
    diffuse: Color
    lobes: tuple[Lobe, ...] = ()
    roughness: float = 0.5
    texture: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Part:
    """``poses``: how the part lies, (4, 4) mm, one a pose of the scene."""

    name: str
    solid: Solid
    matter: str
    poses: tuple[np.ndarray, ...] = (np.eye(4),)

    def pose(self, k: int) -> np.ndarray:
        return self.poses[min(k, len(self.poses) - 1)]


@dataclass(frozen=True)
class Lamp:
    """A sphere; ``intensity`` is the scene file's number: its radiant intensity is a quarter of it, W/sr.

    ``beam``: emission over cos θ from ``axis``: 1 + b1 (cos θ - 1) + b2 (P2(cos θ) - 1).
    """

    name: str
    position: tuple[float, float, float]
    radius: float
    intensity: float
    beam: tuple[float, float] = (0.0, 0.0)
    axis: tuple[float, float, float] = (0.0, 0.0, -1.0)


@dataclass(frozen=True)
class Eye:
    """A camera without skew: ``right``, ``up``, ``back`` are the rows of its frame."""

    name: str
    position: tuple[float, float, float]
    rotation: tuple[tuple[float, float, float], ...]
    focal: float  # over the sensor's width


@dataclass(frozen=True)
class Shot:
    """One line of the plan: who looks, how parts lie, which lamps are on, s, how many repeats."""

    eye: int
    pose: int
    lamps: tuple[int, ...]
    exposure: float
    repeats: int = 1


@dataclass(frozen=True)
class Sensor:
    responsivity: float
    full_well: float = 10500.0
    bits: int = 12
    black: float = 64.0
    read_noise: float = 7.0
    prnu: float = 0.004

    @property
    def K(self) -> float:
        """DN/e-"""
        return (2**self.bits - 1 - self.black) / self.full_well


@dataclass(frozen=True, eq=False)
class Bench:
    name: str
    matters: tuple[Matter, ...]
    parts: tuple[Part, ...]
    lamps: tuple[Lamp, ...]
    eyes: tuple[Eye, ...]
    sensor: Sensor
    shots: tuple[Shot, ...]
    size: tuple[int, int] = (240, 180)
    ambient: float = 0.0
    extra: tuple[Lamp, ...] = field(default=())  # lamps that no scene file knows

    def matter(self, name: str) -> Matter:
        return next(m for m in self.matters if m.name == name)


def eye(name: str, position: tuple, target: tuple, focal: float, roll: float = 0.0) -> Eye:
    """Looks from ``position`` at ``target``, z up but for ``roll`` degrees."""
    p = np.asarray(position, float)
    back = p - np.asarray(target, float)
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0] if abs(back[2]) < 0.999 else [0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    c, s = np.cos(np.deg2rad(roll)), np.sin(np.deg2rad(roll))
    right, up = c * right + s * up, c * up - s * right
    return Eye(name, tuple(p), tuple(tuple(map(float, r)) for r in (right, up, back)), focal)

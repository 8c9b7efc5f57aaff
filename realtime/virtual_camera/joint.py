"""What moves in a scene: a joint turns or shifts bodies, a conveyor shifts them at a speed and counts pulses.

A joint's screw moves the bodies from where the file has them: q along its axis, or about it, in the world's frame at
q = 0. Bodies of several joints are moved by all of them, base first: exp(S1 q1) exp(S2 q2) ... world_from_body(0).
Brockett: Robotic manipulators and the product of exponentials formula. 1984.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from interchange.problems import BrightfieldError

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Joint:
    """``bodies``: prim paths; what is below them moves too. ``axis``: world, any length but zero; ``origin``: m, a
    point on it. ``revolute``: q is an angle, rad, else a distance, m. ``low`` and ``high`` bound q."""

    name: str
    bodies: tuple[str, ...]
    axis: Vector
    origin: Vector = (0.0, 0.0, 0.0)
    revolute: bool = True
    low: float = -np.inf
    high: float = np.inf

    def __post_init__(self) -> None:
        if not np.linalg.norm(self.axis) > 0 or not np.isfinite([*self.axis, *self.origin]).all():
            raise BrightfieldError(
                f"A joint's axis must be finite and not zero; got {self.axis}. ({self.name})"
            )

    def displacement(self, q: float) -> np.ndarray:
        """(4, 4): world from where the world was at q = 0."""
        axis = np.asarray(self.axis, np.float64) / np.linalg.norm(self.axis)
        moved = np.eye(4)
        if not self.revolute:
            moved[:3, 3] = q * axis
            return moved
        x, y, z = axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        moved[:3, :3] += np.sin(q) * cross + (1 - np.cos(q)) * cross @ cross  # Rodrigues
        moved[:3, 3] = self.origin - moved[:3, :3] @ self.origin
        return moved

    def checked(self, q: float) -> float:
        """q, within bounds. Raises BrightfieldError."""
        if not self.low <= q <= self.high:  # written so that NaN is outside
            unit = "rad" if self.revolute else "m"
            raise BrightfieldError(
                f"{self.name} must lie in [{self.low:g}, {self.high:g}] {unit}; got {q:g}."
            )
        return float(q)


@dataclass(frozen=True)
class Conveyor:
    """A belt that carries ``bodies`` along ``direction``; ``pulses_per_metre`` of its encoder.

    ``length``: m after which a body comes in at the start again; 0 is an endless way. The belt was at ``start`` m at
    ``since`` s and has run at ``speed`` m/s from then on.
    """

    name: str
    bodies: tuple[str, ...]
    direction: Vector
    speed: float = 0.0
    length: float = 0.0
    pulses_per_metre: float = 1000.0
    start: float = 0.0
    since: float = 0.0

    def position(self, seconds: float) -> float:
        """m that the belt has run."""
        return self.start + self.speed * (seconds - self.since)

    def pulses(self, seconds: float) -> int:
        """What the encoder shows."""
        return int(np.floor(self.position(seconds) * self.pulses_per_metre + 1e-9))

    def displacement(self, seconds: float, more: float = 0.0) -> np.ndarray:
        """(4, 4): world from where the bodies lie at 0 m; ``more`` s later or earlier, without coming in again."""
        run = self.position(seconds)
        run = (run % self.length if self.length > 0 else run) + self.speed * more
        return Joint(self.name, self.bodies, self.direction, revolute=False).displacement(run)

    def at(self, speed: float, seconds: float) -> Self:
        """The same belt at another speed from ``seconds`` on."""
        if not np.isfinite(speed):
            raise BrightfieldError(f"A conveyor's speed must be finite, m/s; got {speed}. ({self.name})")
        return replace(self, speed=float(speed), start=self.position(seconds), since=float(seconds))


def moves(bodies: tuple[str, ...], name: str) -> bool:
    """Whether a body of that name is one of them, or below one."""
    return any(name == b or name.startswith(b.rstrip("/") + "/") for b in bodies)

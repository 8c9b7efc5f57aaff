"""A plan as data: which scene, what varies and how, what must hold, which renderer, what is written."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from analysis.sweep.constraint import Constraint
from analysis.sweep.sampling import Axis, Method
from analysis.sweep.surface import Anchor

RENDERERS = ("realtime", "offline")
SAMPLES = {"realtime": 16, "offline": 64}
WRITES = ("exr", "png", "coco", "bop")


@dataclass(frozen=True)
class Rendering:
    """``samples`` a pixel; ``bounces`` and ``denoise`` matter to path tracing alone."""

    name: str = "realtime"
    samples: int = 16
    bounces: int = 6
    denoise: bool = False


@dataclass(frozen=True)
class PlannedDefect:
    """One defect of a plan. ``number``: among those of its kind; ``on``: the object's path."""

    kind: str
    number: int
    on: str
    anchor: Anchor

    @property
    def name(self) -> str:
        return f"defects.{self.kind}[{self.number}]"

    @property
    def label(self) -> str:
        """What its surface is called among the object's pieces."""
        return f"{self.kind}_{self.number}"


@dataclass(frozen=True)
class Moving:
    """A number that changes with time: linear between its samples, held before and after them."""

    address: str
    times: tuple[float, ...]
    values: tuple[float, ...]

    def at(self, time: float) -> float:
        return float(np.interp(time, self.times, self.values))


@dataclass(frozen=True)
class Plan:
    """``fixed``: what is set to one value; ``units`` of all addresses, for people; ``files``: SHA-256 of every
    file that something may be chosen from."""

    file: Path
    scene: Path
    cameras: tuple[str, ...]  # paths
    times: tuple[float, ...]
    rendering: Rendering
    method: Method
    count: int
    seed: int
    axes: tuple[Axis, ...]
    fixed: Mapping[str, float | str] = field(default_factory=dict)
    moving: tuple[Moving, ...] = ()
    defects: tuple[PlannedDefect, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    objects: tuple[str, ...] = ()  # paths of what has a ground truth
    units: Mapping[str, str] = field(default_factory=dict)
    writes: tuple[str, ...] = WRITES
    width: int = 0  # px, 0 leaves the cameras' own
    noise: bool = True  # of the sensor
    text: str = ""  # the file's own
    notes: tuple[str, ...] = ()  # what is not done although nobody said so
    files: Mapping[str, str] = field(default_factory=dict)

    def values_at(self, row: np.ndarray, time: float) -> dict[str, float | str]:
        """Everything that the plan sets, by address, for a row of the design."""
        sampled = {axis.address: axis.value(float(x)) for axis, x in zip(self.axes, row, strict=True)}
        return {**self.fixed, **sampled, **{m.address: m.at(time) for m in self.moving}}

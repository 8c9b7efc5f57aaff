"""A plan of a search as data: what may be set and how far, what must hold, what is judged, how long is searched."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from analysis.optimise.measures import Measure
from analysis.sweep.constraint import Constraint
from analysis.sweep.plan import PlannedDefect
from analysis.sweep.sampling import Axis

METHODS = ("tpe", "nsga2")


@dataclass(frozen=True)
class Limits:
    """``seen``: least share of the part's surface facing the camera that it must see; ``saturated``: most of the part's
    pixels that may be; ``clearance`` m: least distance of ``clear`` (cameras and lamps, paths) from every body."""

    seen: float = 0.0
    saturated: float = 0.01
    clearance: float = 0.0
    clear: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Plan:
    """``aim``: what is turned towards which object; ``focus``: the object that the lens is focused on, "" for none;
    ``fixed``: numbers set to one value, those of defects among them; ``confirm``: how many are path-traced, of
    ``paths`` samples a pixel."""

    file: Path
    scene: Path
    camera: str
    part: tuple[str, ...]
    axes: tuple[Axis, ...]
    objectives: Mapping[str, Measure]
    fixed: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    defects: tuple[PlannedDefect, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    limits: Limits = Limits()
    aim: Mapping[str, str] = field(default_factory=dict)
    focus: str = ""
    method: str = "tpe"
    trials: int = 100
    seed: int = 0
    width: int = 0  # px of the images that are judged; 0 leaves the camera's own
    samples: int = 8
    confirm: int = 3
    paths: int = 64
    text: str = ""

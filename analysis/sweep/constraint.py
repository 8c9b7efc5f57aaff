"""What every constraint is: the objects that it is about, declared limits, and one question to a moment of a sample."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from analysis.sweep.pieces import pieces_of
from analysis.view.visibility import Visibility, visibility
from interchange.camera import Camera
from interchange.parameter import freeze
from interchange.problems import BrightfieldError
from interchange.scene import Scene

POINTS = 5000  # on a workpiece: the standard deviation of a share is at most 0.007
WIDTH = 160  # px of the depth maps that tell what hides what


class Moment:
    """A sample at one time; what several constraints ask for is found once. ``live`` gives a rasteriser."""

    def __init__(self, scene: Scene, cameras: tuple[Camera, ...], live: Callable[[], Any]) -> None:
        self.scene, self.cameras, self._live = scene, cameras, live
        self._seen: dict[tuple[str, tuple[str, ...]], Visibility | None] = {}

    def visibility(self, camera: Camera, of: tuple[str, ...]) -> Visibility | None:
        """None where nothing of the objects faces the camera."""
        key = (camera.name, of)
        if key not in self._seen:
            small = camera.resized(min(WIDTH, camera.sensor.resolution[0]))
            dark = replace(self.scene, lights=())
            names = list(dict.fromkeys(b.name for b in pieces_of(self.scene, of)))
            try:
                self._seen[key] = visibility(self._live(), dark, small, names, POINTS) if names else None
            except BrightfieldError as error:
                if "faces the camera" not in str(error):
                    raise
                self._seen[key] = None
        return self._seen[key]


@dataclass(frozen=True)
class Constraint:
    """``of``: paths of the objects. ``against``: of those that they must not meet; empty is all others."""

    cost: ClassVar[int]  # cheap ones are asked first
    word: ClassVar[str]  # what a plan calls ``against``; "" where a constraint has none
    of: tuple[str, ...]
    against: tuple[str, ...]

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def told(self) -> str:
        """What it is called when samples are counted."""
        return f"{type(self).__module__.rsplit('.', 1)[-1]} of {', '.join(self.of)}"

    def breaks(self, moment: Moment) -> bool:
        raise NotImplementedError

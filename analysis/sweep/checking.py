"""Which constraint a sample breaks: its scene is built at every time of the plan, and asked."""

from functools import cached_property
from typing import Any

import numpy as np

from analysis.sweep.constraint import Moment
from analysis.sweep.placing import scene_of
from analysis.sweep.plan import Plan
from analysis.sweep.surface import OffSurface
from interchange.formats.document import open_scene
from interchange.scene import Scene


class Checker:
    """Keeps the opened scene and one rasteriser, which only constraints that need depth start."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.document = open_scene(plan.scene)
        self.scenes: dict[float, Scene] = {}

    @cached_property
    def rasterizer(self) -> Any:
        from realtime.renderers.rasterizer import Rasterizer

        return Rasterizer()

    def __call__(self, row: np.ndarray) -> str:
        """What the sample breaks first, "" for nothing."""
        plan = self.plan
        if not plan.constraints and not plan.defects:
            return ""
        for time in plan.times:
            if time not in self.scenes:
                self.scenes[time] = self.document.scene(time)
            try:
                scene, _ = scene_of(self.scenes[time], plan.values_at(row, time), plan.defects)
            except OffSurface as reason:
                return str(reason).split(";")[0].rstrip(".")
            moment = Moment(scene, tuple(scene.camera(c) for c in plan.cameras), lambda: self.rasterizer)
            for constraint in plan.constraints:
                if constraint.breaks(moment):
                    return str(constraint.told)
        return ""

    def close(self) -> None:
        if "rasterizer" in self.__dict__:
            self.rasterizer.release()

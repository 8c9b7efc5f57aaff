"""Enough of the surface that faces a camera lies within its field: 1 - outside >= at_least, for every camera."""

from dataclasses import dataclass

from analysis.sweep.constraint import Constraint, Moment
from interchange.parameter import parameter


@dataclass(frozen=True)
class InView(Constraint):
    cost = 2
    word = ""

    at_least: float = parameter(1.0, "s", "1", 0, 1, "share of the facing surface within the field")

    def breaks(self, moment: Moment) -> bool:
        for camera in moment.cameras:
            found = moment.visibility(camera, self.of)
            if found is None or 1 - found.outside < self.at_least - 1e-9:
                return True
        return False

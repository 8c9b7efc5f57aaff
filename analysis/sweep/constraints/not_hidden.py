"""Little enough of the surface that faces a camera is hidden by other bodies, a housing say: sum hidden <= at_most."""

from dataclasses import dataclass

from analysis.sweep.constraint import Constraint, Moment
from analysis.sweep.pieces import object_of
from interchange.parameter import parameter


@dataclass(frozen=True)
class NotHidden(Constraint):
    cost = 2
    word = "by"

    at_most: float = parameter(0.0, "s", "1", 0, 1, "share of the facing surface that others hide")

    def breaks(self, moment: Moment) -> bool:
        for camera in moment.cameras:
            found = moment.visibility(camera, self.of)
            if found is None:
                return True
            shares = [
                s for name, s in found.hidden.items() if not self.against or object_of(name) in self.against
            ]
            if sum(shares) > self.at_most + 1e-9:
                return True
        return False

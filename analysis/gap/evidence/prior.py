"""How probable causes are before any capture is seen."""

from collections.abc import Mapping, Sequence
from math import factorial

import numpy as np

from analysis.gap.terms.base import Cause

NONE, SINGLE, PAIR, TRIPLE = 0.5, 0.35, 0.12, 0.03  # of a number of causes
MORE = 0.1  # the same of one cause more, over that of one less
EVERY = 0.5  # of an effect's: that all cameras have it, where one alone may


class Prior:
    """Every effect, and every family without a name, is as probable as another, however many lamps, materials or
    cameras it may be of, and these are alike among themselves but for those that are rare."""

    def __init__(self, cameras: Mapping[Cause, str], usual: Mapping[Cause, float] | None = None) -> None:
        """``cameras``: of each cause the camera that it is of, or none; ``usual``: how many times as usual those are
        that are not as usual as others of their effect."""
        weight = {cause: (usual or {}).get(cause, 1.0) for cause in cameras}
        kinds: dict[tuple[str, bool], float] = {}
        for (name, target), camera in cameras.items():
            kind = name, bool(camera)
            kinds[kind] = kinds.get(kind, 0.0) + weight[name, target]
        names = {name for name, _ in kinds}
        self.log_share: dict[Cause, float] = {}
        for (name, target), camera in cameras.items():
            of_one = bool(camera)
            part = (1 - EVERY if of_one else EVERY) if (name, not of_one) in kinds else 1.0
            share = weight[name, target] / kinds[name, of_one]
            self.log_share[name, target] = float(np.log(part * share / len(names)))

    def __call__(self, causes: Sequence[Cause]) -> float:
        """Log of the probability that there are these and no others."""
        n = len(causes)
        mass = (NONE, SINGLE, PAIR, TRIPLE)[min(n, 3)] * MORE ** max(n - 3, 0)
        return float(np.log(mass * factorial(n)) + sum(self.log_share[c] for c in causes))

"""How far parameters may be off, and which of a series' variations a score depends on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from analysis.tune.frames import Frame
from analysis.tune.scores import MEASURES, Rules
from analysis.tune.search import Tuning, aggregate, scores_of
from interchange.parameter import ParameterError


@dataclass(frozen=True, eq=False)
class Slice:
    """One parameter's course through the chosen ones: ``values`` (n,), ``scores`` (n,), and the ``plateau`` (low, high)
    about the chosen value in which the score stays within ``share`` of the chosen one's."""

    parameter: str
    measure: str
    values: np.ndarray
    scores: np.ndarray
    plateau: tuple[float, float]
    share: float


def slices(
    tuning: Tuning, frames: Sequence[Frame], rules: Rules, measure: str, steps: int = 11, share: float = 0.05
) -> list[Slice]:
    """A slice of every parameter that was searched."""
    chosen = tuning.trials[tuning.chosen].parameters
    weights = np.array([f.weight for f in frames])
    best = aggregate(scores_of(tuning.best, frames, rules)[measure], measure, weights)
    found = []
    for name, bound in tuning.bounds.items():
        if bound.high <= bound.low:
            continue
        spaced = np.geomspace if bound.log else np.linspace
        values = np.union1d(spaced(bound.low, bound.high, steps), chosen[name])
        if bound.whole:
            values = np.unique(np.rint(values))
        scores = np.full(len(values), np.nan)
        for i, value in enumerate(values):
            kind = int if bound.whole else float
            try:
                tried = tuning.algorithm(**{**chosen, name: kind(value)})
            except ParameterError:  # rounding just beyond a bound
                continue
            scores[i] = aggregate(scores_of(tried, frames, rules)[measure], measure, weights)
        slack = share * max(abs(best), 1e-12)
        good = scores >= best - slack if MEASURES[measure].best == "high" else scores <= best + slack
        at = int(np.argmin(np.abs(values - chosen[name])))
        low = high = at
        while low > 0 and good[low - 1]:
            low -= 1
        while high < len(values) - 1 and good[high + 1]:
            high += 1
        found.append(Slice(name, measure, values, scores, (float(values[low]), float(values[high])), share))
    return found


def dependence(frames: Sequence[Frame], scores: np.ndarray) -> dict[str, float]:
    """Spearman's rank correlation of a score (n,) with every variation of the frames, strongest first."""
    good = np.isfinite(scores)
    found = {}
    for name in frames[0].variation if frames else ():
        x = np.array([f.variation[name] for f in frames])[good]
        if len(x) > 2 and np.ptp(x) > 0 and np.ptp(scores[good]) > 0:
            found[name] = float(spearmanr(x, scores[good]).statistic)
    return dict(sorted(found.items(), key=lambda item: -abs(item[1])))

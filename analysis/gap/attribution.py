"""What each effect found, and what else the best hypothesis has, takes off the gap on captures held out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.gap.caution import left_over
from analysis.gap.conditions import Condition
from analysis.gap.diagnosis import PRESENT, STAGES
from analysis.gap.fit import SLIGHT, Fit
from analysis.gap.model import Model
from analysis.gap.pixel_map import PixelMaps
from analysis.gap.shapley import Step, shares
from analysis.gap.shrinkage import Gap, Images, Yardstick
from analysis.gap.terms import added

CATALOGUED = {name for names in STAGES.values() for name in names}
KEPT = 0.25  # of what an effect claims on held-out captures: with less, its slope there is under 0.63
SEEN = 16.0  # sigma²: of less noise hides half
UNKNOWN = "outside the catalogue"
PATTERN = "fixed_pattern"

Told = Callable[[str, float], None]
Cause = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Attribution:
    """``players``: effects found by the fit, and what is outside the catalogue; ``chi2`` of every set of them, and of a
    fixed pattern where its map is known, on the held-out captures; ``share``: what each takes off it (Shapley)."""

    players: dict[str, tuple[Cause, ...]]
    chi2: dict[frozenset[str], float]
    share: dict[str, float]

    def lacking(self, name: str) -> float:
        """χ² with all but one of them."""
        return self.chi2[frozenset(self.share) - {name}]


def attribution(
    fitted: Fit,
    held: Sequence[Condition],
    by: Yardstick,
    before: Images,
    after: Images,
    maps: PixelMaps | None,
    told: Told,
) -> Attribution:
    """``after``: with all that was fitted; ``maps``: of the cameras' pixels, where a fixed pattern was found."""
    players: dict[str, tuple[Cause, ...]] = {}
    for cause in called(fitted):
        name = cause[0] if cause[0] in CATALOGUED else UNKNOWN
        players[name] = (*players.get(name, ()), cause)
    chi2: dict[frozenset[str], float] = {}
    sets = Sets(fitted)
    everything = [*players, *([PATTERN] if maps else [])]

    def simulated(names: frozenset[str]) -> Images:
        if not names:
            return before
        if len(names) == len(players):
            return after
        out = [c for n, causes in players.items() if n not in names for c in causes]
        return [sets.simulated(out, c) for c in held]

    def closed(names: frozenset[str]) -> float:
        images = simulated(names - {PATTERN})
        chi2[names] = by.chi2(maps.applied(held, images) if maps and PATTERN in names else images)
        told("shares", len(chi2) / 2 ** len(everything))
        return -chi2[names]

    share = shares(everything, closed)
    return Attribution(players, chi2, share)


def confirmed(fitted: Fit, held: Sequence[Condition], by: Yardstick) -> Fit:
    """Less the causes, with a name or without, that the held-out captures refute; what is left over is told anew then.

    What a cause changes there, δ, would take off Σ δ² / σ² if it were all true, and takes off 2 β - 1 of that, β the
    slope of what captures have beyond the others on δ. Where that is less than ``KEPT``, most of it is not there; one
    that would not be seen there either way is not judged.
    """
    sets = Sets(fitted)
    while True:
        best, after = fitted.best, [fitted.after.simulated(c) for c in held]
        gone = [c for c in sets.causes if c not in best.causes]
        left = {}
        for cause in best.causes:
            if best.causes == (cause,):  # then what the file claims at its best is all that is left
                less = [fitted.before.simulated(c) for c in held]
            else:
                less = [sets.simulated([*gone, cause], c) for c in held]
            left[cause] = taken_off(by, less, after)
        worst = min(left, key=lambda c: left[c], default=None)
        if worst is None or left[worst] >= KEPT:
            return fitted
        kept = [k for k, c in enumerate(best.causes) if c != worst]
        fewer = replace(
            best,
            causes=tuple(best.causes[k] for k in kept),
            slabs=tuple(best.slabs[k] for k in kept),
        )
        fitted = replace(
            fitted,
            after=without(fitted, [worst]) if fewer.causes else fitted.before,
            hypotheses=(fewer, *fitted.hypotheses),
            probability={**fitted.probability, worst: 0.0},
            refuted=(*fitted.refuted, worst),
            left_over=left_over(fitted.weighed, fewer),
        )


def called(fitted: Fit) -> list[Cause]:
    """The causes that are probable."""
    return [c for c in fitted.best.causes if fitted.probability.get(c, 0.0) >= PRESENT]


def only_called(fitted: Fit) -> Fit:
    """With what is too improbable to be called at what calibration leaves of it, and all else as it is then: it closes
    nothing."""
    best, kept = fitted.best, called(fitted)
    if len(kept) == len(best.causes):
        return fitted
    if not kept:
        return replace(fitted, after=fitted.before)
    fewer = replace(best, causes=tuple(kept), slabs=tuple(best.slabs[best.causes.index(c)] for c in kept))
    out = np.array([t.candidate in best.causes and t.candidate not in kept for t in fitted.terms], bool)
    at = np.where(out, fitted.before.at, fitted.after.at)
    theta = fitted.evidence.theta(fewer)
    slight = np.abs(theta - at) * fitted.evidence.share < SLIGHT
    of_kept = np.array([t.candidate in kept for t in fitted.terms], bool)
    return replace(fitted, after=replace(fitted.after, theta=np.where(slight & ~of_kept, at, theta), at=at))


def taken_off(by: Yardstick, before: Images, after: Images) -> float:
    """What ``after`` takes off the mean χ² of ``before``, over what it would if all of it were true; 1 where that
    would not be seen (less than twice its standard error by blocks)."""
    sums = by.blocks(before, after, [2 * a - b for a, b in zip(after, before, strict=True)])
    off = sums[:, 2] - sums[:, 4]
    # of e² at 0, 1 and 2 times what changes the second difference is twice its square
    wanted = 0.5 * (sums[:, 2] - 2 * sums[:, 4] + sums[:, 6])
    error = float(np.std(off) * np.sqrt(len(off)))
    if wanted.sum() < max(2 * error, SEEN):
        return 1.0
    return float(off.sum() / wanted.sum())


class Sets:
    """Simulations with some of the causes of a fit. What calibration's errors add is told once, where all causes are:
    how it changes with them is a product of two small numbers."""

    def __init__(self, fitted: Fit) -> None:
        self.fitted, self.causes = fitted, fitted.best.causes
        self._own = np.array([i for i, t in enumerate(fitted.terms) if t.candidate in self.causes], int)
        self._rest: dict[int, tuple[Condition, np.ndarray]] = {}

    def simulated(self, out: Sequence[Cause], condition: Condition) -> np.ndarray:
        """(H, W, C) DN without the causes ``out``."""
        if id(condition) not in self._rest:
            after = self.fitted.after
            self._rest[id(condition)] = condition, after.simulated(condition) - self._alone(after, condition)
        return self._alone(without(self.fitted, out), condition) + self._rest[id(condition)][1]

    def _alone(self, model: Model, condition: Condition) -> np.ndarray:
        state = model.state(condition)
        own = [self.fitted.terms[i] for i in self._own]
        return state.simulation.dn + added(state, own, (model.theta - model.at)[self._own])


def without(fitted: Fit, causes: Sequence[Cause]) -> Model:
    """The best model with some of its causes taken out; the others stay as they were fitted."""
    out = np.array([t.candidate in causes for t in fitted.terms], bool)
    before, after = fitted.before, fitted.after
    return replace(
        after, theta=np.where(out, before.theta, after.theta), at=np.where(out, before.at, after.at)
    )


def waterfall(g: Gap, attribution: Attribution) -> tuple[Step, ...]:
    """From the scene file as written to noise; the steps add up to its mean χ²."""
    effects = [
        Step(n, "effect" if n in CATALOGUED else "unknown", s)
        for n, s in sorted(attribution.share.items(), key=lambda x: -x[1])
    ]
    return (
        Step("calibration within tolerances", "calibration", g.as_written**2 - g.before**2),
        *effects,
        Step("not explained", "rest", g.after**2 - g.noise_floor**2),
        Step("sensor noise", "noise", g.noise_floor**2),
    )

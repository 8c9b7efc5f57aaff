"""What each effect found, and what else the best hypothesis has, takes off the gap on captures held out.

A set of causes is fitted again, with what calibration may be off by: what was fitted beside a cause may undo what that
does, and goes with it (Lindeman, Merenda, Gold: Introduction to bivariate and multivariate analysis, 1980).
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.finding import LIKELIEST, PRESENT, STAGES
from analysis.gap.measures.shapley import Step, shares
from analysis.gap.measures.shrinkage import Gap, Images, Yardstick
from analysis.gap.noise.pixel_map import PixelMaps
from analysis.gap.search.fit import Fit
from analysis.gap.search.model import Model
from analysis.gap.search.numbers import possible

CATALOGUED = {name for names in STAGES.values() for name in names}
UNKNOWN = "outside the catalogue"
PATTERN = "fixed_pattern"

Told = Callable[[str, float], None]
Cause = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Attribution:
    """``players``: effects found by the fit, and what is outside the catalogue; ``chi2`` of every set of them, and of a
    fixed pattern where its map is known, on the held-out captures; ``share``: what each takes off it (Shapley).

    No cause at all is ``before``, the file at its best within what it declares: a fit without any would take up what
    the causes do with errors of calibration that nobody would believe.
    """

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
    images_of: dict[frozenset[str], Images] = {frozenset(): before, frozenset(players): after}
    everything = [*players, *([PATTERN] if maps else [])]

    def simulated(names: frozenset[str]) -> Images:
        if names not in images_of:
            out = [c for n, causes in players.items() if n not in names for c in causes]
            images_of[names] = refitted(fitted, out).simulations(held)
        return images_of[names]

    def closed(names: frozenset[str]) -> float:
        images = simulated(names - {PATTERN})
        chi2[names] = by.chi2(maps.applied(held, images) if maps and PATTERN in names else images)
        told("shares", len(chi2) / 2 ** len(everything))
        return -chi2[names]

    share = shares(everything, closed)
    return Attribution(players, chi2, share)


def claimed(
    fitted: Fit, held: Sequence[Condition], by: Yardstick, taken: Attribution, carried: Collection[str]
) -> float:
    """χ of what a corrected scene that carries some of the effects shows, all else being as it was fitted."""
    out = [c for n, causes in taken.players.items() if n not in carried for c in causes]
    return by.chi2(lacking(fitted, out).simulations(held)) ** 0.5


def called(fitted: Fit) -> list[Cause]:
    """The causes that are probable, and the likeliest of several that captures do not tell apart where it is probable
    that there is one of them."""
    return [c for c in fitted.best.causes if _is_called(fitted, c)]


def _is_called(fitted: Fit, cause: Cause) -> bool:
    p = fitted.probability.get(cause, 0.0)
    if p >= PRESENT or any(name not in CATALOGUED for name, _ in fitted.best.causes):
        return p >= PRESENT  # beside what has no name, what looks alike is not all that may be there
    one_of_them = p * fitted.in_place.get(cause, 1.0)
    if cause in fitted.cautions:  # no surer than conditions agree, whatever it is
        one_of_them = min(one_of_them, fitted.cautions[cause].most)
    return p >= LIKELIEST and one_of_them >= PRESENT


def without(fitted: Fit, causes: Sequence[Cause]) -> Model:
    """The best model with some of its causes taken out; the others stay as they were fitted."""
    out = np.array([t.candidate in causes for t in fitted.terms], bool)
    before, after = fitted.before, fitted.after
    return replace(
        after, theta=np.where(out, before.theta, after.theta), at=np.where(out, before.at, after.at)
    )


def errors_alone(fitted: Fit) -> Model:
    """The best model without what is called: calibration's errors, and what those leave of causes that are not."""
    return without(fitted, called(fitted))


def lacking(fitted: Fit, causes: Sequence[Cause]) -> Model:
    """The same, told beside the best model."""
    return replace(without(fitted, causes), beside=fitted.after)


def refitted(fitted: Fit, causes: Sequence[Cause]) -> Model:
    """The best model without some of its causes, all else being fitted to that: what the evidence has of every number
    without them more than with them, told where the fit stands."""
    kept = [c for c in called(fitted) if c not in causes]
    fewer, best = (possible(fitted.weighed, fitted.best.of(s)) for s in (kept, called(fitted)))
    less = without(fitted, causes)
    still = np.array([t.candidate in causes for t in fitted.terms], bool)
    return replace(less, theta=less.theta + np.where(still, 0.0, (fewer - best)[: len(still)]))


def waterfall(g: Gap, attribution: Attribution, known: Mapping[str, float]) -> tuple[Step, ...]:
    """From the scene file as written to noise; the steps add up to its mean χ². ``known``: what effects take off that
    were known before anything was fitted."""
    off = {n: known.get(n, 0.0) + attribution.share.get(n, 0.0) for n in (*known, *attribution.share)}
    effects = [
        Step(n, "effect" if n in CATALOGUED else "unknown", s)
        for n, s in sorted(off.items(), key=lambda x: -x[1])
    ]
    return (
        Step("calibration within tolerances", "calibration", g.as_written**2 - g.before**2),
        *effects,
        Step("not explained", "rest", g.after**2 - g.noise_floor**2),
        Step("sensor noise", "noise", g.noise_floor**2),
    )

"""Why a cause may be less probable than log Z makes it, and what is left without a cause.

**Tolerances have tails.** A number of the calibration may be κ times as far off as is declared: κ² has the inverse
gamma distribution with which errors follow Student's t with ``TAILS`` degrees of freedom. An effect is held against
that, all else staying as it is; not where no tolerance speaks of it.

**What is there is there in every condition.** Pixels share errors that log Z takes for independent ones; conditions
share fewer. How much there is of an effect, θ, is told without one condition after the other: with β the part of it
that the others show and s the jackknife's standard deviation of β, n conditions have amounts whose squares add up to
n about zero (in units of their mean) and n (n - 1) s² about that. Where the effect is there they are normal around one
amount, and differ by ``ALIKE`` of it, more or less, and by chance; where errors that pixels share look like it, around
none, and differ by about as much as was found, and by chance. No effect is surer than the ratio of the two makes it
(both widths unknown, with inverse gamma distributions), such errors being e^``LIKELY`` times as likely as an effect
beforehand; that there is anything at all, an effect or something without a name, is no surer than the ratio, unless
more is left without it than was to be expected. Chance is noise and tolerances: by them θ without a condition is off
from θ by the difference of both variances.

**What is left is told.** Noise, the renderer and edges are known to ``KNOWN``: a residual that is larger has a cause,
whatever it is. Log Z compares hypotheses with each other and does not see it.

Bailey: Not normal: the uncertainties of scientific measurements. Royal Society Open Science 2017 (their tails).
Efron: The jackknife, the bootstrap and other resampling plans. SIAM 1982.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import expit, gammaln

from analysis.gap.evidence.likelihood import TAU, Evidence, Hypothesis
from analysis.gap.terms.base import LOBES, Cause
from analysis.gap.terms.normal_equations import NormalEquations, total_of

TAILS = 16.0  # degrees of freedom
FARTHEST, RUNGS = 6.0, 8  # of κ: what is further off is an effect
# how far conditions' amounts differ where an effect is there, beyond chance, over the amount, and its degrees of
# freedom: of a dozen true ones of opened blind cases less than 0.04 but for three, 0.1, 0.6 and 1.1; of errors that
# look like one, over what was found
ALIKE, ALIKE_BY = 0.07, 4.0
# the same of other lobes, of which a formula says how much each lamp shows: C of one axis alone for both of a metal
# block differs by so much and more, one standard deviation over lamps (tests/analysis/gap/test_gap_agreement.py)
LOBES_ALIKE = 0.8
FOUND, FOUND_BY = 1.0, 2.0
LIKELY = 2.0
SHOWS = 1e-3  # of the condition that shows a cause best: one that shows it less does not
FEWEST = 3  # conditions that may be left out in turn
KNOWN = 0.04  # of what is to be left, one standard deviation
MORE = 0.2  # of it, that a cause without a name leaves: one standard deviation
OUTSIDE = 0.1  # prior probability of such a cause
SHAPE = 0.1  # of what causes change in χ², that their formulas may leave


@dataclass(frozen=True)
class Caution:
    """Of a cause: the probability that it is an error of the calibration, larger than declared, and no effect; and
    ``spread``, one standard deviation of how much of it there is, relative, as conditions differ (nan where they do
    not tell), ``chance``, the same by noise and tolerances alone, with what probability that leaves it at ``most``, and
    with what it leaves that it is ``something``."""

    tail: float
    spread: float
    most: float
    something: float = 1.0
    chance: float = 0.0

    def of(self, probability: float) -> float:
        return min(probability * (1 - self.tail), self.most)


def cautions(
    evidence: Evidence,
    declared: np.ndarray,
    h: Hypothesis,
    plain: Evidence,
    parts: Sequence[NormalEquations],
    left_out: "LeftOut",
) -> dict[Cause, Caution]:
    """Of the causes of ``h``. ``evidence``: that of its stand, ``declared`` (q,): spikes as declared. ``plain``: the
    same without the doubt of forms, of ``parts``, one a condition, which are ``left_out`` in turn."""
    out = {}
    for c in h.causes:
        s, by_chance, n = spread(plain, h, c, parts, left_out)
        alike = LOBES_ALIKE if c[0] in LOBES else ALIKE
        ratio = agreement(s, n, by_chance, alike) if np.isfinite(s) else np.inf
        most, something = float(expit(ratio - LIKELY)), float(expit(ratio))
        out[c] = Caution(tail(evidence, declared, h, c), s, most, something, by_chance)
    return out


def agreement(s: float, n: int, by_chance: float = 0.0, alike: float = ALIKE) -> float:
    """Log of how much likelier n conditions' amounts, whose mean has the relative standard deviation s, are where the
    effect is there than where errors look like it; ``by_chance``: s as noise and tolerances alone would have it."""
    squares, more = n * (n - 1) * s**2, n * by_chance**2

    def log_density(about: float, free: int, scale: float, by: float) -> float:
        prior = by * (scale**2 + more)
        known = gammaln((by + free) / 2) - gammaln(by / 2) + 0.5 * by * np.log(prior)
        return float(known - 0.5 * (by + free) * np.log(prior + about) - 0.5 * free * np.log(np.pi))

    there = log_density(squares, n - 1, alike, ALIKE_BY) - 0.5 * np.log(n)
    return float(there - log_density(squares + n, n, FOUND, FOUND_BY))


def _without(h: Hypothesis, cause: Cause) -> tuple[tuple[Cause, ...], tuple[float, ...]]:
    kept = [k for k, c in enumerate(h.causes) if c != cause]
    return tuple(h.causes[k] for k in kept), tuple(h.slabs[k] for k in kept)


def log_prior_of_kappa() -> tuple[np.ndarray, np.ndarray]:
    """κ (n,), evenly over its logarithm above 1, and the logarithm of each one's share of the probability."""
    step = np.log(FARTHEST) / RUNGS
    log_k = step * np.arange(1, RUNGS + 1)
    half = TAILS / 2
    density = half * np.log(half) - gammaln(half) - TAILS * log_k - half * np.exp(-2 * log_k) + np.log(2)
    return np.exp(log_k), density + np.log(step)


def wider(evidence: Evidence, declared: np.ndarray, cause: Cause) -> list[tuple[np.ndarray, float]]:
    """How many times wider than its spike each term of a cause may be because tolerances have tails, and the logarithm
    of the probability; not where it is taken to be so wide already. What has no tolerance of its own (a relative spike,
    analysis.gap.terms.left) has no tails, nor what has no name: what is larger than that is an effect."""
    index = evidence.members[cause]
    if not _calibrated(evidence, cause):
        return []
    ratios = [
        (kappa * declared[index] / evidence.spike[index], float(share))
        for kappa, share in zip(*log_prior_of_kappa(), strict=True)
    ]
    return [(ratio, share) for ratio, share in ratios if (ratio > 1).all()]


def _calibrated(evidence: Evidence, cause: Cause) -> bool:
    """Whether its numbers have tolerances, or a share of one."""
    return not any(evidence.terms[i].generic or evidence.terms[i].relative for i in evidence.members[cause])


def tail(evidence: Evidence, declared: np.ndarray, h: Hypothesis, cause: Cause) -> float:
    """Probability that a cause of ``h`` is an error of the calibration, larger than was declared, where it is off at
    all: that it is not is a hypothesis of its own."""
    if not _calibrated(evidence, cause):
        return 0.0
    rest, slabs = _without(h, cause)
    none, scores = evidence.at(rest, slabs), []
    for ratio, share in wider(evidence, declared, cause):
        log_Z = evidence.log_Z(h.causes, h.slabs, {cause: ratio}) - evidence.chosen(rest)
        log_Z += evidence.averaged(rest)
        scores.append(none.log_prior + log_Z / TAU + share)
    if not scores:
        return 0.0
    return float(expit(np.logaddexp.reduce(scores) - evidence.at(h.causes, h.slabs).score))


@dataclass(frozen=True, eq=False)
class LeftOut:
    """A hypothesis without one condition after the other: ``theta`` (n, q), no row where fewer than ``FEWEST`` tell;
    ``rests``, the evidence of each, of the terms ``kept`` alone, as ``whole`` is that of all conditions."""

    theta: np.ndarray
    rests: tuple[Evidence, ...] = ()
    whole: Evidence | None = None
    kept: np.ndarray | None = None

    def chance(self, h: Hypothesis, direction: np.ndarray) -> float:
        """Variance of ``direction``' θ, (q,), as the jackknife tells it where the model holds: less data have a mean
        that is off by the difference of both variances."""
        if self.whole is None or self.kept is None:
            return 0.0
        x = direction[self.kept]
        all_of_it = self.whole.variance(h, x)
        more = sum(max(rest.variance(h, x) - all_of_it, 0.0) for rest in self.rests)
        return more * (len(self.rests) - 1) / len(self.rests)


def without_each(evidence: Evidence, h: Hypothesis, parts: Sequence[NormalEquations]) -> LeftOut:
    """Families of terms that ``h`` does not have stay at nothing."""
    wide = {i for c in h.causes for i in evidence.members[c]}
    kept = np.array([i for i, t in enumerate(evidence.terms) if t.family is None or i in wide])
    terms, spikes = [evidence.terms[i] for i in kept], evidence.spike[kept]
    own = [p.of(kept) for p in parts]
    whole = Evidence(total_of(own), terms, spikes=spikes)
    found, rests = [], []
    for k in range(len(own)) if len(own) >= FEWEST else ():
        others = total_of([p for i, p in enumerate(own) if i != k])
        rest = whole.on(others)
        if all((others.share[whole.members[c]] > 0).any() for c in h.causes):
            theta = np.zeros(len(evidence.terms))
            theta[kept] = rest.theta(h)
            found.append(theta)
            rests.append(rest)
    if len(found) < FEWEST:
        return LeftOut(np.zeros((0, len(evidence.terms))))
    return LeftOut(np.array(found), tuple(rests), whole, kept)


def spread(
    plain: Evidence, h: Hypothesis, cause: Cause, parts: Sequence[NormalEquations], left_out: LeftOut
) -> tuple[float, float, int]:
    """One standard deviation of how much of a cause there is, relative, the same by chance, and the conditions that
    show it; nan where they do not tell: of what has a number for each place, and what one condition alone shows."""
    index = plain.members[cause]
    theta = plain.theta(h)[index]

    def energy(e: NormalEquations) -> float:
        return float(theta @ e.G[np.ix_(index, index)] @ theta)

    shown = np.array([energy(p) for p in parts])
    n = int((shown > SHOWS * shown.max()).sum())
    if plain.terms[index[0]].family is not None or n < 2 or not len(left_out.theta):
        return np.nan, 0.0, n
    along = np.zeros(len(plain.terms))
    along[index] = plain.e.G[np.ix_(index, index)] @ theta / energy(plain.e)
    beta = left_out.theta @ along
    s = float(np.sqrt(beta.var() * (len(beta) - 1)))
    return s, float(np.sqrt(left_out.chance(h, along))), n


def left_over(evidence: Evidence, h: Hypothesis) -> tuple[float, float]:
    """What ``h`` leaves beyond what was to be expected, over that, and the probability that it has a cause without a
    name. What formulas of strong causes leave is none."""
    more = evidence.left(h) - 1
    return more, 0.0 if more <= SHAPE * _changed(evidence, h) else _has_a_cause(more)


def uncalled(evidence: Evidence, h: Hypothesis) -> float:
    """The probability that what is left has a cause where none of those of ``h`` is called: what they change is left
    then, too."""
    return _has_a_cause(evidence.left(h) - 1 + _changed(evidence, h))


def _changed(evidence: Evidence, h: Hypothesis) -> float:
    """What the causes of ``h`` change, each by itself, over what was to be left."""
    theta, own = evidence.theta(h), [evidence.members[c] for c in h.causes]
    energy = sum(float(theta[i] @ evidence.e.G[np.ix_(i, i)] @ theta[i]) for i in own)
    return energy / max(evidence.e.count, 1e-30)


def _has_a_cause(more: float) -> float:
    if more <= 0:
        return 0.0
    odds = OUTSIDE / (1 - OUTSIDE) * 2 * KNOWN / MORE
    return float(expit(np.log(odds) + 0.5 * (more / KNOWN) ** 2 - 0.5 * (more / MORE) ** 2))

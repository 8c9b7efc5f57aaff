"""How large calibration's errors are, over what captures.json declares of them.

A tolerance is one standard deviation, and nobody knows it exactly. Where many numbers have the same one, the captures
tell it: a factor κ for each, that of the largest max log Z over the hypotheses in question, with ln κ normally
distributed a priori and a further cost for every tolerance that is not as declared. One number that is four
tolerances off is an effect; a dozen of them are a tolerance that is too small.

MacKay: Bayesian interpolation. Neural Computation 1992 (the evidence of hyperparameters).
"""

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from itertools import product

import numpy as np

from analysis.gap.evidence import Evidence, Hypothesis
from analysis.gap.generic_terms import FACTOR
from analysis.gap.terms import Term
from interchange.captures import Tolerances

FACTORS = (0.4, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.5)
DECLARED = FACTORS.index(1.0)
SPREAD = 0.3  # of ln κ: tolerances are known to a third
CHANGED = 3.0  # nats that a tolerance other than the declared one costs
LEAST = 6  # numbers that share a tolerance and tell how large it is
LEAD = 12  # hypotheses that are looked at
EXPLAINED = 1.1  # residual over what is expected, up to which errors of calibration may be judged at all

LEFT = "effects that no tolerance speaks of"  # is never less than it was found to be

Shares = dict[str, np.ndarray]


def shares(of: Callable[[Tolerances], Sequence[Term]], tolerances: Tolerances) -> Shares:
    """{tolerance: (q,)}: the part of each term's spike that goes with it, ``LEFT`` apart from the flat field that it is
    told by (analysis.gap.left). ``of``: the terms under given tolerances."""
    declared = np.array([t.spike for t in of(tolerances)])
    out = {}
    for f in fields(tolerances):
        value = getattr(tolerances, f.name)
        twice = np.array([t.spike for t in of(replace(tolerances, **{f.name: 2 * value}))])
        out[f.name] = np.where(declared > 0, twice / np.maximum(declared, 1e-300) - 1, 0.0)
    is_field = np.array([t.cause == FACTOR for t in of(tolerances)])
    out[LEFT] = np.where(is_field, 0.0, out["flat_field"])
    out["flat_field"] = np.where(is_field, out["flat_field"], 0.0)
    return out


def widths(shares: Shares, factors: dict[str, float], q: int) -> np.ndarray:
    """(q,): how many times as wide each term's spike is; those beyond ``shares`` (forms) stay as they are."""
    out = np.ones(q)
    for name, factor in factors.items():
        part = shares[name]
        out[: len(part)] *= 1 + (factor - 1) * part
    return out


def explained(evidence: Evidence, h: Hypothesis) -> bool:
    """Whether what a hypothesis leaves is what was to be expected."""
    e, theta = evidence.e, evidence.theta(h)
    left = e.rr - 2 * theta @ e.b + theta @ e.G @ theta
    return bool(left < EXPLAINED * e.count)


def factors(
    evidence: Evidence, declared: np.ndarray, shares: Shares, hypotheses: Sequence[Hypothesis]
) -> dict[str, float]:
    """{tolerance: κ}, of those that are not as declared; none where the best of ``hypotheses``, best first, explains
    the captures badly: errors of another kind would pass for calibration's.

    ``declared`` (q,): spikes as declared. Up and down a ladder of factors, one tolerance after the other, as long as
    that helps; what gains less than its cost is left as declared.
    """
    if not explained(evidence, hypotheses[0]):
        return {}
    lead = [*hypotheses[:LEAD], evidence.at((), ())]
    wanted = {i for h in lead for c in h.causes for i in evidence.members[c]}
    kept = np.array([i for i, t in enumerate(evidence.terms) if t.family is None or i in wanted])
    e, terms = evidence.e.of(kept), [evidence.terms[i] for i in kept]
    own = {name: np.resize(np.append(part, np.zeros(len(evidence.terms))), len(evidence.terms))[kept]
           for name, part in shares.items()}  # fmt: skip
    judged = [name for name, part in own.items() if (part * (evidence.share[kept] > 0) > 0.5).sum() >= LEAST]
    place = dict.fromkeys(judged, DECLARED)

    def score(at: dict[str, int]) -> float:
        spikes = declared[kept] * widths(own, {n: FACTORS[k] for n, k in at.items()}, len(kept))
        there = Evidence(e, terms, evidence.in_force, spikes)
        prior = sum(-0.5 * (np.log(FACTORS[k]) / SPREAD) ** 2 for k in at.values())
        return max(there.at(h.causes, h.slabs).score for h in lead) + float(prior)

    best, moved = score(place), True
    while moved:
        moved = False
        for name, way in product(judged, (1, -1)):
            least = DECLARED if name == LEFT else 0
            while (
                least <= (k := place[name] + way) < len(FACTORS)
                and (found := score(place | {name: k})) > best
            ):
                best, place, moved = found, place | {name: k}, True
    for name in judged:
        if place[name] != DECLARED and best - score(as_declared := place | {name: DECLARED}) < CHANGED:
            best, place = score(as_declared), as_declared
    return {name: FACTORS[k] for name, k in place.items() if k != DECLARED}

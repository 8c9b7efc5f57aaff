"""From which severity on the captures would show each effect: what "none" means.

For an effect θ alone, without any other error, of rms s over the signal, s² = θ' G θ / S, the evidence for it over none
is a quadratic form of θ:

    Δ log Z(θ) = θ' Q θ - cost,      shown where  Δ log Z + log prior odds >= log(p / (1 - p)),  p = SURE

with cost what its freedom is charged (Occam's factor). Its numbers may be off in ways that tolerances hide, and in ways
that they do not: the eigenvalues λ of Q in the metric G / S are gains per s², the largest the easiest way's; a way
drawn by lot has Σ u² λ, u on the unit sphere, and what is told is what nine of ten have.

MacKay: Bayesian interpolation. Neural Computation 1992.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from analysis.gap.evidence import Cause, Evidence

SURE = 0.9
MOST = 0.5  # rms over the signal: what would not show there is told as never
DRAWN = 400  # ways by lot
FLAT = 1e-9  # of the largest: ways that change no image


@dataclass(frozen=True)
class Detectable:
    """``easiest``: rms over the signal from which on an effect would be found if it is about what shows it best,
    ``cause``, and off in the way that shows best; ``hardest``: from which on it would be found whatever it is about, in
    nine of ten ways drawn by lot. inf: never."""

    cause: Cause
    easiest: float
    hardest: float


def detectable(evidence: Evidence) -> tuple[Detectable, ...]:
    """Every effect with a name, the easiest first."""
    found: dict[str, list[Detectable]] = {}
    for cause, index in evidence.members.items():
        if not evidence.terms[index[0]].generic:
            found.setdefault(cause[0], []).append(Detectable(cause, *_severities(evidence, cause, index)))
    told = [_together(targets) for targets in found.values()]
    return tuple(sorted(told, key=lambda d: d.easiest))


def _together(targets: Sequence[Detectable]) -> Detectable:
    best = min(targets, key=lambda d: d.easiest)
    return Detectable(best.cause, best.easiest, max(d.hardest for d in targets))


def _severities(evidence: Evidence, cause: Cause, index: np.ndarray) -> tuple[float, float]:
    """In the best way, and in nine of ten drawn by lot."""
    e = evidence.e
    metric = e.G[np.ix_(index, index)] / max(e.signal, 1e-30)
    seen, ways = eigh(metric)
    there = seen > FLAT * seen.max()
    to_unit = ways[:, there] / np.sqrt(seen[there])
    easiest = by_lot = np.inf
    for slab in evidence.slabs[cause]:
        Q, cost = evidence.alone(cause, slab)
        gains = np.linalg.eigvalsh(to_unit.T @ Q @ to_unit)
        needed = max(cost + float(np.log(SURE / (1 - SURE))), 0.0)
        easiest = min(easiest, _root(needed, float(gains.max())))
        by_lot = min(by_lot, _root(needed, _seldom_less(gains)))
    return easiest, by_lot


def _seldom_less(gains: np.ndarray) -> float:
    """The gain that ``SURE`` of all ways have or exceed."""
    if len(gains) == 1:
        return float(gains[0])
    u2 = np.random.default_rng(0).standard_normal((DRAWN, len(gains))) ** 2
    return float(np.quantile(u2 @ gains / u2.sum(axis=1), 1 - SURE))


def _root(needed: float, gain: float) -> float:
    found = float(np.sqrt(needed / gain)) if gain > 0 else np.inf
    return found if found <= MOST else np.inf

"""From which severity on the captures would show each effect: what "none" means.

For an effect θ alone, without any other error, of severity s, s² = θ' M θ (analysis.gap.terms.severity), the evidence
for it over none is a quadratic form of θ:

    Δ log Z(θ) = θ' Q θ - cost,      shown where  Δ log Z + log prior odds - log T >= log(p / (1 - p)),  p = SURE

with cost what its freedom is charged (Occam's factor), and T = 1 + Σ_κ p(κ) Z_κ / Z what a tolerance that is κ times as
large explains of it (analysis.gap.evidence.caution). Its numbers may be off in ways that tolerances hide, and in ways
that they do not: the eigenvectors of Q in the metric M have the easiest way among them; ways drawn by lot lie evenly
on the sphere, and what is told is what nine of ten have.

MacKay: Bayesian interpolation. Neural Computation 1992.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from analysis.gap.evidence.caution import wider
from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.parallel import each
from analysis.gap.terms.base import Cause

SURE = 0.9
ODDS = np.log(SURE / (1 - SURE))  # the same as log odds
MOST = 0.5  # severity: what would not show there is told as never
LEAST, RUNGS, HALVES = (
    1e-5,
    120,
    12,
)  # severities that are looked at, and how often what lies between is halved
DRAWN = 400  # ways by lot
FLAT = 1e-9  # of the largest: ways that change no image


@dataclass(frozen=True)
class Detectable:
    """``easiest``: severity from which on an effect would be found if it is about what shows it best,
    ``cause``, and off in the way that shows best; ``hardest``: from which on it would be found whatever it is about, in
    nine of ten ways drawn by lot. inf: never."""

    cause: Cause
    easiest: float
    hardest: float


def detectable(
    evidence: Evidence, declared: np.ndarray, strength: Mapping[Cause, np.ndarray]
) -> tuple[Detectable, ...]:
    """Every effect with a name, the easiest first. ``declared`` (q,): spikes as declared. ``strength``: M of causes."""
    named = [c for c, index in evidence.members.items() if not evidence.terms[index[0]].generic]
    found: dict[str, list[Detectable]] = {}
    for d in each(lambda c: Detectable(c, *_severities(evidence, declared, c, strength[c])), named):
        found.setdefault(d.cause[0], []).append(d)
    told = [_together(targets) for targets in found.values()]
    return tuple(sorted(told, key=lambda d: d.easiest))


def _together(targets: Sequence[Detectable]) -> Detectable:
    best = min(targets, key=lambda d: d.easiest)
    return Detectable(best.cause, best.easiest, max(d.hardest for d in targets))


def _severities(
    evidence: Evidence, declared: np.ndarray, cause: Cause, metric: np.ndarray
) -> tuple[float, float]:
    """In the best way, and in nine of ten drawn by lot."""
    seen, ways = eigh(metric)
    there = seen > FLAT * seen.max()
    to_unit = ways[:, there] / np.sqrt(
        seen[there]
    )  # (k, m): numbers of an effect of severity 1, one way each

    def gains(slab: float, given: dict[Cause, np.ndarray]) -> tuple[np.ndarray, float]:
        Q, cost = evidence.alone(cause, slab, given)
        return to_unit.T @ Q @ to_unit, cost

    odds = evidence.prior((cause,)) - evidence.prior(()) - evidence.chosen((cause,))
    slabs = evidence.slabs[cause]
    effect = [(Q, cost - odds) for Q, cost in (gains(slab, {}) for slab in slabs)]
    larger = []
    for ratio, share in wider(evidence, declared, cause):
        Q, cost = gains(slabs[0], {cause: ratio})
        larger.append((Q, cost - share))
    best = [np.linalg.eigh(Q)[1][:, -1] for Q, _ in effect]
    lot = np.random.default_rng(0).standard_normal((DRAWN, len(best[0])))
    lot /= np.linalg.norm(lot, axis=1)[:, None]
    if len(best[0]) == 1:
        lot = lot[:1]
    found = _least(np.vstack([best, lot]), effect, larger)
    by_lot = float(np.sort(found[len(best) :])[int(np.ceil(SURE * len(lot))) - 1])
    return float(found[: len(best)].min()), by_lot


def _least(
    ways: np.ndarray, effect: Sequence[tuple[np.ndarray, float]], larger: Sequence[tuple[np.ndarray, float]]
) -> np.ndarray:
    """(n,): severities from which on an effect would be found, off in ``ways`` (n, m) of length 1; inf beyond ``MOST``.
    ``effect``, ``larger``: quadratic forms (m, m) and what they cost, of the effect and of larger tolerances."""

    def of(forms: Sequence[tuple[np.ndarray, float]]) -> tuple[np.ndarray, np.ndarray]:
        gains = [np.einsum("ij,jk,ik->i", ways, Q, ways) for Q, _ in forms]
        return np.array(gains).reshape(-1, len(ways)), np.array([cost for _, cost in forms])

    (gain, cost), (hidden, spent) = of(effect), of(larger)

    def shown(s: np.ndarray) -> np.ndarray:
        """(n,) bool at severities (n,)."""
        for_it = gain * s**2 - cost[:, None]
        against = np.vstack([np.zeros(len(s)), hidden * s**2 - spent[:, None]])
        # log Σ exp of n numbers is between the largest of them and log n more: only what is near takes the sums
        odds = for_it.max(axis=0) - against.max(axis=0)
        ok: np.ndarray = odds - np.log(len(against)) >= ODDS
        near = ~ok & (odds + np.log(len(for_it)) >= ODDS)
        sums = [np.logaddexp.reduce(x[:, near]) for x in (for_it, against)]
        ok[near] = sums[0] - sums[1] >= ODDS
        return ok

    rungs = np.geomspace(LEAST, MOST, RUNGS)
    steps = np.array([shown(np.full(len(ways), s)) for s in rungs])
    first = np.argmax(steps, axis=0)
    high = rungs[first]
    low = np.where(first > 0, rungs[first - 1], 0.0)
    for _ in range(HALVES):
        middle = (low + high) / 2
        ok = shown(middle)
        low, high = np.where(ok, low, middle), np.where(ok, middle, high)
    return np.where(steps.any(axis=0), high, np.inf)

"""How large calibration's errors are, over what captures.json declares of them.

A tolerance is one standard deviation, and nobody knows it exactly. Where many numbers have the same one, the captures
tell it: a factor κ for each, the one under which the best hypothesis is the likeliest, with ln κ normally distributed a
priori, and never less than 1. What was not declared (how far lamps' colors and exposures are off, how captures differ
in brightness, how uneven surfaces are) is taken for a share of what was, which is a guess, and is judged apart.
Probabilities are averaged over what else κ may be. One number that is four tolerances off is an effect; a dozen of them
are a tolerance that is too small.

MacKay: Bayesian interpolation. Neural Computation 1992 (the evidence of hyperparameters).
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import product
from threading import Lock

import numpy as np

from analysis.gap.evidence.hypotheses import best_first
from analysis.gap.evidence.likelihood import Evidence, Hypothesis
from analysis.gap.parallel import each, own_property
from analysis.gap.terms.base import Term
from analysis.gap.terms.generic import CAPTURE, FACTOR, SURFACE
from interchange.captures import Tolerances

FACTORS = (1.0, 1.5, 2.0, 3.0, 4.5)  # none below 1: other effects' forms need what is declared
DECLARED, STEPS = 0, range(len(FACTORS))
SPREAD = 0.25  # of ln κ: tolerances are known to a quarter
GUESSED = 0.7  # the same of those that were not declared: to a factor of two
# numbers that share a tolerance, and how many cameras, lamps or materials they are of, to tell it
LEAST, THINGS = 6, 3
MANY = 20  # numbers that tell it of whatever they are: a field's waves
KEPT = 48  # evidences, of which each is some MB
RESCALED = 2  # times that tolerances are looked at with other hypotheses
LEAD = 8  # hypotheses that are looked at, besides the parts of the best one
NEAR = 12.0  # how far below the best one's score they are averaged
EXPLAINED = 1.1  # residual over what is expected, up to which errors of calibration may be judged at all

LEFT = "effects that no tolerance speaks of"
COLORS, DRIFT = "errors of lamps' colors", "changes of brightness from capture to capture"
EXPOSURES, PATTERNS = "errors of exposures", "patterns of surfaces"
SHARES = {  # {what was not declared: the tolerance that its spikes are a share of, its causes}
    COLORS: ("light_intensity", ("light_spectrum",)),
    DRIFT: ("light_intensity", (CAPTURE,)),
    EXPOSURES: ("light_intensity", ("exposure",)),
    PATTERNS: ("albedo", ("texture", SURFACE)),
}
UNDECLARED = (LEFT, *SHARES)

Shares = dict[str, np.ndarray]
Place = dict[str, int]  # number of the factor of each tolerance


def _times() -> dict[str, float]:
    """A number of its own for each tolerance, by which it is known among the spikes."""
    return {f.name: float(k + 2) for k, f in enumerate(fields(Tolerances))}


def told_apart(tolerances: Tolerances) -> Tolerances:
    """The same, each as many times as large as no other is."""
    return replace(
        tolerances, **{name: times * getattr(tolerances, name) for name, times in _times().items()}
    )


def shares(before: Sequence[Term], after: Sequence[Term]) -> Shares:
    """{tolerance: (q,)}: 1 for the terms whose spike goes with it; ``UNDECLARED`` ones apart from the flat field and
    the lamps' intensities that they are shares of (analysis.gap.terms.left). ``after``: the same terms under the
    tolerances
    ``told_apart``."""
    spikes = [np.array([t.spike for t in terms]) for terms in (before, after)]
    grown = np.divide(spikes[1], spikes[0], out=np.ones(len(before)), where=spikes[0] > 0)
    out = {name: np.isclose(grown, factor).astype(float) for name, factor in _times().items()}
    is_field = np.array([t.cause == FACTOR for t in before])
    out[LEFT] = np.where(is_field, 0.0, out["flat_field"])
    out["flat_field"] = np.where(is_field, out["flat_field"], 0.0)
    for name, (tolerance, causes) in SHARES.items():
        own = np.array([t.cause in causes for t in before])
        out[name] = np.where(own, out[tolerance], 0.0)
        out[tolerance] = np.where(own, 0.0, out[tolerance])
    return out


def widths(shares: Shares, factors: dict[str, float], q: int) -> np.ndarray:
    """(q,): how many times as wide each term's spike is; those beyond ``shares`` (forms) stay as they are."""
    out = np.ones(q)
    for name, factor in factors.items():
        part = shares[name]
        out[: len(part)] *= 1 + (factor - 1) * part
    return out


class Ladder:
    """Some of a stand's ``hypotheses``, best first, under tolerances of other widths: the best ones and all parts of
    the best. ``declared`` (q,): spikes as declared. Families of terms that none of them has are left out."""

    def __init__(
        self, evidence: Evidence, declared: np.ndarray, shares: Shares, hypotheses: Sequence[Hypothesis]
    ) -> None:
        best = hypotheses[0]
        parts = [h for h in hypotheses if set(h.causes) <= set(best.causes)]  # none at all among them
        self.lead = list(dict.fromkeys([*hypotheses[:LEAD], *parts]))
        wanted = {i for h in self.lead for c in h.causes for i in evidence.members[c]}
        kept = np.array([i for i, t in enumerate(evidence.terms) if t.family is None or i in wanted])
        self.e, self.terms = evidence.e.of(kept), [evidence.terms[i] for i in kept]
        self.declared, self.in_force = declared[kept], evidence.in_force
        forms = np.zeros(len(evidence.terms))
        self.shares = {name: np.append(part, forms)[kept] for name, part in shares.items()}
        seen = self.e.share > 0
        self.judged = [name for name, part in self.shares.items() if self._many(part * seen > 0.5)]
        self._scores: dict[tuple[int, ...], dict[int, float]] = {}
        self._evidence: OrderedDict[tuple[int, ...], tuple[Evidence, float]] = OrderedDict()
        self._keeping = Lock()

    @own_property
    def _anywhere(self) -> Evidence:
        return Evidence(self.e, self.terms, self.in_force, self.declared)

    def _many(self, own: np.ndarray) -> bool:
        """Whether the terms ``own`` (q,) bool tell what their tolerance is: one thing that is off is an effect."""
        things = len({self.terms[i].target for i in np.flatnonzero(own)})
        return int(own.sum()) >= (LEAST if things >= THINGS else MANY)

    def scores(self, place: Place, which: Sequence[int]) -> np.ndarray:
        """(n,): of the hypotheses ``which``, with the prior of the factors at ``place``."""
        key = tuple(place[name] for name in self.judged)
        known = self._scores.setdefault(key, {})
        if todo := [i for i in which if i not in known]:
            there, prior = self._there(place, key)
            for i in todo:
                known[i] = there.at(self.lead[i].causes, self.lead[i].slabs).score + prior
        return np.array([known[i] for i in which])

    def _there(self, place: Place, key: tuple[int, ...]) -> tuple[Evidence, float]:
        """The evidence at ``place``, and the log of the factors' prior; the last ``KEPT`` are kept."""
        with self._keeping:
            if key in self._evidence:
                self._evidence.move_to_end(key)
                return self._evidence[key]
        wide = widths(self.shares, {n: FACTORS[k] for n, k in place.items()}, len(self.terms))
        prior = sum(
            -0.5 * (np.log(FACTORS[k]) / (GUESSED if name in UNDECLARED else SPREAD)) ** 2
            for name, k in zip(self.judged, key, strict=True)
        )
        there = self._anywhere.with_spikes(self.declared * wide), float(prior)
        with self._keeping:
            self._evidence[key] = there
            while len(self._evidence) > KEPT:
                self._evidence.popitem(last=False)
        return there

    def climbed(self, place: Place, which: Sequence[int]) -> Place:
        """Up and down the factors from ``place``, one tolerance after the other, as long as the best of some of the
        hypotheses gains."""
        best, moved = self.scores(place, which).max(), True
        while moved:
            moved = False
            for name, way in product(self.judged, (1, -1)):
                while (k := place[name] + way) in STEPS:
                    found = self.scores(place | {name: k}, which).max()
                    if found <= best:
                        break
                    best, place, moved = found, place | {name: k}, True
        return place

    def averaged(self, place: Place, i: int) -> float:
        """The score of hypothesis ``i`` by all that each tolerance may be, one at a time, around where it is best."""
        place = self.climbed(place, [i])
        there = float(self.scores(place, [i])[0])
        if not np.isfinite(there):
            return there
        around = [place | {name: k} for name in self.judged for k in STEPS]
        rungs = np.reshape([self.scores(at, [i])[0] - there for at in around], (-1, len(STEPS)))
        return there + float(np.logaddexp.reduce(rungs, axis=1).sum())


def factors(
    evidence: Evidence, declared: np.ndarray, shares: Shares, hypotheses: Sequence[Hypothesis]
) -> dict[str, float]:
    """{tolerance: κ}, of those that are not as declared; none where the best of ``hypotheses``, best first, explains
    the captures badly: errors of another kind would pass for calibration's. ``declared`` (q,): spikes as declared."""
    if evidence.left(hypotheses[0]) >= EXPLAINED:
        return {}
    ladder = Ladder(evidence, declared, shares, hypotheses)
    place = ladder.climbed(dict.fromkeys(ladder.judged, DECLARED), range(len(ladder.lead)))
    return {name: FACTORS[k] for name, k in place.items() if k != DECLARED}


def averaged(
    evidence: Evidence,
    declared: np.ndarray,
    shares: Shares,
    hypotheses: Sequence[Hypothesis],
    factors: dict[str, float],
) -> tuple[Hypothesis, ...]:
    """The hypotheses of a stand whose tolerances are ``factors`` times as declared, best first, by all that each
    tolerance may be: one that needs it to be just so is less probable. The best keeps its score, as others' are told
    by it."""
    if evidence.left(hypotheses[0]) >= EXPLAINED:
        return tuple(hypotheses)
    ladder = Ladder(evidence, declared, shares, hypotheses)
    place = {name: FACTORS.index(factors.get(name, 1.0)) for name in ladder.judged}
    best = hypotheses[0]
    near = [h for h in ladder.lead if h.score > best.score - NEAR or set(h.causes) < set(best.causes)]
    scores = each(lambda h: ladder.averaged(place, ladder.lead.index(h)), near)
    gain = {h: x - h.score for h, x in zip(near, scores, strict=True)}
    gain = {h: x for h, x in gain.items() if np.isfinite(x)}  # else below what its terms may be
    if best not in gain:
        return tuple(hypotheses)
    least = min(gain.values())
    told = [replace(h, log_Z=h.log_Z + gain.get(h, least) - gain[best]) for h in hypotheses]
    return tuple(sorted(told, key=lambda h: -h.score))


class Widths:
    """How wide the spikes of a search's terms are: ``declared`` (q,), as they are at the first stand, as tolerances do
    not grow with a blur; ``spikes`` (q,), the same as large as the captures say, ``factors`` {tolerance: κ} times.
    Without ``shares`` all are as declared."""

    def __init__(self, shares: Shares | None) -> None:
        self.shares = shares
        self.declared: np.ndarray | None = None
        self.spikes: np.ndarray | None = None
        self.factors: dict[str, float] = {}

    def first(self, spikes: np.ndarray) -> None:
        """What the first stand has, if this is it."""
        if self.spikes is None:
            self.declared = self.spikes = spikes

    def declared_at(self, spikes: np.ndarray) -> np.ndarray:
        """A stand's ``spikes`` as declared; those beyond the search's terms (forms) stay as they are."""
        return spikes if self.declared is None else np.append(self.declared, spikes[len(self.declared) :])

    def of(self, index: Sequence[int] | np.ndarray) -> np.ndarray | None:
        """Spikes of some of the terms."""
        return None if self.spikes is None else self.spikes[index]

    def judged(
        self, evidence: Evidence, hypotheses: tuple[Hypothesis, ...]
    ) -> tuple[Evidence, tuple[Hypothesis, ...]]:
        """A stand's evidence with tolerances as large as the captures say that they are, and its hypotheses."""
        if self.declared is None or self.shares is None:
            return evidence, hypotheses
        q = len(self.declared)
        for _ in range(RESCALED):
            declared = self.declared_at(evidence.spike)
            found = factors(evidence, declared, self.shares, hypotheses)
            if found == self.factors:
                break
            self.factors = found
            self.spikes = self.declared * widths(self.shares, found, q)
            spikes = np.append(self.spikes, evidence.spike[q:])
            evidence = evidence.with_spikes(spikes)
            hypotheses = tuple(best_first(evidence))
        return evidence, hypotheses

    def averaged(self, evidence: Evidence, hypotheses: tuple[Hypothesis, ...]) -> tuple[Hypothesis, ...]:
        """A stand's hypotheses by all that tolerances may be besides what they look."""
        if self.declared is None or self.shares is None:
            return hypotheses
        declared = self.declared_at(evidence.spike)
        return averaged(evidence, declared, self.shares, hypotheses, self.factors)

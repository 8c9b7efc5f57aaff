"""Registration, linearisation, evidence, and again where the best hypothesis stands.

What is linear is linear everywhere; the image chain and what moves the image are linearised anew where a hypothesis
stands, from more than one start, and the starts compare by their whole log Z.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from analysis.gap.chain_terms import chain_terms, effects_at
from analysis.gap.conditions import Condition
from analysis.gap.evidence import Cause, Evidence, Hypothesis, posterior
from analysis.gap.form_terms import Change, doubt, form_terms
from analysis.gap.generic_terms import generic_terms
from analysis.gap.geometry_terms import geometry_terms
from analysis.gap.knot_terms import knot_terms
from analysis.gap.knots import Knots
from analysis.gap.light_terms import light_terms
from analysis.gap.material_terms import material_terms
from analysis.gap.normal_equations import NormalEquations, equations, stride_for
from analysis.gap.radiance import Rendered
from analysis.gap.state import State
from analysis.gap.terms import NUISANCE, Term, added
from interchange.captures import Tolerances
from interchange.effects import Effect
from interchange.problems import BrightfieldError

Told = Callable[[str, float], None]

STARTS, ROUNDS = 4, 3
REGISTRATIONS = 2
REGISTERED_WITH = ("light_intensity", "albedo")  # what edges' heights depend on
SETTLED = 0.05  # of a number: a smaller change needs no new linearisation
WORTH = 10.0  # gain of log Z over no cause at all, from which more than one start is tried


@dataclass(frozen=True, eq=False)
class Model:
    """A simulation with corrections: ``theta`` (q,) of ``terms``, around ``at`` (q,), where chain and flow stand."""

    terms: tuple[Term, ...]
    theta: np.ndarray
    at: np.ndarray

    def state(self, condition: Condition, stride: int = 1, symmetric: bool = False) -> State:
        return State(condition, self.effects(condition), self.flow(condition), stride, symmetric)

    def effects(self, condition: Condition) -> list[Effect]:
        values = {t.key: float(x) for t, x in zip(self.terms, self.at, strict=True)}
        return effects_at(self.terms, values, State(condition))

    def flow(self, condition: Condition) -> np.ndarray | None:
        """(H, W, 2) px that the image moves by; conditions that share a rendering share it."""
        moving = [(t, x) for t, x in zip(self.terms, self.at, strict=True) if t.kind == "flow" and x]
        if not moving:
            return None
        key = id(condition.shown)
        if key not in self._flows:
            self._flows[key] = condition.shown, self._flow(State(condition), moving)
        return self._flows[key][1]

    @cached_property
    def _flows(self) -> dict[int, tuple[Rendered, np.ndarray]]:
        return {}

    def _flow(self, state: State, moving: Sequence[tuple[Term, float]]) -> np.ndarray:
        total = np.zeros((*state.condition.mean.shape[:2], 2))
        for term, x in moving:
            found = term.flow(state) if term.flow is not None else None
            if found is not None:
                total += x * np.stack(found, axis=-1)
        return total

    def simulated(self, condition: Condition, stride: int = 1) -> np.ndarray:
        """(H, W, C): expected DN of a condition with every correction, on every ``stride``-th pixel."""
        state = self.state(condition, stride)
        return state.take(state.simulation.dn) + added(state, self.terms, self.theta - self.at)

    def without(self, index: np.ndarray) -> "Model":
        theta, at = self.theta.copy(), self.at.copy()
        theta[index], at[index] = 0.0, 0.0
        return replace(self, theta=theta, at=at)


@dataclass(frozen=True, eq=False)
class Stand:
    """The evidence where a hypothesis stands. The first ``q`` terms of ``terms`` are every stand's, forms follow."""

    terms: tuple[Term, ...]
    at: np.ndarray
    evidence: Evidence
    parts: tuple[NormalEquations, ...]
    hypotheses: tuple[Hypothesis, ...]

    @property
    def best(self) -> Hypothesis:
        return self.hypotheses[0]


@dataclass(frozen=True, eq=False)
class Fit:
    """``before`` has calibration's errors taken out alone; ``after`` the causes as well. ``hypotheses``: best first."""

    before: Model
    after: Model
    hypotheses: tuple[Hypothesis, ...]
    probability: dict[Cause, float]
    terms: tuple[Term, ...]
    evidence: Evidence
    parts: tuple[NormalEquations, ...]  # of each condition, at ``after``

    @property
    def best(self) -> Hypothesis:
        return self.hypotheses[0]

    @property
    def theta(self) -> np.ndarray:
        return self.after.theta

    @property
    def probability_of_none(self) -> float:
        """That calibration's errors explain everything."""
        score = np.array([h.score for h in self.hypotheses])
        p = np.exp(score - score.max())
        return float(p[[not h.causes for h in self.hypotheses]].sum() / p.sum())


def fit(
    conditions: Sequence[Condition],
    tolerances: Tolerances,
    told: Told = lambda what, share: None,
    knots: Knots | None = None,
) -> Fit:
    """``conditions``: those that may be fitted to, rendered. ``knots`` renders what effects of the scene change;
    without it those that need that are not tried."""
    stride = stride_for(conditions)
    terms = _terms(conditions, tolerances, knots)
    told("registration", 0.0)
    first = _stand(
        conditions, terms, _registered(conditions, terms, stride, told), {}, stride, told, "evidence"
    )
    stands = [first]
    none = next(h for h in first.hypotheses if not h.causes)
    if first.best.causes:
        gain = first.best.score - none.score
        starts = _starts(first.hypotheses)[: STARTS if gain > WORTH else 1]
        for k, start in enumerate(starts):
            if any(set(start.causes) == set(s.best.causes) for s in stands[1:]):
                continue  # another start came here
            stands.append(_followed(conditions, terms, first, start, stride, told, f"fit {k + 1}"))
    chosen = max(stands[1:] or stands, key=lambda s: s.best.score)
    return _fit(terms, chosen)


def _registered(
    conditions: Sequence[Condition], terms: Sequence[Term], stride: int, told: Told
) -> np.ndarray:
    """(q,): where the terms that move the image stand, with no cause at all: edges that are off by a part of a pixel
    would forge every effect that changes edges."""
    at = np.zeros(len(terms))
    own = [i for i, t in enumerate(terms) if t.kind == "flow" or t.cause in (NUISANCE, *REGISTERED_WITH)]
    for k in range(REGISTRATIONS):
        model = Model(tuple(terms), at, at)
        states = [model.state(c, stride) for c in conditions]
        parts = [equations(s, [terms[i] for i in own], at[own]) for s in states if s.usable.any()]
        if not parts:
            break
        there = Evidence(total_of(parts), [terms[i] for i in own])
        theta = there.theta(there.at((), ()))
        at = np.zeros(len(terms))
        for i, x in zip(own, theta, strict=True):
            at[i] = x if terms[i].kind == "flow" else 0.0
        told("registration", (k + 1) / REGISTRATIONS)
    return at


def _starts(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The best one, pair and single, whose forms have not been in doubt yet; and the best without what the best has."""
    found = [hypotheses[0]]
    for size in (2, 1):
        found += [h for h in hypotheses if len(h.causes) == size and h not in found][:1]
    taken = set(hypotheses[0].causes)
    found += [h for h in hypotheses if h.causes and not taken & set(h.causes) and h not in found][:1]
    return found


def _followed(
    conditions: Sequence[Condition],
    terms: Sequence[Term],
    first: Stand,
    start: Hypothesis,
    stride: int,
    told: Told,
    what: str,
) -> Stand:
    """Linearised where the hypothesis stands, until the best one there is the one that it was linearised at."""
    stand, best, q = first, start, len(terms)
    theta = stand.evidence.theta(best)
    for _ in range(ROUNDS):
        at = _start(terms, best, theta, stand.evidence)
        model = Model(tuple(terms), theta, at)
        members = {c: stand.evidence.members[c] for c in best.causes}
        changes = {c: _change(model, index, conditions, stride) for c, index in members.items()}
        before, theta_before = best, theta
        stand = _stand(conditions, terms, at, changes, stride, told, what)
        best = stand.best
        theta = stand.evidence.theta(best)[:q]
        if best.causes == before.causes:
            moved = np.abs(theta - theta_before)
            near = np.maximum(stand.evidence.spike[:q], SETTLED * np.abs(theta))
            if not any((moved[i] > near[i]).any() for i in members.values()):
                break
    return stand


def _change(model: Model, index: np.ndarray, conditions: Sequence[Condition], stride: int) -> Change:
    """What a cause changes in each condition."""
    without, own = model.without(index), [model.terms[i] for i in index]
    out = {}
    for c in conditions:
        state = model.state(c, stride)
        change = added(state, own, (model.theta - model.at)[index])
        if model.at[index].any():
            change = change + state.take(state.simulation.dn - without.state(c).simulation.dn)
        out[c.name] = np.asarray(change, np.float32)
    return out


def _fit(terms: Sequence[Term], stand: Stand) -> Fit:
    """Causes as the evidence weighs them, forms in doubt; numbers as the formulas alone give them."""
    q = len(terms)
    parts = tuple(_of_terms(p, q) for p in stand.parts)
    evidence = Evidence(total_of(parts), terms)
    best = stand.best
    theta = evidence.theta(best)
    after = Model(tuple(terms), theta, stand.at)
    cause = np.zeros(q, bool)
    for c in best.causes:
        cause[evidence.members[c]] = True
    moves = np.array([t.kind == "flow" for t in terms])
    before = Model(tuple(terms), np.where(cause, 0.0, theta), np.where(moves & ~cause, stand.at, 0.0))
    probability = believed(posterior(stand.hypotheses), best.causes, evidence, theta)
    return Fit(before, after, stand.hypotheses, probability, tuple(terms), evidence, parts)


def believed(
    probability: dict[Cause, float], causes: Sequence[Cause], evidence: Evidence, theta: np.ndarray
) -> dict[Cause, float]:
    """The probabilities of the effects among ``causes``, lower where experience says that the evidence is too sure:

        p E / (E + E_unknown)        beside something without a name, as far as they outweigh it
        p min(1, E_all / Σ E)        where what they change is undone by the others

    E: Δ' W Δ of what a cause changes, E_all of all together. On cases whose cause was known, an effect that was called
    beside a stronger unknown was right one time in eight, and effects that undid each other never (docs/diagnosis.md).
    """
    if not causes:
        return probability
    generic = {c: evidence.terms[evidence.members[c][0]].generic for c in causes}

    def energy(index: np.ndarray) -> float:
        return float(theta[index] @ evidence.e.G[np.ix_(index, index)] @ theta[index])

    each = {c: energy(evidence.members[c]) for c in causes}
    named = [c for c in causes if not generic[c]]
    unknown = sum(e for c, e in each.items() if generic[c])
    out = dict(probability)
    if named:
        together = energy(np.concatenate([evidence.members[c] for c in named]))
        coherent = min(1.0, together / max(sum(each[c] for c in named), 1e-30))
        for c in named:
            out[c] *= coherent * each[c] / max(each[c] + unknown, 1e-30)
    return out


def _of_terms(part: NormalEquations, q: int) -> NormalEquations:
    return replace(part, G=part.G[:q, :q], b=part.b[:q])


def _terms(conditions: Sequence[Condition], tolerances: Tolerances, knots: Knots | None) -> list[Term]:
    bright = max(conditions, key=lambda c: float(np.median(c.mean)))
    return [
        *geometry_terms(conditions, tolerances),
        *light_terms(conditions, tolerances, knots),
        *material_terms(conditions, tolerances),
        *(knot_terms(conditions, tolerances, knots) if knots is not None else []),
        *chain_terms(State(bright), tolerances),
        *generic_terms(conditions, tolerances),
    ]


def _start(terms: Sequence[Term], best: Hypothesis, theta: np.ndarray, evidence: Evidence) -> np.ndarray:
    """Where the next linearisation stands: all that moves the image, and the chain's terms of the causes, as found."""
    start = np.array([x if t.kind == "flow" else 0.0 for t, x in zip(terms, theta, strict=False)])
    for cause in best.causes:
        for i in evidence.members[cause]:
            if terms[i].kind == "chain":
                start[i] = max(theta[i], terms[i].low)
    return start


def _stand(
    conditions: Sequence[Condition],
    terms: Sequence[Term],
    at: np.ndarray,
    changes: dict[Cause, Change],
    stride: int,
    told: Told,
    what: str,
) -> Stand:
    free = {t.candidate for t in terms if t.family is not None}  # of any form
    forms = form_terms({c: change for c, change in changes.items() if c not in free})
    every = [*terms, *forms]
    at_all = np.append(at, np.zeros(len(forms)))
    model = Model(tuple(terms), at, at)
    parts = []
    for k, condition in enumerate(conditions):
        state = model.state(condition, stride, symmetric=True)
        if not state.usable.any():
            continue
        parts.append(equations(state, every, at_all, doubt(list(changes.values()), state)))
        told(what, (k + 1) / len(conditions))
    if not parts:
        raise BrightfieldError("No pixel of the captures can be compared: all are masked or saturated.")
    evidence = Evidence(total_of(parts), every)
    return Stand(tuple(every), at, evidence, tuple(parts), tuple(evidence.search()))


def total_of(parts: Sequence[NormalEquations]) -> NormalEquations:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def uncertainty(found: Fit) -> np.ndarray:
    """(q,): standard deviation of every term under the best hypothesis: the formal one, and what leaving out a
    condition after the other shows (the jackknife), which sees errors that pixels share.

    Efron: The jackknife, the bootstrap and other resampling plans. SIAM 1982.
    """
    best, n = found.best, len(found.parts)
    formal = found.evidence.sigma(best)
    if n < 3:
        return formal
    wide = {i for c in best.causes for i in found.evidence.members[c]}
    kept = np.array([i for i, t in enumerate(found.terms) if t.family is None or i in wide])
    terms = [found.terms[i] for i in kept]
    own = [replace(p, G=p.G[np.ix_(kept, kept)], b=p.b[kept]) for p in found.parts]
    fitted = []
    for k in range(n):
        rest = Evidence(total_of([p for i, p in enumerate(own) if i != k]), terms)
        if all(c in rest.members for c in best.causes):
            fitted.append(rest.theta(best))
    if len(fitted) < 3:
        return formal
    spread = np.zeros(len(found.terms))
    spread[kept] = np.var(fitted, axis=0) * (len(fitted) - 1)
    return np.asarray(np.sqrt(formal**2 + spread))

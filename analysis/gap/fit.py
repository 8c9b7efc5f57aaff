"""Registration, linearisation, evidence, and again where the best hypothesis stands."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.gap.chain_terms import chain_terms, effects_at
from analysis.gap.conditions import Condition
from analysis.gap.evidence import Evidence, Hypothesis, posterior
from analysis.gap.generic_terms import generic_terms
from analysis.gap.geometry_terms import geometry_terms
from analysis.gap.light_terms import light_terms
from analysis.gap.normal_equations import NormalEquations, equations, stride_for
from analysis.gap.state import State
from analysis.gap.terms import Term
from interchange.captures import Tolerances
from interchange.effects import Effect
from interchange.problems import BrightfieldError

Cause = tuple[str, str]
Told = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Model:
    """A simulation with corrections: ``theta`` (q,) of ``terms``, around ``at`` (q,), where chain and flow stand."""

    terms: tuple[Term, ...]
    theta: np.ndarray
    at: np.ndarray

    def state(self, condition: Condition, stride: int = 1) -> State:
        return State(condition, self.effects(condition), self.flow(condition), stride)

    def effects(self, condition: Condition) -> list[Effect]:
        values = {t.key: float(x) for t, x in zip(self.terms, self.at, strict=True)}
        return effects_at(self.terms, values, State(condition))

    def flow(self, condition: Condition) -> np.ndarray | None:
        moving = [(t, x) for t, x in zip(self.terms, self.at, strict=True) if t.kind == "flow" and x]
        if not moving:
            return None
        state = State(condition)
        total = np.zeros((*condition.mean.shape[:2], 2))
        for term, x in moving:
            found = term.flow(state) if term.flow is not None else None
            if found is not None:
                total += x * np.stack(found, axis=-1)
        return total

    def simulated(self, condition: Condition) -> np.ndarray:
        """(H, W, C): expected DN of a condition with every correction."""
        state = self.state(condition)
        dn = state.simulation.dn.astype(np.float64)
        for term, x in zip(self.terms, self.theta - self.at, strict=True):
            if x:
                column = term.field(state)
                if column is not None:
                    dn += x * column
        return dn


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


def fit(
    conditions: Sequence[Condition], tolerances: Tolerances, told: Told = lambda what, share: None
) -> Fit:
    """``conditions``: those that may be fitted to, rendered."""
    stride = stride_for(conditions)
    terms = _terms(conditions, tolerances)
    zero = np.zeros(len(terms))
    told("registration", 0.0)
    evidence, parts = _linearised(conditions, terms, zero, stride, told, "registration")
    at = zero
    hypotheses = evidence.search()
    for _ in range(2):
        best = hypotheses[0]
        start = _start(terms, best, evidence)
        if not best.causes and not np.any(start):
            break
        at = start
        evidence, parts = _linearised(conditions, terms, at, stride, told, "fit")
        again = evidence.search()
        settled = again[0].causes == best.causes
        hypotheses = again
        if settled:
            break
    best = hypotheses[0]
    after = Model(tuple(terms), best.theta, at)
    cause = np.zeros(len(terms), bool)
    for c in best.causes:
        cause[evidence.members[c]] = True
    before = Model(tuple(terms), np.where(cause, 0.0, best.theta), zero)
    return Fit(before, after, tuple(hypotheses), posterior(hypotheses), tuple(terms), evidence, parts)


def _terms(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    bright = max(conditions, key=lambda c: float(np.median(c.mean)))
    return [
        *geometry_terms(conditions, tolerances),
        *light_terms(conditions, tolerances),
        *chain_terms(State(bright), tolerances),
        *generic_terms(conditions, tolerances),
    ]


def _start(terms: Sequence[Term], best: Hypothesis, evidence: Evidence) -> np.ndarray:
    """Where the next linearisation stands: the chain's and the flow's terms of the causes, as they were found."""
    start = np.zeros(len(terms))
    for cause in best.causes:
        for i in evidence.members[cause]:
            if terms[i].kind in ("chain", "flow"):
                start[i] = max(best.theta[i], terms[i].low)
    return start


def _linearised(
    conditions: Sequence[Condition], terms: Sequence[Term], at: np.ndarray, stride: int, told: Told, what: str
) -> tuple[Evidence, tuple[NormalEquations, ...]]:
    model = Model(tuple(terms), at, at)
    parts = []
    for k, condition in enumerate(conditions):
        state = model.state(condition, stride)
        if not state.usable.any():
            continue
        parts.append(equations(state, terms, at))
        told(what, (k + 1) / len(conditions))
    if not parts:
        raise BrightfieldError("No pixel of the captures can be compared: all are masked or saturated.")
    return Evidence(total_of(parts), terms), tuple(parts)


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
    fitted = []
    for k in range(n):
        rest = Evidence(total_of([p for i, p in enumerate(found.parts) if i != k]), found.terms)
        if all(c in rest.members for c in best.causes):
            fitted.append(rest.at(best.causes, best.slabs).theta)
    if len(fitted) < 3:
        return formal
    spread = np.var(fitted, axis=0) * (len(fitted) - 1)
    return np.asarray(np.sqrt(formal**2 + spread))

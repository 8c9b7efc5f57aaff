"""Registration, linearisation, evidence, and again where the best hypothesis stands.

What is linear is linear everywhere; the image chain and what moves the image are linearised anew where a hypothesis
stands, from more than one start, and the starts compare by their whole log Z.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.gap.chain_terms import chain_terms
from analysis.gap.conditions import Condition
from analysis.gap.evidence import Cause, Evidence, Hypothesis, posterior
from analysis.gap.form_terms import Change, doubt, form_terms
from analysis.gap.generic_terms import generic_terms
from analysis.gap.geometry_terms import geometry_terms, moved_objects
from analysis.gap.knot_terms import knot_terms
from analysis.gap.knots import Knots
from analysis.gap.light_terms import light_terms, shaded
from analysis.gap.material_terms import material_terms
from analysis.gap.model import Model
from analysis.gap.normal_equations import NormalEquations, equations, stride_for
from analysis.gap.sensitivities import Sensitivities, sensitivities
from analysis.gap.state import State
from analysis.gap.terms import NUISANCE, Term, added
from interchange.captures import Tolerances
from interchange.effects.parts import has
from interchange.problems import BrightfieldError

Told = Callable[[str, float], None]

STARTS, ROUNDS, MOVES = 4, 3, 2
MOVING = ("camera_pose", "principal_point", "lens_distortion", "object_pose", "geometry", "light_position")
REGISTRATIONS, REFINEMENTS = 2, 4
MOST_RENDERED = 2  # causes of a hypothesis that are drawn where they stand: those that are furthest away
SHORTEST = 0.2  # part of a step
FOLLOWED = ("chain", "flow", "scene")  # kinds of terms that are drawn anew where they stand
REGISTERED_WITH = ("light_intensity", "albedo")  # what edges' heights depend on
SETTLED = 0.05  # of a number: a smaller change needs no new linearisation
WORTH = 10.0  # gain of log Z over no cause at all, from which more than one start is tried


@dataclass(frozen=True, eq=False)
class Stand:
    """The evidence where a hypothesis stands. The first ``q`` terms of ``terms`` are every stand's, forms follow."""

    terms: tuple[Term, ...]
    at: np.ndarray
    evidence: Evidence
    parts: tuple[NormalEquations, ...]
    hypotheses: tuple[Hypothesis, ...]
    kept: dict[str, Sensitivities]  # by the condition's name

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
    search = _Search(conditions, tuple(_terms(conditions, tolerances, knots)), knots, told)
    told("registration", 0.0)
    first = search.stand(search.registered(), {}, "evidence", {})
    stands = [first]
    none = next(h for h in first.hypotheses if not h.causes)
    if first.best.causes:
        gain = first.best.score - none.score
        moves = search.moves(first) if gain > WORTH and search.may_move(first.best) else []
        starts = [*moves, *(h for h in _starts(first.hypotheses) if h not in moves)]
        for k, start in enumerate(starts[: STARTS - len(moves) // 2 if gain > WORTH else 1]):
            if any(set(start.causes) == set(s.best.causes) for s in stands[1:]):
                continue  # another start came here
            stands.append(search.followed(first, start, f"fit {k + 1}"))
            if start in moves and stands[-1].best.causes == start.causes:
                break  # what moved is all: the other starts are of a registration that hides it
    chosen = max(stands[1:] or stands, key=lambda s: s.best.score)
    return _fit(search.terms, chosen, knots)


class _Search:
    """The same captures and terms at every stand."""

    def __init__(
        self, conditions: Sequence[Condition], terms: tuple[Term, ...], knots: Knots | None, told: Told
    ) -> None:
        self.conditions, self.terms, self.knots, self.told = conditions, terms, knots, told
        self.stride = stride_for(conditions)
        self.q = len(terms)
        self.registering = {
            i for i, t in enumerate(terms) if t.kind == "flow" or t.cause in (NUISANCE, *REGISTERED_WITH)
        }

    def model(self, theta: np.ndarray, at: np.ndarray) -> Model:
        return Model(self.terms, theta, at, self.knots)

    def registered(self) -> np.ndarray:
        """(q,): where the terms that move the image stand, with no cause at all: edges that are off by a part of a
        pixel would forge every effect that changes edges."""
        at = np.zeros(self.q)
        own = [
            i for i, t in enumerate(self.terms) if t.kind == "flow" or t.cause in (NUISANCE, *REGISTERED_WITH)
        ]
        terms = [self.terms[i] for i in own]
        for k in range(REGISTRATIONS):
            model = self.model(at, at)
            states = [model.state(c, self.stride) for c in self.conditions]
            parts = [equations(s, terms, at[own]) for s in states if s.usable.any()]
            if not parts:
                break
            there = Evidence(total_of(parts), terms)
            theta = there.theta(there.at((), ()))
            at = np.zeros(self.q)
            for i, x in zip(own, theta, strict=True):
                at[i] = x if self.terms[i].kind == "flow" else 0.0
            self.told("registration", (k + 1) / REGISTRATIONS)
        return at

    def may_move(self, best: Hypothesis) -> bool:
        """Whether it has what changes edges, or what has no name: things that stand elsewhere look like that."""
        return any(t.generic or t.kind in ("flow", "scene") for t in self.terms if t.candidate in best.causes)

    def moves(self, first: Stand) -> list[Hypothesis]:
        """The causes that let something stand elsewhere, alone, the ``MOVES`` that come nearest to the captures within
        a step from the scene as written. Registration without its cause hides each of them behind all the others."""
        found = []
        for cause, index in first.evidence.members.items():
            if cause[0] in MOVING:
                alone = first.evidence.best((cause,), {})
                theta = first.evidence.theta(alone)
                _, _, score = self.refined((cause,), {cause: index}, theta, first.kept, True, 2)
                found.append((score, alone))
            self.told("what moves", len(found) / len(first.evidence.members))
        return [h for _, h in sorted(found, key=lambda x: -x[0])[:MOVES]]

    def followed(self, first: Stand, start: Hypothesis, what: str) -> Stand:
        """Linearised where the hypothesis stands, until the best one there is the one that it was linearised at."""
        stand, best = first, start
        theta = stand.evidence.theta(best)
        kept = dict(first.kept)
        for _ in range(ROUNDS):
            members = {c: stand.evidence.members[c] for c in best.causes}
            theta, at, _ = self.refined(best.causes, members, theta, kept, stand is first)
            changes = {c: self.change(self.model(theta, at), index) for c, index in members.items()}
            before, theta_before = best, theta
            stand = self.stand(at, changes, what, kept)
            kept = stand.kept
            best = stand.best
            theta = stand.evidence.theta(best)[: self.q]
            settled = not self._moved(members, theta, theta_before, stand.evidence.spike)
            if best.causes == before.causes and settled:
                break
        return stand

    def refined(
        self,
        causes: tuple[Cause, ...],
        members: dict[Cause, np.ndarray],
        theta: np.ndarray,
        kept: dict[str, Sensitivities],
        anew: bool,
        rounds: int = REFINEMENTS,
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """``theta`` and ``at`` of a hypothesis alone, followed to where it stands (Gauss, Newton), and its score there.
        ``anew``: registered with it; what moves is looked for from the scene as written, as registration without it has
        moved another thing.
        """
        at = self.start(members, theta)
        bent = {i for index in members.values() for i in index if self.terms[i].kind in FOLLOWED}
        if not bent:
            return theta, at, -np.inf
        if anew and any(self.terms[i].kind in ("flow", "scene") for i in bent):
            at = np.zeros(self.q)
        own = np.array(
            [i for i, t in enumerate(self.terms) if t.candidate in members or i in self.registering]
        )
        place = {int(i): k for k, i in enumerate(own)}
        terms = [self.terms[i] for i in own]
        redrawn = {place[i] for i in place if i in bent or self.terms[i].kind == "flow"}
        near = {name: s.of(own) for name, s in kept.items()}
        best, step, aim = -np.inf, 1.0, at
        here, spike = at, np.zeros(self.q)
        for _ in range(rounds):
            model = self.model(at, at)
            parts = []
            for c in self.conditions:
                state = model.state(c, self.stride)
                if state.usable.any():
                    near[c.name] = sensitivities(state, terms, near.get(c.name), redrawn)
                    parts.append(equations(state, terms, at[own], drawn=near[c.name]))
            there = Evidence(total_of(parts), terms)
            found = there.best(causes, {}) if set(causes) <= set(there.members) else None
            if found is None or found.score < best:  # too far: half the way from where it was better
                step /= 2
                if step < SHORTEST:
                    break
                at = here + step * (aim - here)
                continue
            best, step, here = found.score, 1.0, at
            before, theta = theta, np.zeros(self.q)
            theta[own], spike[own] = there.theta(found), there.spike
            at = aim = self.start(members, theta)
            if not self._moved(members, theta, before, spike):
                break
        return theta, here, best

    def _moved(
        self, members: dict[Cause, np.ndarray], now: np.ndarray, before: np.ndarray, spike: np.ndarray
    ) -> bool:
        """Whether a number of the causes is no longer what it was."""
        off = np.abs(now[: self.q] - before[: self.q])
        near = np.maximum(spike[: self.q], SETTLED * np.abs(now[: self.q]))
        return any(bool((off[i] > near[i]).any()) for i in members.values())

    def start(self, members: dict[Cause, np.ndarray], theta: np.ndarray) -> np.ndarray:
        """Where the next linearisation stands: all that moves the image, and the terms of the causes that the chain or
        a rendering can follow, as found."""
        at = np.array([x if t.kind == "flow" else 0.0 for t, x in zip(self.terms, theta, strict=False)])
        rendered = []
        for index in members.values():
            for i in index:
                if self.terms[i].kind == "chain":
                    at[i] = max(theta[i], self.terms[i].low)
            scene = [i for i in index if self.terms[i].kind == "scene"]
            away = max((abs(theta[i]) / self.terms[i].step for i in scene), default=0.0)
            if away > 1:
                rendered.append((away, scene))
        for _, scene in sorted(rendered, key=lambda x: -x[0])[:MOST_RENDERED]:
            there = at.copy()
            for i in scene:
                there[i] = float(f"{max(theta[i], self.terms[i].low):.2g}")
            if self._can_stand(there):
                at = there
        return at

    def _can_stand(self, at: np.ndarray) -> bool:
        try:
            scene = self.model(at, at).scene
            for shown in {id(c.shown): c.shown for c in self.conditions}.values():
                for effect, target in scene:
                    if has(shown.scene, target):
                        effect.on_scene(shown.scene, target)
        except BrightfieldError:
            return False
        return True

    def change(self, model: Model, index: np.ndarray) -> Change:
        """What a cause changes in each condition."""
        without, own = model.without(index), [self.terms[i] for i in index]
        out = {}
        for c in self.conditions:
            state = model.state(c, self.stride)
            change = added(state, own, (model.theta - model.at)[index])
            if model.at[index].any():
                change = change + state.take(state.simulation.dn - without.state(c).simulation.dn)
            out[c.name] = np.asarray(change, np.float32)
        return out

    def stand(
        self,
        at: np.ndarray,
        changes: dict[Cause, Change],
        what: str,
        kept: dict[str, Sensitivities],
    ) -> Stand:
        """``changes``: of each cause that is in force at ``at``; ``kept``: sensitivities that a stand before had."""
        free = {t.candidate for t in self.terms if t.family is not None}  # of any form
        forms = form_terms({c: change for c, change in changes.items() if c not in free})
        every = [*self.terms, *forms]
        at_all = np.append(at, np.zeros(len(forms)))
        model = self.model(at, at)
        anew = {i for i, t in enumerate(self.terms) if t.candidate in changes and t.kind in FOLLOWED}
        parts, now = [], {}
        for k, condition in enumerate(self.conditions):
            state = model.state(condition, self.stride, symmetric=True)
            if not state.usable.any():
                continue
            before = kept.get(condition.name)
            drawn = sensitivities(state, self.terms, before, anew)
            now[condition.name] = drawn
            doubted = doubt(list(changes.values()), state)
            parts.append(equations(state, every, at_all, doubted, drawn.and_also(state, forms)))
            self.told(what, (k + 1) / len(self.conditions))
        if not parts:
            raise BrightfieldError("No pixel of the captures can be compared: all are masked or saturated.")
        evidence = Evidence(total_of(parts), every)
        return Stand(tuple(every), at, evidence, tuple(parts), tuple(evidence.search()), now)


def _starts(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The best one, pair and single, whose forms have not been in doubt yet; and the best without what the best has."""
    found = [hypotheses[0]]
    for size in (2, 1):
        found += [h for h in hypotheses if len(h.causes) == size and h not in found][:1]
    taken = set(hypotheses[0].causes)
    found += [h for h in hypotheses if h.causes and not taken & set(h.causes) and h not in found][:1]
    return found


def _fit(terms: Sequence[Term], stand: Stand, knots: Knots | None) -> Fit:
    """Causes as the evidence weighs them, forms in doubt; numbers as the formulas alone give them."""
    q = len(terms)
    parts = tuple(_of_terms(p, q) for p in stand.parts)
    evidence = Evidence(total_of(parts), terms)
    best = stand.best
    theta = evidence.theta(best)
    after = Model(tuple(terms), theta, stand.at, knots)
    cause = np.zeros(q, bool)
    for c in best.causes:
        cause[evidence.members[c]] = True
    moves = np.array([t.kind == "flow" for t in terms])
    before = Model(tuple(terms), np.where(cause, 0.0, theta), np.where(moves & ~cause, stand.at, 0.0), knots)
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
        *light_terms(conditions, tolerances),
        *material_terms(conditions, tolerances),
        *(
            knot_terms(conditions, tolerances, knots)
            if knots is not None
            else [*moved_objects(conditions, tolerances), *shaded(conditions, tolerances)]
        ),
        *chain_terms(State(bright), tolerances),
        *generic_terms(conditions, tolerances),
    ]


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

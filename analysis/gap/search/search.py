"""Where a hypothesis stands: registration, what moves, and the evidence linearised there.

What is linear is linear everywhere; the image chain, what moves the image and what changes the scene are followed to
where a hypothesis has them (Gauss-Newton), and all is linearised anew there.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.evidence.hypotheses import best_first
from analysis.gap.evidence.likelihood import Evidence, Hypothesis
from analysis.gap.evidence.scales import Shares, Widths
from analysis.gap.evidence.stand import WAVERS, Stand, Start
from analysis.gap.light.knots import Knots
from analysis.gap.light.radiance import Changes, changed
from analysis.gap.parallel import each
from analysis.gap.search.approach import Approach, approached_beside, approaches
from analysis.gap.search.changed import changed_in
from analysis.gap.search.model import Model
from analysis.gap.terms.base import NUISANCE, Cause, Term
from analysis.gap.terms.form import Change, doubt, form_terms
from analysis.gap.terms.moved import moved
from analysis.gap.terms.normal_equations import NormalEquations, equations, stride_for, total_of
from analysis.gap.terms.sensitivities import Sensitivities, sensitivities
from analysis.gap.terms.subpixel import straight
from interchange.problems import BrightfieldError

R = TypeVar("R")
Told = Callable[[str, float], None]

ROUNDS, MOVES = 3, 2
REGISTRATIONS, REFINEMENTS = 2, 4
MOST_RENDERED = 2  # causes of a hypothesis that are drawn where they stand: those that are furthest away
FAR = 1.0  # steps, from which on a difference of direct light may not be all
BESIDE = 0.1  # of what one thing leaves: a second that explains less, a step further, is none
RIVAL = 0.5  # of what the nearest explains: what explains less is no start
PLACES = 10  # to a step where the scene may stand, so that renderings are found again
SHORTEST = 0.2  # part of a step
FOLLOWED = ("chain", "flow", "scene", "reflected")  # kinds of terms that are drawn anew where they stand
REGISTERED_WITH = ("light_intensity", "albedo")  # what edges' heights depend on
RIGID = ("camera_pose", "principal_point", "object_pose")  # what moves without another shape
Passed = dict[frozenset[Cause], list[np.ndarray]]  # where hypotheses of these causes were linearised


class Search:
    """The same captures and terms at every stand."""

    def __init__(
        self,
        conditions: Sequence[Condition],
        terms: tuple[Term, ...],
        knots: Knots | None,
        told: Told,
        shares: Shares | None = None,
    ) -> None:
        """``shares``: which tolerance each term's spike comes from; without them all are as declared."""
        self.conditions, self.terms, self.knots, self.told = conditions, terms, knots, told
        self.stride = stride_for(conditions)
        self.q = len(terms)
        self.widths = Widths(shares)
        self.registering = {
            i for i, t in enumerate(terms) if t.kind == "flow" or t.cause in (NUISANCE, *REGISTERED_WITH)
        }

    def _each(
        self, work: Callable[[Condition], R], done: Callable[[float], None] = lambda share: None
    ) -> list[R]:
        return each(work, self.conditions, done, shared=lambda c: id(c.shown))

    def elsewhere(self, conditions: Sequence[Condition]) -> "Search":
        """The same search, tolerances included, of the same captures with other renderings."""
        there = Search(conditions, self.terms, self.knots, self.told)
        there.widths = self.widths
        return there

    def scaled(self, stand: Stand) -> Stand:
        """The same with tolerances as large as the captures say that they are."""
        evidence, hypotheses = self.widths.judged(stand.evidence, stand.hypotheses)
        return replace(stand, evidence=evidence, hypotheses=hypotheses)

    def averaged(self, stand: Stand) -> Stand:
        """The same with hypotheses by all that tolerances may be besides what they look."""
        return replace(stand, hypotheses=self.widths.averaged(stand.evidence, stand.hypotheses))

    def model(self, theta: np.ndarray, at: np.ndarray) -> Model:
        return Model(self.terms, theta, at, self.knots)

    def registered(self) -> np.ndarray:
        """(q,): where the terms that move the image stand, with no cause at all (but light that the renderer does not
        draw, if any): edges that are off by a part of a pixel would forge every effect that changes edges."""
        at = np.zeros(self.q)
        undrawn = {i for i, t in enumerate(self.terms) if t.kind == "reflected"}
        own = sorted(self.registering | undrawn)
        terms = [self.terms[i] for i in own]
        for k in range(REGISTRATIONS):
            parts, _ = self.linearised(self.model(at, at), terms, at[own])
            if not parts:
                break
            there = Evidence(total_of(parts), terms, spikes=self.widths.of(own))
            added = {self.terms[i].candidate for i in undrawn} & set(there.members)
            theta = there.theta(there.best(added, {}))
            at = np.zeros(self.q)
            for i, x in zip(own, theta, strict=True):
                at[i] = x if self.terms[i].kind == "flow" else 0.0
            self.told("registration", (k + 1) / REGISTRATIONS)
        return at

    def linearised(
        self,
        model: Model,
        terms: Sequence[Term],
        at: np.ndarray,
        kept: dict[str, Sensitivities] | None = None,
        anew: Collection[int] = (),
    ) -> tuple[list[NormalEquations], dict[str, Sensitivities]]:
        """Of some of the terms, which stand ``at``, and their sensitivities, by the condition's name."""

        def of(condition: Condition) -> tuple[NormalEquations, Sensitivities] | None:
            state = model.state(condition, self.stride)
            if not state.usable.any():
                return None
            drawn = sensitivities(state, terms, (kept or {}).get(condition.name), anew)
            return equations(state, terms, at, drawn=drawn), drawn

        found = {c.name: x for c, x in zip(self.conditions, self._each(of), strict=True) if x}
        return [parts for parts, _ in found.values()], {name: drawn for name, (_, drawn) in found.items()}

    def has_no_name(self, h: Hypothesis) -> bool:
        """Whether something of a hypothesis has none."""
        return any(t.generic for t in self.terms if t.candidate in h.causes)

    def may_move(self, best: Hypothesis) -> bool:
        """Whether it has what changes edges, or what has no name: things that stand elsewhere look like that."""
        return any(t.generic or t.kind in ("flow", "scene") for t in self.terms if t.candidate in best.causes)

    def moves(self, first: Stand) -> list[Start]:
        """The causes that let something stand elsewhere, alone, the ``MOVES`` that come nearest to the captures.
        Registration without its cause hides each of them behind all the others."""
        found = approaches(self, self._moving(first))[:MOVES]
        nearest = [a for a in found if a.gain > RIVAL * found[0].gain]
        return [Start(first.evidence.best((a.cause,), {}), a.at) for a in nearest]

    def beside(self, first: Stand, one: Start, stand: Stand) -> Start | None:
        """Two things that stand elsewhere, as neither alone comes near to where it is: where ``stand``, which ``one``
        led to, has another with a name beside it; or something without one, and another explains much of that."""
        (cause,) = one.hypothesis.causes
        rigid = {c: i for c, i in self._moving(first).items() if c[0] in RIGID}
        named = {c: i for c, i in rigid.items() if c in stand.best.causes}
        if cause in named and len(named) > 1:
            rigid, least = named, 0.0
        elif cause in rigid and self.has_no_name(stand.best):
            least = BESIDE
        else:
            return None
        found = approached_beside(self, rigid, Approach(cause, one.at, 0.0), least)
        return None if found is None else Start(first.evidence.best((cause, found.cause), {}), found.at)

    def _moving(self, stand: Stand) -> dict[Cause, np.ndarray]:
        return {c: i for c, i in stand.evidence.members.items() if self.moving(i)}

    def starts(self, first: Stand) -> list[Start]:
        """The best one, pair and single, whose forms have not been in doubt yet; and the best without what the best
        has."""
        hypotheses = first.hypotheses
        found = [hypotheses[0]]
        for size in (2, 1):
            found += [h for h in hypotheses if len(h.causes) == size and h not in found][:1]
        taken = set(hypotheses[0].causes)
        found += [h for h in hypotheses if h.causes and not taken & set(h.causes) and h not in found][:1]
        return [Start(h, self._beginning(h, first)) for h in found]

    def alone(self, first: Stand) -> Start | None:
        """The best single cause that has a name."""
        generic = {t.candidate for t in self.terms if t.generic}
        single = (h for h in first.hypotheses if len(h.causes) == 1 and h.causes[0] not in generic)
        h = next(single, None)
        return None if h is None else Start(h, self._beginning(h, first))

    def moving(self, index: np.ndarray) -> bool:
        """Whether terms let something stand elsewhere."""
        return any(self.terms[i].kind in ("flow", "scene") for i in index)

    def start_of(self, h: Hypothesis, stand: Stand) -> np.ndarray:
        """Where a hypothesis is followed from at a stand."""
        members = {c: stand.evidence.members[c] for c in h.causes}
        return self.start(members, stand.evidence.theta(h))

    def _beginning(self, h: Hypothesis, first: Stand) -> np.ndarray:
        """What moves is looked for from the scene as written, as registration without it has moved another thing."""
        members = {c: first.evidence.members[c] for c in h.causes}
        if any(self.moving(index) for index in members.values()):
            return np.zeros(self.q)
        return self.start_of(h, first)

    def gone_on(self, stand: Stand, what: str, known: Sequence[Stand] = ()) -> Stand:
        """The best hypothesis of a stand, followed from where it stands."""
        return self.followed(stand, Start(stand.best, self.start_of(stand.best, stand)), what, known)

    def followed(
        self,
        first: Stand,
        start: Start,
        what: str,
        known: Sequence[Stand] = (),
        rounds: int = ROUNDS,
        passed: Passed | None = None,
    ) -> Stand:
        """Linearised where the hypothesis stands, until the best one there is the one that it was linearised at, or one
        of ``known`` stands there already, and better; or it comes round to where it has been, or to where another was
        that ``passed`` knows, which is given by the last stand of its own. ``passed`` is told where it was linearised.
        """
        stand, best, at = first, start.hypothesis, start.at
        theta = stand.evidence.theta(best)[: self.q]
        kept = dict(first.kept)
        passed = {} if passed is None else passed
        own: Stand | None = None
        for k in range(rounds):
            members = {c: stand.evidence.members[c] for c in best.causes}
            been = passed.setdefault(frozenset(best.causes), [])
            if k and any(not moved(members, at, x, stand.evidence.e.G, stand.evidence.spike) for x in been):
                return stand if own is None else own
            been.append(at)
            theta, at, _ = self.refined(best.causes, members, theta, at, kept)
            changes = {c: self.change(self.model(theta, at), index) for c, index in members.items()}
            before = best
            stand = self.stand(at, changes, what, kept).with_no_more_than(before.causes)
            kept = stand.kept
            best = stand.best
            theta = stand.evidence.theta(best)[: self.q]
            at = self.start_of(best, stand)
            settled = not moved(members, at, stand.at, stand.evidence.e.G, stand.evidence.spike)
            if best.causes == before.causes and settled:
                break
            if any(k.best.causes == best.causes and k.best.score > stand.best.score for k in known):
                break
            own = stand if stand.is_its_own else own
        return stand

    def refined(
        self,
        causes: tuple[Cause, ...],
        members: dict[Cause, np.ndarray],
        theta: np.ndarray,
        at: np.ndarray,
        kept: dict[str, Sensitivities],
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """``theta`` and ``at`` of a hypothesis alone, followed from ``at`` to where it stands (Gauss, Newton), and its
        score there."""
        bent = {i for index in members.values() for i in index if self.terms[i].kind in FOLLOWED}
        if not bent:
            return theta, at, -np.inf
        own = np.array(
            [i for i, t in enumerate(self.terms) if t.candidate in members or i in self.registering]
        )
        place = {int(i): k for k, i in enumerate(own)}
        terms = [self.terms[i] for i in own]
        redrawn = {place[i] for i in place if i in bent or self.terms[i].kind == "flow"}
        near = {name: s.of(own) for name, s in kept.items()}
        best, step, aim = -np.inf, 1.0, at
        here, local = at, {c: np.array([place[int(i)] for i in index]) for c, index in members.items()}
        for _ in range(REFINEMENTS):
            parts, near = self.linearised(self.model(at, at), terms, at[own], near, redrawn)
            there = Evidence(total_of(parts), terms, spikes=self.widths.of(own))
            found = there.best(causes, {}) if set(causes) <= set(there.members) else None
            wavers = WAVERS * (found.score - there.best((), {}).score) if found else 0.0
            if found is None or found.score < best - wavers:  # too far: half the way from where it was better
                step /= 2
                if step < SHORTEST:
                    break
                at = here + step * (aim - here)
                continue
            best, step, here = found.score, 1.0, at
            before, theta = theta, np.zeros(self.q)
            theta[own] = there.theta(found)
            at = aim = self.start(members, theta)
            if not moved(local, theta[own], before[own], there.e.G, there.spike):
                break
        return theta, here, best

    def start(self, members: dict[Cause, np.ndarray], theta: np.ndarray) -> np.ndarray:
        """Where the next linearisation stands: all that moves the image, and the terms of the causes that the chain or
        a rendering can follow, as found."""
        at = np.array([x if t.kind == "flow" else 0.0 for t, x in zip(self.terms, theta, strict=False)])
        rendered = []
        for index in members.values():
            for i in index:
                if self.terms[i].kind in ("chain", "reflected"):
                    at[i] = max(theta[i], self.terms[i].low)
            at = straight(self.terms, at)
            scene = [i for i in index if self.terms[i].kind == "scene"]
            away = max((abs(theta[i]) / self.terms[i].step for i in scene), default=0.0)
            if any(abs(theta[i]) > self.terms[i].stands_at * self.terms[i].step for i in scene):
                rendered.append((away, scene))
        for _, scene in sorted(rendered, key=lambda x: -x[0])[:MOST_RENDERED]:
            there = at.copy()
            for i in scene:
                fine = self.terms[i].step / PLACES
                there[i] = max(fine * round(theta[i] / fine), self.terms[i].low)
            if self._can_stand(there):
                at = there
        return at

    def far(self, stand: Stand) -> Changes:
        """What is in force in the scene at a stand and no longer small, if the stand has something beside it: that may
        be what light does between surfaces; what stands soon is that alone, too."""
        beside = len(stand.best.causes) > 1
        moved = {
            t.candidate
            for t, x in zip(self.terms, stand.at, strict=False)
            if t.kind == "scene" and (beside or t.stands_at < FAR) and abs(x) > min(FAR, t.stands_at) * t.step
        }
        scene = self.model(stand.at, stand.at).scene
        return tuple((e, target) for e, target in scene if (e.name(), target) in moved)

    def within(self, at: np.ndarray, index: np.ndarray) -> np.ndarray:
        """``at`` with the terms ``index`` at what they may be at least."""
        there = at.copy()
        there[index] = np.maximum(at[index], [self.terms[i].low for i in index])
        return there

    def can_stand(self, at: np.ndarray) -> None:
        """Raises BrightfieldError where the scene cannot be so."""
        for shown in {id(c.shown): c.shown for c in self.conditions}.values():
            changed(shown.scene, self.model(at, at).scene)

    def _can_stand(self, at: np.ndarray) -> bool:
        try:
            self.can_stand(at)
        except BrightfieldError:
            return False
        return True

    def change(self, model: Model, index: np.ndarray) -> Change:
        """What a cause changes in each condition."""
        found = self._each(lambda c: changed_in(c, model, index, self.stride))
        return {c.name: change for c, change in zip(self.conditions, found, strict=True)}

    def _anew(self, changes: Collection[Cause]) -> set[int]:
        """The terms whose sensitivities are drawn where ``changes`` are in force: theirs; and of what moves the image
        all, if that is among them, as what moves it alike differs by less than edges do from 0.1 px away."""
        anew = {i for i, t in enumerate(self.terms) if t.candidate in changes and t.kind in FOLLOWED}
        if any(self.terms[i].kind == "flow" for i in anew):
            anew |= {i for i, t in enumerate(self.terms) if t.kind == "flow"}
        return anew

    def stand(
        self,
        at: np.ndarray,
        changes: dict[Cause, Change],
        what: str,
        kept: dict[str, Sensitivities],
    ) -> Stand:
        """``changes``: of each cause that is in force at ``at``; ``kept``: sensitivities that a stand before had."""
        free = {t.candidate for t in self.terms if t.family is not None}  # of any form
        cameras = list(dict.fromkeys(c.camera.name for c in self.conditions))
        exposures = [c.camera.t_exp for c in self.conditions]
        doubted = {c: change for c, change in changes.items() if c not in free}
        forms = form_terms(doubted, cameras, exposures)
        every = [*self.terms, *forms]
        at_all = np.append(at, np.zeros(len(forms)))
        model = self.model(at, at)
        anew = self._anew(changes)

        def of(condition: Condition) -> tuple[NormalEquations, Sensitivities] | None:
            state = model.state(condition, self.stride, symmetric=True)
            if not state.usable.any():
                return None
            drawn = sensitivities(state, self.terms, kept.get(condition.name), anew)
            own = doubt(list(changes.values()), state)
            bends = [change[condition.name].bend for change in changes.values()]
            straight = np.zeros_like(state.signal)
            found = equations(
                state,
                every,
                at_all,
                own,
                drawn.and_also(state, forms),
                [straight if b is None else b for b in bends],
            )
            return found, drawn

        told = self._each(of, lambda share: self.told(what, share))
        found = {c.name: x for c, x in zip(self.conditions, told, strict=True) if x is not None}
        parts = tuple(equations for equations, _ in found.values())
        now = {name: drawn for name, (_, drawn) in found.items()}
        if not parts:
            raise BrightfieldError(
                "No pixel of the captures can be compared: all are masked, saturated or cut off at DN 0."
            )
        evidence = Evidence(total_of(parts), every, tuple(changes), self.widths.spikes)
        self.widths.first(evidence.spike[: self.q])
        return Stand(tuple(every), at, evidence, parts, tuple(best_first(evidence)), now)

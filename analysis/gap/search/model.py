"""A simulation with corrections: where the chain, the image and the scene stand, and what is added to them."""

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np

from analysis.gap.compared import lens_flow
from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.light.knots import Knots
from analysis.gap.light.radiance import Changes, Rendered
from analysis.gap.parallel import each, own_property
from analysis.gap.terms.base import Term, added
from analysis.gap.terms.chain import effects_at
from interchange.effects import MODELS, Effect

MOST = 200e6  # bytes of motions that are kept, each of a term in a rendering


def _unit_flow(state: State, term: Term) -> np.ndarray | None:
    """(H, W, 2) float32 px that a unit of a term moves the image by, as the scene is written."""
    shown = state.condition.shown
    key = (id(shown), id(term))
    with _keeping:
        if key in _units:
            _units.move_to_end(key)
            return _units[key][2]
    found = term.moved(state)
    unit = None if found is None else np.stack(found, axis=-1).astype(np.float32)
    with _keeping:
        _units[key] = shown, term, unit
        while sum(u.nbytes for *_, u in _units.values() if u is not None) > MOST:
            _units.popitem(last=False)
    return unit


_units: OrderedDict[tuple[int, int], tuple[Rendered, Term, np.ndarray | None]] = OrderedDict()
_keeping = Lock()


@dataclass(frozen=True, eq=False)
class Model:
    """``theta`` (q,) of ``terms``, around ``at`` (q,), where chain, flow and scene stand. ``knots`` renders what the
    scene changes; without it no term of the scene may stand elsewhere than at zero. ``beside``: another whose numbers
    are the same but for a few: what the others add is told once, there, as how it changes with those few is a product
    of two small numbers."""

    terms: tuple[Term, ...]
    theta: np.ndarray
    at: np.ndarray
    knots: Knots | None = None
    beside: "Model | None" = None

    def state(self, condition: Condition, stride: int = 1, symmetric: bool = False) -> State:
        seen = self.seen(condition)
        return State(
            seen,
            self.effects(condition),
            self.flow(seen),
            stride,
            symmetric,
            self.scene,
            self.knots,
            self.reflected,
        )

    def effects(self, condition: Condition) -> list[Effect]:
        values = {t.key: float(x) for t, x in zip(self.terms, self.at, strict=True)}
        return effects_at(self.terms, values, State(condition))

    @own_property
    def scene(self) -> Changes:
        """The effects of the scene that are not at zero, each with what it is about."""
        values: dict[tuple[str, str], dict[str, float]] = {}
        for term, x in zip(self.terms, self.at, strict=True):
            if term.kind == "scene" and x:
                values.setdefault(term.candidate, {})[term.parameter] = term.value(float(x))
        return tuple((MODELS[cause](**given), target) for (cause, target), given in values.items())

    @property
    def reflected(self) -> float:
        """Of the light that the renderer does not draw."""
        return sum(float(x) for t, x in zip(self.terms, self.at, strict=True) if t.kind == "reflected")

    def seen(self, condition: Condition) -> Condition:
        """The condition from where its camera stands, as far as it was rendered from near there."""
        moved = condition.shown.moved
        if moved is None:
            return condition
        both = [
            (float(x) / t.spike, moved.pose[t.key] / t.spike)
            for t, x in zip(self.terms, self.at, strict=True)
            if t.key in moved.pose
        ]
        nearer = 2 * sum(x * p for x, p in both) > sum(p * p for _, p in both)
        return condition.moved if nearer else condition

    def flow(self, condition: Condition) -> np.ndarray | None:
        """(H, W, 2) px that the image moves by, from what was rendered; conditions that share a rendering share it."""
        rendered = condition.shown.pose
        moving = [
            (t, x - rendered.get(t.key, 0.0))
            for t, x in zip(self.terms, self.at, strict=True)
            if t.kind == "flow"
        ]
        moving = [(t, x) for t, x in moving if x]
        if not moving:
            return None
        key = id(condition.shown)
        if key not in self._flows:
            self._flows[key] = condition.shown, self._flow(State(condition), moving)
        return self._flows[key][1]

    @own_property
    def _flows(self) -> dict[int, tuple[Rendered, np.ndarray]]:
        return {}

    def _flow(self, state: State, moving: Sequence[tuple[Term, float]]) -> np.ndarray:
        total = np.zeros((*state.condition.mean.shape[:2], 2), np.float32)
        for term, x in moving:
            unit = None if term.cause == lens_flow.CAUSE else _unit_flow(state, term)
            if unit is not None:
                total += np.float32(x) * unit
        lens = self.lens(state.condition)
        return total + lens_flow.flow(state.camera, lens) if any(lens) else total

    def lens(self, condition: Condition) -> tuple[float, ...]:
        """What a condition's lens has more of ``lens_flow.NUMBERS``, where the model stands."""
        more = dict.fromkeys(lens_flow.NUMBERS, 0.0)
        if not lens_flow.has_numbers(condition.camera):
            return tuple(more.values())
        for term, x in zip(self.terms, self.at, strict=True):
            if term.cause == lens_flow.CAUSE and term.camera in ("", condition.camera.name):
                more[term.parameter] += float(x)
        return tuple(more.values())

    def simulated(self, condition: Condition) -> np.ndarray:
        """(H, W, C): expected DN of a condition with every correction; the same array whenever it is asked for."""
        if id(condition) not in self._simulated:
            state = self.state(condition)
            more = self._of_beside(state)
            if more is None:
                more = added(state, self.terms, self.theta - self.at)
            self._simulated[id(condition)] = condition, state.simulation.dn + more
        return self._simulated[id(condition)][1]

    def _of_beside(self, state: State) -> np.ndarray | None:
        """(H, W, C): what is added to ``state``, where the one beside says it."""
        other = self.beside
        if other is None:
            return None
        index = np.flatnonzero((self.theta != other.theta) | (self.at != other.at))
        own = [self.terms[i] for i in index]
        if any(t.kind in ("flow", "scene") for t in own):  # edges are elsewhere
            return None
        there = other.state(state.condition)
        all_of_it = other.simulated(state.condition) - there.simulation.dn
        without = all_of_it - added(there, own, (other.theta - other.at)[index])
        return np.asarray(without + added(state, own, (self.theta - self.at)[index]))

    def simulations(self, conditions: Iterable[Condition]) -> list[np.ndarray]:
        """The same of each."""
        return each(self.simulated, conditions, shared=lambda c: id(c.shown))

    @own_property
    def _simulated(self) -> dict[int, tuple[Condition, np.ndarray]]:
        return {}

    def without(self, index: np.ndarray) -> "Model":
        theta, at = self.theta.copy(), self.at.copy()
        theta[index], at[index] = 0.0, 0.0
        return replace(self, theta=theta, at=at)

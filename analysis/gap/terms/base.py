"""What may be wrong, linearised: each term is one number and the DN that a unit of it adds to every pixel.

Every term is always in the model, at the width that calibration leaves it (``spike``); a cause is a set of terms
that may be wide.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from analysis.gap.compared.state import State
from interchange.effects import MODELS
from interchange.parameter import parameters

NUISANCE = "calibration"  # terms of this cause are never wide
FORM = "form"  # nor these: how an effect may differ from its formula
LOBES = ("gloss", "anisotropy")  # effects that change them

Cause = tuple[str, str]  # an effect or a family, and what it is of
Field = Callable[[State], np.ndarray | None]
Flow = Callable[[State], tuple[np.ndarray, np.ndarray] | None]
Cells = Callable[[State], tuple[np.ndarray, np.ndarray, np.ndarray] | None]


@dataclass(frozen=True, eq=False)
class Family:
    """Many terms at once, each with pixels of its own: ``cells(state)`` gives the numbers (h, w, m) of the terms that a
    pixel belongs to, -1 for none, to what share (h, w, m), and what a unit of them adds there, (h, w, C) DN; None where
    a condition shows none."""

    cells: Cells
    places: tuple[str, ...]  # what each term is called


@dataclass(frozen=True, eq=False)
class Term:
    """``cause``: an effect's name of the file contract, or a generic family's; ``target``: the lamp, material or
    camera it is about. ``field(state)`` (h, w, C) DN per unit, or None where the condition does not show it.

    ``spike``: standard deviation that is expected anyway, in the term's unit, or where ``relative`` as the rms that
    it gives to the images that show it, over their signal. ``power``: the parameter is the term to the power
    1 / ``power``. ``part``: rms over the signal that it has of its cause, over that of the cause's first number, where
    the cause is there. ``low``: the least value the term may have; a hypothesis that would have it lower does not
    count, but where it is ``held``, which lets it stand there. ``kind``: "chain" (an effect in
    ``interchange.effects``), "flow" (moves the image), "scene" (an effect that is rendered; up to ``step`` it counts as
    linear), "reflected" (light that the renderer does not draw), "linear", or "cell" (number ``cell`` of ``family``,
    which has no ``field``).
    """

    cause: str
    target: str
    parameter: str
    unit: str
    spike: float
    field: Field
    relative: bool = False
    power: int = 1
    low: float = -np.inf
    held: bool = False
    kind: str = "linear"
    generic: bool = False
    start: float = 0.0  # the parameter's value where the term is 0
    flow: Flow | None = None  # px (columns, rows) that a unit moves the image by, where ``kind`` is "flow"
    t_exp: float = (
        0.0  # s: the exposure that the parameter is told at, where it grows with it; 0 where it does not
    )
    step: float = 0.0
    stands_at: float = 1.0  # steps from home, from which on it is drawn where it is
    family: Family | None = None
    cell: int = 0
    part: float = 1.0
    ways: int = 1  # that a cause like this was chosen among, before the evidence saw it
    form: bool = False  # of an effect that has other causes too: no hypothesis has one of those beside it
    against: tuple[str, ...] = ()  # causes that no hypothesis has beside its own: they undo it
    camera: str = ""  # which alone shows it; all, where it is empty
    pattern: bool = False  # part of one that has no formula, so that its number is no parameter of its effect
    adds_to: tuple[str, ...] = ()  # parameters of its cause that it is a part of, and none of its own
    usual: float = 1.0  # how many times as usual its cause is as others of the same effect
    sized_by: str = (
        ""  # parameter of its cause, in the same unit, that widths are told by; its own, where it is empty
    )

    @property
    def is_a_parameter(self) -> bool:
        return self.family is None and not self.pattern and not self.adds_to

    @property
    def key(self) -> tuple[str, str, str]:
        return self.cause, self.target, self.parameter

    @property
    def candidate(self) -> Cause:
        return self.cause, self.target

    def shown(self, state: State) -> bool:
        return self.camera in ("", state.camera.name)

    def column(self, state: State) -> np.ndarray | None:
        """(h, w, C) DN per unit, or None where the condition does not show it."""
        return self.field(state) if self.shown(state) else None

    def moved(self, state: State) -> tuple[np.ndarray, np.ndarray] | None:
        """px (columns, rows) that a unit moves the image by, where it does."""
        return self.flow(state) if self.flow is not None and self.shown(state) else None

    def grown(self, state: State) -> float:
        """The parameter at a condition's exposure, over that at ``t_exp``."""
        return state.camera.t_exp / self.t_exp if self.t_exp else 1.0

    def value(self, theta: float) -> float:
        """The parameter at ``theta`` of the term, within what it may be."""
        theta = max(theta, self.low)
        value = self.start + (max(theta, 0.0) ** (1 / self.power) if self.power > 1 else theta)
        low, high = _limits(self.cause, self.parameter)
        return min(max(value, low), high)


@cache
def _limits(cause: str, parameter: str) -> tuple[float, float]:
    """Of an effect's parameter, as it declares them; of what is no parameter, none."""
    about = parameters(MODELS[cause]) if cause in MODELS else {}
    return (about[parameter].low, about[parameter].high) if parameter in about else (-np.inf, np.inf)


def together(terms: Sequence[Term], i: int) -> list[int]:
    """The terms that the parameter of term ``i`` is the sum of."""
    own = terms[i]
    return [
        i,
        *(k for k, t in enumerate(terms) if t.candidate == own.candidate and own.parameter in t.adds_to),
    ]


def moving(cause: str, target: str, parameter: str, unit: str, spike: float, flow: Flow) -> Term:
    """A term that moves the image by ``flow`` px a unit."""

    def field(state: State) -> np.ndarray | None:
        found = flow(state)
        return None if found is None else state.shifted(*found)

    return Term(cause, target, parameter, unit, spike, field, kind="flow", flow=flow)


def _nothing(state: State) -> None:
    return None


def in_cells(cause: str, target: str, spike: float, family: Family, generic: bool = True) -> list[Term]:
    """The terms of a family, ``generic`` if its cause has no name; ``spike``: rms that all of them together give anyway
    to the images that show them, over their signal."""
    return [
        Term(
            cause,
            target,
            place,
            "1",
            spike,
            _nothing,
            True,
            kind="cell",
            generic=generic,
            family=family,
            cell=k,
        )
        for k, place in enumerate(family.places)
    ]


def families(terms: Sequence[Term]) -> list[tuple[Family, np.ndarray]]:
    """Each family among ``terms`` and the indices of its terms."""
    found: dict[int, tuple[Family, list[int]]] = {}
    for i, term in enumerate(terms):
        if term.family is not None:
            found.setdefault(id(term.family), (term.family, []))[1].append(i)
    return [(family, np.array(index)) for family, index in found.values()]


def added(state: State, terms: Sequence[Term], theta: np.ndarray) -> np.ndarray:
    """(h, w, C) float32: what ``theta`` (q,) of ``terms`` add to the image."""
    total = np.zeros(state.signal.shape, np.float32)  # sums of some hundreds: 1e-4 DN
    motion: list[np.ndarray] = []  # what moves the image moves it together, which is drawn once
    for term, x in zip(terms, theta, strict=True):
        if x and term.flow is not None:
            flow = term.moved(state)
            if flow is not None:
                motion.append(x * np.stack(flow))
        elif x and term.family is None:
            column = term.column(state)
            if column is not None:
                total += np.float32(x) * column
    if motion:
        total += state.shifted(*np.sum(motion, axis=0))
    for family, index in families(terms):
        if theta[index].any():
            found = family.cells(state)
            if found is not None:
                ids, share, unit = found
                height = np.zeros(len(family.places) + 1, np.float32)  # the last stands for no place
                height[[terms[i].cell for i in index]] = theta[index]
                total += (height[ids] * share).sum(axis=-1)[..., None] * unit
    return total

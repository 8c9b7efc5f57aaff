"""What may be wrong, linearised: each term is one number and the DN that a unit of it adds to every pixel.

Every term is always in the model, at the width that calibration leaves it (``spike``); a cause is a set of terms
that may be wide.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.gap.state import State

Field = Callable[[State], np.ndarray | None]
Flow = Callable[[State], tuple[np.ndarray, np.ndarray] | None]


@dataclass(frozen=True, eq=False)
class Term:
    """``cause``: an effect's name of the file contract, or a generic family's; ``target``: the lamp, material or
    camera it is about. ``field(state)`` (h, w, C) DN per unit, or None where the condition does not show it.

    ``spike``: standard deviation that is expected anyway, in the term's unit, or where ``relative`` as the rms that
    it gives to the image, over the signal. ``power``: the parameter is the term to the power 1 / ``power``.
    ``low``: the least value the term may have. ``kind``: "chain" (an effect in ``interchange.effects``), "flow" (moves
    the image) or "linear".
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
    kind: str = "linear"
    generic: bool = False
    start: float = 0.0  # the parameter's value where the term is 0
    flow: Flow | None = None  # px (columns, rows) that a unit moves the image by, where ``kind`` is "flow"

    @property
    def key(self) -> tuple[str, str, str]:
        return self.cause, self.target, self.parameter

    @property
    def candidate(self) -> tuple[str, str]:
        return self.cause, self.target

    def value(self, theta: float) -> float:
        """The parameter at ``theta`` of the term."""
        return self.start + (max(theta, 0.0) ** (1 / self.power) if self.power > 1 else theta)


def moving(cause: str, target: str, parameter: str, unit: str, spike: float, flow: Flow) -> Term:
    """A term that moves the image by ``flow`` px a unit."""

    def field(state: State) -> np.ndarray | None:
        found = flow(state)
        return None if found is None else state.shifted(*found)

    return Term(cause, target, parameter, unit, spike, field, kind="flow", flow=flow)

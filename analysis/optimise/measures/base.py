"""What a measure of a set-up is: declared parameters, a unit, a direction, and one function of a view."""

from dataclasses import dataclass
from typing import ClassVar

from analysis.optimise.view import View
from interchange.parameter import freeze


@dataclass(frozen=True)
class Measure:
    """``best``: "high" or "low"; ``worst``: what a set-up has that does not show what is judged; ``log``: values spread
    over magnitudes and are compared by their logarithms."""

    best: ClassVar[str]
    unit: ClassVar[str]
    worst: ClassVar[float]
    meaning: ClassVar[str]
    source: ClassVar[str] = ""
    log: ClassVar[bool] = False

    def __post_init__(self) -> None:
        freeze(self)

    def of(self, view: View) -> float:
        """Raises Unseen where there is nothing to be judged by."""
        raise NotImplementedError

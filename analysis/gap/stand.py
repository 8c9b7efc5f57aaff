"""The evidence where a hypothesis stands, and where one is followed from."""

from dataclasses import dataclass

import numpy as np

from analysis.gap.evidence import Evidence, Hypothesis
from analysis.gap.normal_equations import NormalEquations
from analysis.gap.sensitivities import Sensitivities
from analysis.gap.terms import Term


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

    @property
    def is_its_own(self) -> bool:
        """Whether the best hypothesis has the causes whose forms are in doubt here: one without them has their doubt
        for nothing, and its log Z is not to be compared with another stand's."""
        return set(self.evidence.in_force) <= set(self.best.causes)


@dataclass(frozen=True, eq=False)
class Start:
    """A hypothesis and where (q,) it is followed from."""

    hypothesis: Hypothesis
    at: np.ndarray

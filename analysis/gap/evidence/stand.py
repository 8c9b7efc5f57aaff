"""The evidence where a hypothesis stands, and where one is followed from."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.gap.evidence.likelihood import TAU, Evidence, Hypothesis
from analysis.gap.terms.base import Cause, Term
from analysis.gap.terms.normal_equations import NormalEquations
from analysis.gap.terms.sensitivities import Sensitivities

WAVERS = 0.002  # of what a hypothesis gains: as much comes of weights that are another place's


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

    def with_no_more_than(self, causes: Sequence[Cause]) -> "Stand":
        """The same where ``causes`` are the best, if what is ahead of them has more beside them and gains hardly more:
        by less than what its gain wavers by from place to place no cause is known to be there, and as strong as the
        others are it would be called in doubt (analysis.gap.evidence.belief)."""
        score = {frozenset(h.causes): h.score for h in self.hypotheses}
        own, wavers = score.get(frozenset(causes)), WAVERS * (self.best.score - score[frozenset()])
        if own is None or not set(causes) < set(self.best.causes) or self.best.score - own > wavers:
            return self
        level = [replace(h, log_Z=h.log_Z - max(h.score - own, 0.0) * TAU) for h in self.hypotheses]
        first = frozenset(causes)
        return replace(
            self, hypotheses=tuple(sorted(level, key=lambda h: (-h.score, set(h.causes) != first)))
        )


@dataclass(frozen=True, eq=False)
class Start:
    """A hypothesis and where (q,) it is followed from."""

    hypothesis: Hypothesis
    at: np.ndarray

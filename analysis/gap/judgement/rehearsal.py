"""How far probabilities are to be believed, by cases that were simulated from the user's own scene.

Of what was said of all of them one number is taken, the temperature T, by which log odds are too sure:

    p' = 1 / (1 + exp(-logit(p) / T)),     T >= 1,  ln T half normally distributed a priori, with ``SPREAD``

These cases have no errors of other kinds than the model's: T is no less than what cases of another engine asked for
(analysis.gap.evidence.sureness).

Guo et al.: On calibration of modern neural networks. ICML 2017.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.gap.evidence.sureness import inside

SPREAD = 0.5  # of ln T


@dataclass(frozen=True)
class Rehearsed:
    """``truth``: the effect that is there, "" for none; ``severity``: its rms over the signal; ``said`` {effect:
    probability}; ``exact``: whether that effect was called, and nothing else."""

    truth: str
    severity: float
    said: dict[str, float]
    exact: bool


@dataclass(frozen=True)
class Rehearsal:
    cases: tuple[Rehearsed, ...]

    @cached_property
    def temperature(self) -> float:
        """The likeliest T, to a hundredth of its logarithm."""
        told = [(p, name == c.truth) for c in self.cases for name, p in c.said.items()]
        log_T = np.linspace(0, 2, 201)
        score = -0.5 * (log_T / SPREAD) ** 2
        for p, there in told:
            logit = np.log(inside(p) / (1 - inside(p))) / np.exp(log_T)
            score -= np.logaddexp(0, -logit if there else logit)
        return float(np.exp(log_T[int(np.argmax(score))]))

    def counts(self, with_effect: bool) -> tuple[int, int]:
        """How many were answered exactly, of how many, of the cases with an effect or of those without."""
        of = [c for c in self.cases if bool(c.truth) == with_effect]
        return sum(c.exact for c in of), len(of)

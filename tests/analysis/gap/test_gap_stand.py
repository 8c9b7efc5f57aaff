"""What is ahead by no more than gains waver by from place to place is not followed, nor called."""

import numpy as np
import pytest

from analysis.gap.evidence.belief import posterior
from analysis.gap.evidence.likelihood import Evidence, Hypothesis
from analysis.gap.evidence.stand import WAVERS, Stand
from analysis.gap.finding import PRESENT
from analysis.gap.terms.base import Cause, Term
from analysis.gap.terms.normal_equations import NormalEquations

STRONG, WEAK, OTHER = ("vignetting", ""), ("defocus", "/Camera1"), ("exposure", "")
GAIN = 2000.0


def _stand(said: dict[tuple[Cause, ...], float]) -> Stand:
    terms = tuple(Term(*c, "x", "1", 0.01, lambda s: None) for c in (STRONG, WEAK, OTHER))
    e = NormalEquations(np.eye(3), np.zeros(3), 1.0, 100.0, np.full(3, 100.0))
    hypotheses = [Hypothesis(causes, (0.01,) * len(causes), x, 0.0) for causes, x in said.items()]
    best_first = tuple(sorted(hypotheses, key=lambda h: -h.score))
    return Stand(terms, np.zeros(3), Evidence(e, terms), (), best_first, {})


@pytest.mark.parametrize(("more", "best"), [(0.6, (STRONG,)), (2 * WAVERS * GAIN, (STRONG, WEAK))])
def test_what_gains_hardly_more_beside_a_strong_cause_is_left(more: float, best: tuple[Cause, ...]) -> None:
    """The bench sample's vignetting had a defocus of one camera beside it that gained 0.6 of 1973; where both were in
    force the vignetting alone was better by 6."""
    stand = _stand({(): 0.0, (STRONG,): GAIN, (STRONG, WEAK): GAIN + more, (OTHER,): 1.0})
    there = stand.with_no_more_than((STRONG,))
    assert there.best.causes == best
    assert (posterior(there.hypotheses)[WEAK] > PRESENT) is (best != (STRONG,))
    assert {h.causes: h.score for h in there.hypotheses}[(OTHER,)] == 1.0


def test_what_stands_in_a_cause_s_place_is_followed() -> None:
    """It has not the cause, and may be what is there."""
    stand = _stand({(): 0.0, (STRONG,): GAIN, (WEAK, OTHER): GAIN + 0.6})
    assert stand.with_no_more_than((STRONG,)) is stand


def test_a_weak_gain_over_none_is_followed_as_it_is() -> None:
    stand = _stand({(): 0.0, (STRONG,): 3.0, (STRONG, WEAK): 3.1})
    assert stand.with_no_more_than((STRONG,)) is stand

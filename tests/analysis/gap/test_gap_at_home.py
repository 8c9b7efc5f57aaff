"""What is followed because it gains a little is not surer for having been followed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.gap.evidence.likelihood import Evidence, Hypothesis
from analysis.gap.evidence.stand import Stand, Start
from analysis.gap.search.fit import behind_registration, no_surer_than_at_home
from analysis.gap.terms.base import Term
from analysis.gap.terms.normal_equations import NormalEquations

POSE, OTHER = ("object_pose", "/box"), ("exposure", "")


def _stand(gain: float) -> Stand:
    """A pose gains so much over none in log Z, and another cause 3 less."""
    terms = tuple(Term(*c, "x", "1", 0.01, lambda s: None) for c in (POSE, OTHER))
    e = NormalEquations(np.eye(2), np.zeros(2), 1.0, 100.0, np.full(2, 100.0))
    said = [((POSE,), gain), ((), 0.0), ((OTHER,), gain - 3)]
    hypotheses = [Hypothesis(causes, (0.01,) * len(causes), x, 0.0) for causes, x in said]
    best_first = tuple(sorted(hypotheses, key=lambda h: -h.score))
    return Stand(terms, np.zeros(2), Evidence(e, terms), (), best_first, {})


@pytest.mark.parametrize(
    ("home", "there", "left"),
    [
        (0.5, 3.0, 0.5),  # the less sure of both
        (
            -2.0,
            3.0,
            0.0,
        ),  # at home none is better: as probable as none, and no less, as it is better where it stands
        (4.0, 3.0, 3.0),
        (0.5, 50.0, 50.0),  # stands far from home, where its linearisation does not hold
    ],
)
def test_a_small_gain_is_the_less_sure_of_both(home: float, there: float, left: float) -> None:
    found = no_surer_than_at_home(_stand(home), _stand(there))
    score = {h.causes: h.score for h in found.hypotheses}
    assert score[POSE,] - score[()] == pytest.approx(left)
    assert score[POSE,] - score[OTHER,] == pytest.approx(3)
    assert list(score.values()) == sorted(score.values(), reverse=True)


def test_a_cause_that_home_did_not_list_is_weighed_there() -> None:
    first = _stand(0.5)
    bare = replace(first, hypotheses=tuple(h for h in first.hypotheses if not h.causes))
    own = first.evidence.best((POSE,), {}).score  # of captures that show nothing: less than none
    assert own < 0
    found = no_surer_than_at_home(bare, _stand(3.0))
    score = {h.causes: h.score for h in found.hypotheses}
    assert score[POSE,] == pytest.approx(score[()])


@pytest.mark.parametrize(
    ("registration", "gain", "own", "found"),
    [
        (4.5, 100.0, True, True),
        (1.5, 100.0, True, False),  # cameras are as far off as tolerances are guessed to be
        (4.5, 8.0, True, False),  # no more than what was hoped for without a move, three times
        (4.5, 100.0, False, False),  # has gone elsewhere
    ],
)
def test_what_moved_is_looked_for_where_cameras_look_further_off_than_declared(
    registration: float, gain: float, own: bool, found: bool
) -> None:
    """An opened blind case, 18f3818d: a workpiece that lay 0.4 mm too high was an error of registration, 4.5 times as
    large as declared, with a slight blur beside it."""
    first = _stand(3.0)
    there = SimpleNamespace(best=_stand(gain).best, is_its_own=own)
    search = SimpleNamespace(
        widths=SimpleNamespace(factors={"registration_px": registration}),
        moves=lambda stand: [Start(there.best, np.zeros(2))],
        followed=lambda *a: there,
        gone_on=lambda stand, what: stand,
    )
    assert behind_registration(search, first) is (there if found else None)

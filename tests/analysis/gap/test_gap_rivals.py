"""Of two causes that move one edge, the one that stands nearer is looked for beside the one that came first."""

from types import SimpleNamespace

import numpy as np
import pytest

from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.evidence.stand import Stand
from analysis.gap.search.rivals import beside_rivals, rivals
from analysis.gap.search.search import Search
from analysis.gap.terms.base import Term
from analysis.gap.terms.normal_equations import NormalEquations

POSE, HEIGHT, LAMP, GAIN = (
    ("object_pose", "/box"),
    ("geometry", "/box"),
    ("light_position", "/lamp"),
    ("exposure", ""),
)


def terms() -> tuple[Term, ...]:
    """The last is no motion, and explains all that there is."""
    return tuple(
        Term(*c, "x", "1", 0.01, lambda s: None, kind=kind, step=0.2)
        for c, kind in ((POSE, "scene"), (HEIGHT, "scene"), (LAMP, "scene"), (GAIN, "chain"))
    )


def standing(alike: float) -> tuple[Search, Stand]:
    """At 0.6 of the first term, where captures show as much; the second looks as ``alike`` to it."""
    signal = 1e6
    G = np.full((4, 4), 0.0)
    G[:2, :2] = [[1, alike], [alike, 1]]
    G[[2, 3], [2, 3]] = 1
    G[0, 3] = G[3, 0] = 0.95
    b = G @ np.array([0.6, 0.0, 0.0, 0.0]) * 1e4
    e = NormalEquations(1e4 * G, b, float(0.6 * b[0]) + 10, signal, np.full(4, signal), 0.0, 1e4)
    evidence = Evidence(e, terms())
    best = evidence.best((POSE,), {})
    stand = Stand(terms(), np.array([0.6, 0, 0, 0]), evidence, (), (best, evidence.best((), {})), {})
    search = Search.__new__(Search)
    search.terms, search.q = terms(), 4
    search._can_stand = lambda at: True
    return search, stand


@pytest.mark.parametrize("alike", [0.95, 0.8])
def test_what_explains_nearly_as_much_is_followed_from_where_it_does(alike: float) -> None:
    search, stand = standing(alike)
    (start,) = rivals(search, stand)  # neither the lamp, which explains nothing, nor what moves nothing
    assert start.hypothesis.causes == (HEIGHT,)
    assert start.at == pytest.approx([0, 0.6 * alike, 0, 0], abs=0.011)


def test_what_explains_much_less_is_no_rival() -> None:
    assert rivals(*standing(0.6)) == []  # 0.36 of it


@pytest.mark.parametrize(
    ("gain", "own", "chosen"), [(5.0, True, True), (5.0, False, False), (-5.0, True, False)]
)
def test_the_better_stand_is_kept(gain: float, own: bool, chosen: bool) -> None:
    search, stand = standing(0.95)
    score = stand.best.score + gain
    there = SimpleNamespace(best=SimpleNamespace(score=score), is_its_own=own)
    search.followed = lambda *a: there
    assert beside_rivals(search, stand) is (there if chosen else stand)

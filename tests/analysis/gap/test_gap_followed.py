"""Where a hypothesis is followed to, by stands that are made up."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.gap.evidence.stand import Start
from analysis.gap.search.search import Passed, Search
from analysis.gap.terms.moved import moved

A, B = ("vignetting", ""), ("defocus", "")


def hypothesis(*causes: tuple[str, str]) -> Any:
    return SimpleNamespace(causes=causes, score=0.0)


class Made(Search):
    """Linearised at a set of causes, the best is what ``leads`` says of it, and a number stands at the next of
    ``places``."""

    def __init__(self, leads: dict[frozenset[tuple[str, str]], Any], places: list[float]) -> None:
        self.leads, self.places, self.q, self.stood = leads, places, 1, []
        self.hardly_more = False  # what is ahead, than what was followed

    def refined(self, causes: Any, members: Any, theta: Any, at: Any, kept: Any) -> Any:
        return theta, at, 0.0

    def change(self, model: Any, index: Any) -> Any:
        return None

    def model(self, theta: Any, at: Any) -> Any:
        return None

    def start_of(self, h: Any, stand: Any) -> np.ndarray:
        return np.array([self.places[min(len(self.stood), len(self.places)) - 1]])

    def stand(self, at: np.ndarray, changes: Any, what: str, kept: Any) -> Any:
        self.stood.append(frozenset(changes))
        return self.found(self.leads[frozenset(changes)], frozenset(changes), at)

    def found(self, best: Any, in_force: frozenset[tuple[str, str]], at: np.ndarray) -> Any:
        members = {A: np.array([0]), B: np.array([0])}
        evidence = SimpleNamespace(
            members=members, theta=lambda h: np.zeros(1), spike=np.zeros(1), e=SimpleNamespace(G=np.eye(1))
        )
        own = in_force <= set(best.causes)
        stand = SimpleNamespace(best=best, evidence=evidence, at=at, kept={}, is_its_own=own)
        stand.with_no_more_than = lambda causes: (
            self.found(hypothesis(*causes), in_force, at) if self.hardly_more else stand
        )
        return stand


@pytest.mark.parametrize(("places", "stands"), [([1.0], 2), ([1.0, 2.0, 3.0], 3)])
def test_what_comes_round_ends_at_the_last_stand_of_its_own(places: list[float], stands: int) -> None:
    """At the one both are best, at both the one: a third stand at the same place says nothing new; where the number
    has gone on it does."""
    search = Made({frozenset({A}): hypothesis(A, B), frozenset({A, B}): hypothesis(A)}, places)
    first = search.found(hypothesis(A), frozenset(), np.array([1.0]))
    passed: Passed = {}
    there = search.followed(first, Start(hypothesis(A), np.array([1.0])), "fit", passed=passed)
    assert len(search.stood) == stands
    assert there.best.causes == (A, B)
    assert set(passed) == {frozenset({A}), frozenset({A, B})}


def test_what_comes_to_where_another_was_ends_there() -> None:
    """From another start it came to the same causes at the same place: that was followed already."""
    search = Made({frozenset({B}): hypothesis(A), frozenset({A}): hypothesis(A)}, [1.0])
    first = search.found(hypothesis(B), frozenset(), np.array([1.0]))
    passed: Passed = {frozenset({A}): [np.array([1.0])]}
    there = search.followed(first, Start(hypothesis(B), np.array([1.0])), "fit", passed=passed)
    assert search.stood == [frozenset({B})]
    assert not there.is_its_own


@pytest.mark.parametrize(("before", "gone"), [([1.0, 1.2], False), ([1.2, 1.2], True)])
def test_numbers_that_give_the_same_images_have_not_moved(before: list[float], gone: bool) -> None:
    """Both change the images alike: the sum counts, and one of them a fifth larger for another as much less is
    nothing."""
    G = np.array([[1.0, 0.999], [0.999, 1.0]])
    now = np.array([1.2, 1.0])
    assert moved({A: np.array([0, 1])}, now, np.array(before), G, np.zeros(2)) is gone


def test_what_stays_ends_where_it_is() -> None:
    search = Made({frozenset({A}): hypothesis(A)}, [1.0])
    first = search.found(hypothesis(A), frozenset(), np.array([1.0]))
    there = search.followed(first, Start(hypothesis(A), np.array([1.0])), "fit")
    assert search.stood == [frozenset({A})]
    assert there.best.causes == (A,)


def test_what_gains_hardly_more_is_not_followed() -> None:
    """At the one both are best, by hardly more: it ends at the one."""
    search = Made({frozenset({A}): hypothesis(A, B)}, [1.0])
    search.hardly_more = True
    first = search.found(hypothesis(A), frozenset(), np.array([1.0]))
    there = search.followed(first, Start(hypothesis(A), np.array([1.0])), "fit")
    assert search.stood == [frozenset({A})]
    assert there.best.causes == (A,)

"""Work on all cores comes to what it would come to on one, and what is drawn is drawn by who asked for it."""

import os
import threading
import time
from collections.abc import Callable

import pytest

from analysis.gap.parallel import by_asker, each, in_turns, own_property


@pytest.fixture(params=[1, 2, 16])
def cores(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(request.param)))
    return request.param


def test_answers_are_in_order_and_progress_is_told_to_the_end(cores: int) -> None:
    told: list[float] = []

    def late(k: int) -> int:
        time.sleep(0.002 * (7 - k))
        return k * k

    assert each(late, range(7), told.append) == [k * k for k in range(7)]
    assert told == pytest.approx([(k + 1) / 7 for k in range(7)])
    assert each(late, []) == []


def test_what_waits_for_each_other_is_taken_in_turns(cores: int) -> None:
    assert in_turns("AAABBCDD", 2) == [0, 3, 1, 4, 2, 5, 6, 7]  # A and B in turns, then C and D
    assert in_turns("AAABB", 1) == [0, 1, 2, 3, 4]
    assert in_turns([], 2) == []
    assert each(lambda k: k * k, range(9), shared=lambda k: k // 3) == [k * k for k in range(9)]


def test_two_cores_work_at_the_same_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1})
    both = threading.Barrier(2, timeout=10)  # breaks where one waits for the other to end
    each(lambda k: both.wait(), range(4))


def test_errands_are_run_by_who_asked(cores: int) -> None:
    by: set[int] = set()

    def work(k: int) -> int:
        return by_asker(lambda: by.add(threading.get_ident()) or k) + 1

    assert each(work, range(9)) == list(range(1, 10))
    assert by == {threading.get_ident()}
    assert by_asker(threading.get_ident) == threading.get_ident()


def failing(k: int) -> int:
    if k == 3:
        raise ValueError("the third")
    return k


def failing_errand(k: int) -> int:
    return by_asker(lambda: failing(k))


@pytest.mark.parametrize("work", [failing, failing_errand])
def test_an_error_is_raised_and_nobody_is_left_waiting(cores: int, work: Callable[[int], int]) -> None:
    before = threading.active_count()
    with pytest.raises(ValueError, match="the third"):
        each(work, range(12))
    assert threading.active_count() == before


def test_the_error_that_is_raised_is_the_one_that_stopped_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not that an errand of work before it was refused for it."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1})
    failed = threading.Event()

    def work(k: int) -> int:
        if k == 1:
            failed.set()
            raise ValueError("the first")
        assert failed.wait(10)
        time.sleep(0.1)  # until it is known
        return by_asker(lambda: k)

    with pytest.raises(ValueError, match="the first"):
        each(work, range(2))


def test_an_errand_may_be_refused_by_the_thread_that_raised(cores: int) -> None:
    def caught(k: int) -> int:
        try:
            return failing_errand(k)
        except ValueError:
            return -1

    assert each(caught, range(5)) == [0, 1, 2, -1, 4]


def test_interrupted_errands_leave_no_thread(cores: int) -> None:
    def stopped() -> None:
        raise KeyboardInterrupt

    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        each(lambda k: by_asker(stopped), range(6))
    assert threading.active_count() == before


def test_work_within_work_takes_no_more_threads(cores: int) -> None:
    def inner(k: int) -> list[int]:
        here = threading.get_ident()
        assert each(lambda j: threading.get_ident(), range(3)) == [here] * 3
        return each(lambda j: by_asker(lambda: j + k), range(3))

    assert each(inner, range(4)) == [[k, k + 1, k + 2] for k in range(4)]


def test_a_property_is_reckoned_once_and_waits_for_no_other_object() -> None:
    class Thing:
        count = 0

        @own_property
        def other(self) -> int:
            self.count += 1
            both.wait()
            return self.count

    both = threading.Barrier(2, timeout=10)  # functools' lock would let one in alone
    things = [Thing(), Thing()]
    threads = [threading.Thread(target=lambda t=t: t.other) for t in things]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert [t.other for t in things] == [1, 1]
    assert isinstance(Thing.other, own_property)

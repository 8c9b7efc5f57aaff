"""The same for every condition, on all cores: NumPy, OpenCV and compiled kernels let threads run.

What a graphics context draws is drawn by the thread that the work was asked by, which the context belongs to.
"""

import functools
import os
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import contextmanager
from itertools import zip_longest
from queue import SimpleQueue
from threading import local
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

T = TypeVar("T")
R = TypeVar("R")

MOST = 4  # threads: each holds the planes of a condition
Errand = tuple[Callable[[], Any], "Future[Any]"]
_own = local()  # in a thread of the pool: the queue of who asked it


class own_property(functools.cached_property[T]):
    """``functools.cached_property`` without its lock, which all objects of a class share (Python 3.12 has none):
    threads that work on different objects would wait for each other."""

    def __get__(self, instance: object, owner: type[Any] | None = None) -> Any:
        if instance is None:
            return self
        assert self.attrname is not None
        kept = instance.__dict__
        if self.attrname not in kept:
            kept[self.attrname] = self.func(instance)
        return kept[self.attrname]


@contextmanager
def one_thread() -> Iterator[None]:
    """BLAS works alone: matrices are small, and threads would wait for each other."""
    with threadpool_limits(1, "blas"):
        yield


def each(
    work: Callable[[T], R],
    items: Iterable[T],
    done: Callable[[float], None] = lambda share: None,
    shared: Callable[[T], Hashable] | None = None,
) -> list[R]:
    """``work`` of every item, in order. ``done(share)`` hears how many are done. What fails first is raised, the rest
    is left. ``shared``: what those items draw but once that have the same: one of them would wait for the other, so
    that those begin together that have not."""
    todo = list(items)
    threads = min(len(os.sched_getaffinity(0)), MOST, len(todo))
    if threads < 2 or hasattr(_own, "asked"):  # the cores have work already
        out = []
        for k, item in enumerate(todo):
            out.append(work(item))
            done((k + 1) / len(todo))
        return out
    asked: SimpleQueue[Errand | None] = SimpleQueue()

    def begun() -> None:
        _own.asked = asked

    with ThreadPoolExecutor(threads, "condition", begun) as pool:
        order = range(len(todo)) if shared is None else in_turns([shared(item) for item in todo], threads)
        begun_at = {k: pool.submit(work, todo[k]) for k in order}
        futures = [begun_at[k] for k in range(len(todo))]
        for f in futures:
            f.add_done_callback(lambda _: asked.put(None))
        try:
            count = 0
            while count < len(todo):
                errand = asked.get()
                if errand is not None:
                    _run(*errand)
                    continue
                count += 1
                done(count / len(todo))
                if any(f.done() and f.exception() is not None for f in futures):
                    break
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            while not all(f.done() for f in futures):  # nobody is left waiting for an errand
                errand = asked.get()
                if errand is not None:
                    errand[1].set_exception(CancelledError())
    failed = [f for f in futures if not f.cancelled() and f.exception() is not None]
    failed.sort(key=lambda f: isinstance(f.exception(), CancelledError))  # which what failed made of others
    return [f.result() for f in futures] if not failed else [failed[0].result()]


def in_turns(keys: Sequence[Hashable], n: int) -> list[int]:
    """Places of ``keys``, those of ``n`` different ones in turns, before the next ones: what is kept of the last few
    need not be made again."""
    groups: dict[Hashable, list[int]] = {}
    for place, key in enumerate(keys):
        groups.setdefault(key, []).append(place)
    every = list(groups.values())
    turns = [zip_longest(*every[k : k + n]) for k in range(0, len(every), n)]
    return [place for rounds in turns for turn in rounds for place in turn if place is not None]


def _run(work: Callable[[], Any], answer: "Future[Any]") -> None:
    try:
        answer.set_result(work())
    except BaseException as error:  # it is the asking thread's to raise
        answer.set_exception(error)
        if not isinstance(error, Exception):
            raise


def by_asker(work: Callable[[], R]) -> R:
    """``work``, by the thread that asked for what this thread does; by this one where none did."""
    asked: SimpleQueue[Errand | None] | None = getattr(_own, "asked", None)
    if asked is None:
        return work()
    answer: Future[Any] = Future()
    asked.put((work, answer))
    result: R = answer.result()
    return result

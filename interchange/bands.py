"""Bands of rows worked on by threads: temporaries stay in a core's cache, and NumPy and OpenCV let threads run."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

BAND = 1 << 17  # numbers of a band, 512 KiB: less costs more calls, more leaves the cache


def each_band(work: Callable[[int, int], None], height: int, width: int) -> None:
    """``work(start, stop)`` for bands that cover ``height`` rows of ``width`` numbers; starts are even."""
    rows = max(2, BAND // max(width, 1) // 2 * 2)
    starts = range(0, height, rows)
    if len(starts) == 1:
        work(0, height)
    else:
        list(_pool(os.getpid()).map(lambda start: work(start, min(start + rows, height)), starts))


@lru_cache(maxsize=1)
def _pool(process: int) -> ThreadPoolExecutor:
    """One a process: threads do not outlive a fork."""
    return ThreadPoolExecutor(len(os.sched_getaffinity(0)), "band")

"""Loops compiled by Numba and kept on disk, safely where several processes start at once.

Numba numbers the files of one function's compiled forms by an index that is read and written without a lock: of two
processes that compile different forms at the same time, one may be given the other's machine code (numba issues 4807
and 10128: segmentation faults). Here a lock file stands before the cache.
"""

import fcntl
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache


def jit(signature: Any = None, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """``numba.njit`` that keeps what it compiles; with a ``signature``, for that alone and at once."""

    def decorate(function: Callable[..., Any]) -> Any:
        made = numba.njit(**options)(function)
        made._cache = LockedCache(function)  # type: ignore[no-untyped-call]
        if signature is not None:
            made.compile(signature)
            made.disable_compile()
        return made

    return decorate


class LockedCache(FunctionCache):
    def load_overload(self, *args: Any) -> Any:
        with self._alone():
            try:
                return super().load_overload(*args)  # type: ignore[no-untyped-call]
            except ModuleNotFoundError:  # kept by a process that had loaded this file under another name
                return None

    def save_overload(self, *args: Any) -> None:
        with self._alone():
            super().save_overload(*args)  # type: ignore[no-untyped-call]

    @contextmanager
    def _alone(self) -> Iterator[None]:
        path = Path(self._cache_file._index_path + ".lock")
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # let go when the file closes, or its process ends
            yield

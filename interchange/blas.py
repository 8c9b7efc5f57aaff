"""Matrices as fast as the processor can: NumPy 1.26, which bpy asks for, comes with an OpenBLAS of 2023.

On Intel's processors since (Emerald Rapids and later) that takes the kernels of 2004, with a fifth of the speed; and it
inverts even a pose on as many threads as there are cores, which wait for each other: some µs on an idle machine, some
ms where a core has other work (both: benchmarks/matrix_kernels.py). It works on one thread here, and on more where
matrices are large and a function asks for that (``on_all_cores``).

It reads ``OPENBLAS_CORETYPE`` and ``OPENBLAS_NUM_THREADS`` when NumPy is imported first. What a user has set stands.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

SETTING = "OPENBLAS_CORETYPE"
THREADS = "OPENBLAS_NUM_THREADS"
NEEDS = {  # instructions that kernels are compiled for, the best first
    "SkylakeX": {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"},
    "Haswell": {"avx2", "fma"},
}


def kernels_for(flags: set[str]) -> str:
    """OpenBLAS's name of the kernels for a processor with these ``flags`` (Linux's names); "" leaves it to OpenBLAS."""
    return next((name for name, needed in NEEDS.items() if needed <= flags), "")


def choose_kernels(cpuinfo: Path = Path("/proc/cpuinfo")) -> None:
    """Set them for this process and those that it starts, as long as it has not imported NumPy."""
    try:
        lines = cpuinfo.read_text(errors="replace").splitlines()
    except OSError:  # not Linux
        return
    flags = next((set(x.split(":", 1)[1].split()) for x in lines if x.startswith("flags")), set())
    if name := kernels_for(flags):
        os.environ.setdefault(SETTING, name)


def choose_threads() -> None:
    """One, for this process and those that it starts, as long as it has not imported NumPy."""
    global _ours
    _ours = THREADS not in os.environ
    os.environ.setdefault(THREADS, "1")


@contextmanager
def on_all_cores() -> Iterator[None]:
    """Products of large matrices take all cores within; as many as a user has said, or as a process that started this
    one has left."""
    if not _ours:
        yield
        return
    from threadpoolctl import threadpool_limits

    with threadpool_limits(len(os.sched_getaffinity(0)), "blas"):
        yield


_ours = False  # whether the number of threads is what was chosen here

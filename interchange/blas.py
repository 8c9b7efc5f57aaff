"""Matrix products as fast as the processor can: NumPy 1.26, which bpy asks for, comes with an OpenBLAS of 2023, and on
Intel's processors since (Emerald Rapids and later) that takes the kernels of 2004, with a fifth of the speed
(benchmarks/matrix_kernels.py).

It reads ``OPENBLAS_CORETYPE`` when NumPy is imported first. What a user has set stands.
"""

import os
from pathlib import Path

SETTING = "OPENBLAS_CORETYPE"
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

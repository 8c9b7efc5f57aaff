"""Matrices take the kernels that the processor has, however new it is, and one thread where nobody asks for more."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from interchange.blas import SETTING, THREADS, choose_kernels, kernels_for

AVX2 = {"sse4_2", "avx", "avx2", "fma"}
AVX512 = AVX2 | {"avx512f", "avx512dq", "avx512cd", "avx512bw", "avx512vl", "amx_tile"}
PACKAGES = (
    "analysis.gap.evidence.likelihood",
    "composer.cli",
    "interchange.image",
    "offline.settings",
    "realtime.frame",
)


@pytest.mark.parametrize(
    ("flags", "name"),
    [(AVX512, "SkylakeX"), (AVX2, "Haswell"), (AVX512 - {"avx512vl"}, "Haswell"), ({"sse4_2", "avx"}, "")],
)
def test_the_best_that_a_processor_has(flags: set[str], name: str) -> None:
    assert kernels_for(flags) == name


def test_what_a_user_has_set_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text(f"processor : 0\nflags\t\t: {' '.join(sorted(AVX512))}\nbugs :\n")
    monkeypatch.setenv(SETTING, "Zen")
    choose_kernels(cpuinfo)
    assert os.environ[SETTING] == "Zen"
    monkeypatch.delenv(SETTING)
    choose_kernels(tmp_path / "none")
    assert SETTING not in os.environ
    choose_kernels(cpuinfo)
    assert os.environ[SETTING] == "SkylakeX"


@pytest.mark.parametrize("module", PACKAGES)
def test_every_package_chooses_before_numpy_is_there(module: str) -> None:
    """In a process of its own, whose environment says nothing: OpenBLAS tells which kernels it took."""
    code = (
        f"import {module}, numpy, os, threadpoolctl\n"
        "found = [x for x in threadpoolctl.threadpool_info() if 'numpy' in x['filepath']]\n"
        f"print(os.environ.get('{SETTING}', ''), *(x['architecture'] for x in found))"
    )
    flags = {x for line in Path("/proc/cpuinfo").read_text().splitlines()[:60] for x in line.split()}
    wanted = kernels_for(flags)
    setting, taken = _told(code, {}).split(" ")
    assert setting == wanted
    assert taken == wanted or not wanted


@pytest.mark.parametrize(
    ("said", "within"), [({}, len(os.sched_getaffinity(0))), ({THREADS: "1"}, 1), ({THREADS: "2"}, 2)]
)
def test_one_thread_but_for_what_is_large_or_a_user_has_said(said: dict[str, str], within: int) -> None:
    code = (
        "import interchange, numpy\n"
        "from interchange.blas import on_all_cores\n"
        "from threadpoolctl import threadpool_info\n"
        "count = lambda: [x['num_threads'] for x in threadpool_info() if 'numpy' in x['filepath']][0]\n"
        "before = count()\n"
        "with on_all_cores():\n"
        "    inside = count()\n"
        "print(before, inside, count())"
    )
    alone = int(said.get(THREADS, 1))
    assert [int(x) for x in _told(code, said).split()] == [alone, within, alone]


def _told(code: str, said: dict[str, str]) -> str:
    """What a process of its own writes, whose environment says nothing of matrices but what is ``said``."""
    env = {k: v for k, v in os.environ.items() if k not in (SETTING, THREADS)} | said
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, env=env, capture_output=True, text=True, check=True
    )
    return done.stdout.rstrip("\n")

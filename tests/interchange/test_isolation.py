"""Whatever a parser does in isolation, its caller gets the result or one sentence about the file."""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from interchange.formats.isolation import isolated
from interchange.problems import BrightfieldError, FileError

PARSERS = """
import ctypes, os, subprocess, time
import numpy as np
from interchange.problems import BrightfieldError, FileError, Problem, Where

def echo(path, *args):
    print("library chatter")
    os.write(2, b"library noise" * 100_000)
    return path, args

def pid(path): return os.getpid()
def segfault(path): ctypes.string_at(0)
def abort(path): os.abort()
def leave(path): os._exit(3)
def hang(path): time.sleep(1000)
def spin(path):
    os.close(1); os.close(2)
    while True: pass
def ones(path, count): return np.ones(count, np.uint8)
def write_pid_and_hang(path):
    with open(path + ".part", "w") as f: f.write(str(os.getpid()))
    os.rename(path + ".part", path)
    time.sleep(1000)
def bad_alloc(path):
    os.write(2, b"terminate called after throwing an instance of 'std::bad_alloc'")
    os.abort()
def key_error(path): return {}["two\\nlines"]
def recurse(path): return recurse(path)
def two_problems(path):
    raise FileError([Problem("One.", Where(path, "a")), Problem("Two.", Where(path, "b"))])
def sentence(path): raise BrightfieldError("No such unit.")
class Order:
    def __init__(self, path): self.path = path
    def __reduce__(self): return os.system, ("touch " + self.path,)
def order(path): return Order(path)
"""


@pytest.fixture(scope="module")
def parsers(tmp_path_factory):
    folder = tmp_path_factory.mktemp("isolated")
    (folder / "parsers_under_test.py").write_text(PARSERS)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        import parsers_under_test

        yield parsers_under_test


def test_a_result_comes_back_with_its_arrays_and_without_the_noise(parsers, capfd):
    points = np.random.default_rng(0).normal(size=(1000, 3))
    path, (copy, pair) = isolated(parsers.echo, "part.step", points, ("a", 1))
    assert path == "part.step"
    assert pair == ("a", 1)
    np.testing.assert_array_equal(copy, points)
    copy[0] = 0  # its own memory, writable
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("segfault", "SIGSEGV"),
        ("abort", "SIGABRT"),
        ("leave", "without a result"),
        ("hang", "0.5 s"),
        ("spin", "0.5 s"),
        ("bad_alloc", "2 GB of memory"),
        ("key_error", "KeyError"),
        ("recurse", "RecursionError"),
    ],
)
def test_every_way_to_fail_is_one_line_that_names_the_file(parsers, capfd, name, says):
    seconds = (
        0.5 if says == "0.5 s" else 30.0
    )  # those that end by themselves may be slow to on a busy machine
    start = time.perf_counter()
    with pytest.raises(FileError) as error:
        isolated(getattr(parsers, name), "dir/part.step", seconds=seconds, memory_bytes=2 * 10**9)
    assert time.perf_counter() - start < 30
    assert says in str(error.value)
    assert str(error.value).startswith("dir/part.step: ")
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def test_the_function_s_own_problems_come_back_as_they_were_raised(parsers):
    with pytest.raises(FileError) as error:
        isolated(parsers.two_problems, "f.off")
    assert [str(p) for p in error.value.problems] == ["f.off: a: One.", "f.off: b: Two."]
    with pytest.raises(BrightfieldError, match="No such unit"):
        isolated(parsers.sentence, "f.off")


@pytest.mark.parametrize("count", [10**11, 3 * 10**8])  # a hundred gigabytes; a little more than is allowed
def test_memory_is_bounded(parsers, count):
    start = time.perf_counter()
    with pytest.raises(FileError, match=r"f\.off: .*0\.25 GB of memory"):
        isolated(parsers.ones, "f.off", count, memory_bytes=25 * 10**7)
    assert time.perf_counter() - start < 30
    assert isolated(parsers.ones, "f.off", 10**8, memory_bytes=25 * 10**7).sum() == 10**8


def test_a_taken_over_parser_cannot_give_orders(parsers, tmp_path):
    with pytest.raises(FileError, match="not data"):
        isolated(parsers.order, tmp_path / "pwned")
    assert not (tmp_path / "pwned").exists()


def test_every_call_is_a_fresh_process_and_calls_run_side_by_side(parsers):
    with ThreadPoolExecutor(4) as pool:
        pids = list(pool.map(lambda i: isolated(parsers.pid, f"{i}.exr"), range(12)))
    assert len(set(pids)) == 12
    assert os.getpid() not in pids


def test_a_call_costs_little(parsers):
    isolated(parsers.pid, "warm")
    cost = []
    for _ in range(10):
        start = time.perf_counter()
        isolated(parsers.pid, "f.exr")
        cost.append(time.perf_counter() - start)
    assert np.median(cost) < 0.3  # 0.007 s on an idle machine: two forks of a small process


def test_a_killed_caller_takes_its_worker_along(parsers, tmp_path):
    """The guard sees the pipes of the call close, and kills what it watches."""
    pid_file = tmp_path / "pid"
    code = (
        f"import sys; sys.path[:] = {sys.path!r}\n"
        "from interchange.formats.isolation import isolated; import parsers_under_test\n"
        f"isolated(parsers_under_test.write_pid_and_hang, {str(pid_file)!r})"
    )
    caller = subprocess.Popen([sys.executable, "-c", code])
    wait_until(pid_file.exists)
    worker = int(pid_file.read_text())
    caller.kill()
    caller.wait()
    wait_until(lambda: not os.path.exists(f"/proc/{worker}"))


def wait_until(condition):
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_function_that_cannot_be_imported_is_a_programming_error():
    with pytest.raises(TypeError, match="importable"):
        isolated(lambda path: path, "f.step")

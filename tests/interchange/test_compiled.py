"""Two processes that compile one function at the same time, each its own form of it, leave a cache that is right."""

import os
import subprocess
import sys
from pathlib import Path

MODULE = """
from interchange.compiled import jit

@jit()
def twice(x):
    return x + x
"""
# a pause where the index is written and the machine code not yet: what the race needs, every time
SLOWLY = """
import sys, time
from numba.core.caching import IndexDataCacheFile as File
save = File._save_index
def slowly(self, overloads):
    time.sleep(0.5); save(self, overloads); time.sleep(1.0)
File._save_index = slowly
from doubling import twice
twice(eval(sys.argv[1]))
"""
READ = "from doubling import twice; assert (twice(3), twice(1.25)) == (6, 2.5); assert not twice.stats.cache_misses"


def test_two_processes_that_start_at_once_do_not_mix_their_code(tmp_path: Path) -> None:
    (tmp_path / "doubling.py").write_text(MODULE)
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])])
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": path}
    both = [subprocess.Popen([sys.executable, "-c", SLOWLY, x], env=env) for x in ("3", "1.25")]
    assert [p.wait() for p in both] == [0, 0]
    done = subprocess.run([sys.executable, "-c", READ], env=env, check=False)
    assert done.returncode == 0


AS_B = """
import sys
from importlib.util import module_from_spec, spec_from_file_location
spec = spec_from_file_location(sys.argv[1], sys.argv[2])
module = sys.modules[sys.argv[1]] = module_from_spec(spec)
spec.loader.exec_module(module)
assert module.twice(3) == 6
"""


def test_what_a_file_left_under_another_name_is_compiled_anew(tmp_path: Path) -> None:
    (tmp_path / "doubling.py").write_text(MODULE)
    env = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": str(Path(__file__).parents[2]),
    }
    for name in ("b", "c"):
        command = [sys.executable, "-c", AS_B, name, str(tmp_path / "doubling.py")]
        assert subprocess.run(command, env=env, check=False).returncode == 0

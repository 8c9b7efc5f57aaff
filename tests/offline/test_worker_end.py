"""A worker ends with the process that asks it, in the middle of a frame, too."""

import subprocess
import sys
import time
from pathlib import Path

import psutil

SCENE = Path(__file__).resolve().parents[2] / "assets" / "bench_sample" / "scene.usda"
STARTED = 6.0  # CPU seconds, after which a worker renders: it loads Blender in two
PATIENCE = 120.0


def test_a_worker_ends_with_whoever_started_it(tmp_path: Path):
    words = [sys.executable, "-m", "composer", "render", str(SCENE), "--offline", "--samples", "1000000"]
    asking = subprocess.Popen(
        [*words, "--noise", "0", "--camera", "/World/Camera0", "--out", str(tmp_path / "a.exr")],
        stdout=subprocess.DEVNULL,
    )
    worker = _busy_worker(psutil.Process(asking.pid))
    folder = Path(worker.cmdline()[-1])
    assert folder.is_dir()
    asking.kill()
    asking.wait()
    _, alive = psutil.wait_procs([worker], timeout=PATIENCE)
    for process in alive:
        process.kill()
    assert not alive
    assert not folder.exists()
    assert not list(tmp_path.iterdir())


def _busy_worker(asking: psutil.Process) -> psutil.Process:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        for process in asking.children():
            if "offline.worker" in process.cmdline() and process.cpu_times().user > STARTED:
                return process
        time.sleep(0.2)
    raise AssertionError("no worker renders")

"""The window, driven by mouse and keys on a screen of its own: a STEP file, the scene saved, reopened, recovered."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from composer.editor.robot import missing

ROOT = Path(__file__).parents[3]


@pytest.mark.skipif(bool(missing()), reason=f"needs {' and '.join(missing())}: apt install xvfb xdotool")
def test_a_person_can_set_a_scene_up_and_get_it_back_after_a_crash(tmp_path: Path) -> None:
    words = [
        sys.executable,
        "-m",
        "composer.editor.tour",
        "--out",
        str(tmp_path),
        "--assets",
        str(ROOT / "assets"),
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "LIBGL_ALWAYS_SOFTWARE": "1"}
    done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=560)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "tour.usda").exists()

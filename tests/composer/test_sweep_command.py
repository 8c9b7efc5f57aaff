"""`brightfield sweep` as a user runs it: a series, one that is killed and goes on, and a plan that is wrong."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas
import pytest
from PIL import Image as Pillow

from composer.cli import main

ROOT = Path(__file__).parents[2]
STATION = ROOT / "docs/examples/station.usda"
EXAMPLE = (ROOT / "docs/examples/sweep.yaml").read_text(encoding="utf-8")
SMALL = {
    "scene: station.usda": f"scene: {STATION}\nwidth: 64",
    "samples: 8": "samples: 1",
    "count: 32": "count: 10",
}


def small(folder: Path) -> Path:
    """The example with fewer and smaller frames."""
    text = EXAMPLE
    for old, new in SMALL.items():
        assert old in text
        text = text.replace(old, new)
    (folder / "plan.yaml").write_text(text, encoding="utf-8")
    return folder / "plan.yaml"


@pytest.mark.slow
@pytest.mark.timeout(900)  # two starts of the program; a busy machine takes minutes
def test_a_series_that_is_killed_goes_on_where_it_stopped(tmp_path, capsys):
    plan, out = small(tmp_path), tmp_path / "series"
    words = [sys.executable, "-m", "composer", "sweep", str(plan), "--out", str(out), "--workers", "1"]
    running = subprocess.Popen(
        words, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    deadline = time.monotonic() + 400
    while len(list(out.glob("frames/[0-9]*.json"))) < 3 and time.monotonic() < deadline:
        assert running.poll() is None
        time.sleep(0.01)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    finished = {p.name: p.stat().st_mtime_ns for p in out.glob("frames/[0-9]*.json")}
    assert 3 <= len(finished) < 10
    assert not (out / "manifest.parquet").exists()

    assert main(words[3:]) == 0
    told = capsys.readouterr()
    assert f"{len(finished)} frames were there already." in told.out
    assert "10 samples, 10 frames" in told.out
    assert "10/10 frames" in told.err
    assert all((out / "frames" / n).stat().st_mtime_ns == t for n, t in finished.items())  # left as they were
    assert len(pandas.read_parquet(out / "manifest.parquet")) == 10
    summary = json.loads((out / "sweep.json").read_text())
    assert (summary["frames"], summary["found_finished"], summary["failed"]) == (10, len(finished), [])
    assert len(json.loads((out / "coco.json").read_text())["images"]) == 10
    sheet = np.asarray(Pillow.open(out / "contact_sheet.png").convert("L"))
    assert sheet.shape[1] > 160
    assert sheet.std() > 10  # there is something to see
    assert not list(out.rglob(".*"))  # nothing half-written is left

    assert main(words[3:]) == 0  # and a third time nothing is rendered
    assert "10 frames were there already." in capsys.readouterr().out


def test_check_draws_the_samples_and_renders_nothing(tmp_path, capsys):
    assert (
        main(["sweep", str(ROOT / "docs/examples/sweep.yaml"), "--check", "--out", str(tmp_path / "none")])
        == 0
    )
    assert "32 samples, 32 frames." in capsys.readouterr().out
    assert not (tmp_path / "none").exists()


def test_a_plan_that_is_wrong_ends_with_2_and_one_line_a_problem(tmp_path, capsys):
    plan = tmp_path / "plan.yaml"
    plan.write_text(f"scene: {STATION}\nwidht: 3\nrenderer: blender\n", encoding="utf-8")
    assert main(["sweep", str(plan)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert all(line.startswith("brightfield: ") for line in lines)


def test_constraints_that_nothing_keeps_are_told_with_their_numbers(tmp_path, capsys):
    plan = tmp_path / "plan.yaml"
    plan.write_text(
        f"scene: {STATION}\nsampling: {{method: list}}\nparameters: {{Plate.pose.tx: {{values: [60, 80], unit: mm}}}}\n"
        "constraints: [{kind: in_view, of: Plate, at_least: 0.5}]\n",
        encoding="utf-8",
    )
    assert main(["sweep", str(plan), "--check"]) == 2
    assert "0 of 2 did: in_view of /World/Plate rejected 2" in capsys.readouterr().err


def test_a_grid_leaves_out_what_breaks_a_constraint(tmp_path, capsys):
    plan = tmp_path / "plan.yaml"
    plan.write_text(
        f"scene: {STATION}\nparameters: {{Plug.pose.tz: {{range: [-6, 6], unit: mm, steps: 5}}}}\n"
        "constraints: [{kind: no_collision, of: Plug, with: Plate}]\n",
        encoding="utf-8",
    )
    assert main(["sweep", str(plan), "--check"]) == 0  # -6, -3 and 0 (touching) meet the plate
    told = capsys.readouterr().out
    assert "2 samples, 2 frames." in told
    assert "3 of 5 samples were rejected: no_collision of /World/Plug." in told

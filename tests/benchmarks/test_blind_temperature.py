"""Calls of opened sets told under another temperature."""

import subprocess
import sys
from pathlib import Path

import pytest

from analysis.gap.evidence.sureness import cooled
from benchmarks.blind.results import Answer
from benchmarks.blind.temperature import anew

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "blind" / "temperature.py"


def test_a_call_is_told_as_the_diagnosis_tells_it() -> None:
    """0.97 under 1 is told as the diagnosis cools it, whatever it was told by before; what noise shows stays."""
    before = Answer({"defocus": cooled(0.97, 2.0), "sensor_noise": 0.98})
    there = anew(before, 2.0, 1.5)
    assert there.said == pytest.approx({"defocus": cooled(0.97, 1.5), "sensor_noise": 0.98})


def test_the_set_that_is_kept_is_told_as_it_stands_in_docs() -> None:
    done = subprocess.run(
        [sys.executable, SCRIPT, "2026-11-28", "--told", "2"], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("70 cases; ")
    assert "sure and wrong 0 of 70" in done.stdout

"""The diagnosis of the EMVA 1288 reference images, as benchmarks/real_gap.py runs it and docs/real_gap.md shows it."""

import json
from dataclasses import replace

import pytest

from benchmarks import real_gap
from interchange.formats import emva_data

WHOLE = emva_data.read(real_gap.ASSETS / "camera_emva1288/EMVA1288_Data.txt")


@pytest.mark.slow
def test_an_ideal_sensor_lacks_what_emva_1288_measures_and_nothing_else(tmp_path, monkeypatch):
    """Every other level of exposure, lit and dark, which takes half of the time."""
    half = replace(WHOLE, points=[p for k, p in enumerate(WHOLE.points) if k // 2 % 2 == 0])
    monkeypatch.setattr(emva_data, "read", lambda path: half)
    found = real_gap.sensor(tmp_path, 2, None)
    said = json.loads((tmp_path / "diagnosis.json").read_text())
    assert {e["name"] for e in said["effects"]} == {"sensor_noise", "black_level", "fixed_pattern"}
    assert said["gap"]["explained"] > 0.9
    one_in_a_hundred = {"K", "black_level"}  # what the issue asks for; others by two pictures a level: 10 %
    for name in ("K", "black_level", "read_noise", "prnu"):
        value, reference = found[name]
        assert value == pytest.approx(reference, rel=0.01 if name in one_in_a_hundred else 0.1), name

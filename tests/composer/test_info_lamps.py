"""`brightfield info` about lamps: their power, their profile, their spectrum."""

import json
from pathlib import Path

import numpy as np
import pytest

from composer.cli import main
from interchange.colorimetry import luminous_efficacy
from interchange.illuminants import illuminant

SPD = Path(__file__).parents[2] / "assets" / "measurements" / "cie.stdillum.A.spd"
SCENE = """#usda 1.0
(
    metersPerUnit = 0.001
    upAxis = "Z"
)
def SphereLight "Led" (
    prepend apiSchemas = ["ShapingAPI"]
)
{
    bool treatAsPoint = true
    double lamp:flux = 120
    string lamp:spectrum = "LED-B3"
    asset inputs:shaping:ies:file = @led.csv@
}
def RectLight "Back"
{
    bool lamp:visible = true
    double lamp:power = 3
}
"""


def found(path: Path, capsys: pytest.CaptureFixture[str]) -> dict:
    assert main(["info", str(path), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_lamps_of_a_scene_have_a_power(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "led.csv").write_text("angle (deg),relative intensity\n0,1\n20,.5\n40,0\n")
    (tmp_path / "s.usda").write_text(SCENE)
    led, back = found(tmp_path / "s.usda", capsys)["lights"]
    assert np.mean(led["power_W"]) == pytest.approx(120 / luminous_efficacy(illuminant("LED-B3")))
    assert led["shaping"] == "cone ±90°, profile led.csv"
    assert back["power_W"] == pytest.approx([3] * 3)
    assert "seen by the camera" in back["shaping"]
    sheet = found(tmp_path / "led.csv", capsys)
    assert sheet["kind"] == "radial profile"
    assert sheet["beam_angle_50_percent_deg"] == pytest.approx([40, 40], abs=0.01)


def test_a_spectrum_has_a_colour_and_an_efficacy(capsys: pytest.CaptureFixture[str]) -> None:
    (row,) = found(SPD, capsys)["spectra"]
    assert row["xy"] == pytest.approx([0.4476, 0.4074], abs=1e-4)
    assert row["peak_nm"] == 830

"""`brightfield optimise` as a user runs it: the stand of docs/optimise, searched, confirmed, written as a scene."""

import csv
import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

from composer.cli import main
from interchange.formats import images
from interchange.formats.document import open_scene

EXAMPLE = Path(__file__).parents[2] / "docs" / "optimise" / "station.py"


@pytest.fixture(scope="module")
def stand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    spec = importlib.util.spec_from_file_location("station_example", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    out = tmp_path_factory.mktemp("stand")
    example.make(out)
    plan = (out / "plan.yaml").read_text()
    small = plan.replace("width: 128, samples: 6", "width: 64, samples: 4").replace(
        "samples: 64", "samples: 4"
    )
    assert small != plan
    (out / "plan.yaml").write_text(small)
    return out


def test_the_winner_is_a_scene_that_stands_as_it_was_told(
    stand: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (stand / "station.usda").read_bytes()
    out = stand / "found"
    assert (
        main(["optimise", str(stand / "plan.yaml"), "--out", str(out), "--trials", "10", "--confirm", "1"])
        == 0
    )
    told = capsys.readouterr().out
    assert "winner, path-traced" in told
    assert "random search:" in told
    assert (stand / "station.usda").read_bytes() == before
    about = json.loads((out / "optimise.json").read_text())
    assert about["random"]["trials"] == about["search"]["trials"] == 10
    assert about["search"]["front"]
    values = about["winner"]["parameters"]
    scene = open_scene(out / "winner.usda").scene()
    base = open_scene(stand / "station.usda").scene()
    moved = scene.camera().world_from_camera[:3, 3] - base.camera().world_from_camera[:3, 3]
    assert 1e3 * moved == pytest.approx([values[f"Camera.pose.t{a}"] for a in "xyz"], abs=1e-3)
    assert scene.camera().lens.f_stop == pytest.approx(values["Camera.lens.f_stop"], rel=1e-5)
    assert scene.camera().t_exp == pytest.approx(values["Camera.sensor.t_exp"], rel=1e-5)
    part = np.array(
        [0, 0, 0.01]
    )  # the middle of its box, where camera and lamp are aimed and the lens is focused
    eye = scene.camera().world_from_camera
    away = part - eye[:3, 3]
    assert eye[:3, 2] == pytest.approx(away / np.linalg.norm(away), abs=1e-4)
    assert scene.camera().lens.focus_distance == pytest.approx(np.linalg.norm(away), rel=1e-4)
    lamp = scene.lights[0].world_from_light
    assert -lamp[:3, 2] == pytest.approx((part - lamp[:3, 3]) / np.linalg.norm(part - lamp[:3, 3]), abs=1e-4)
    with open(out / "trials.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 20
    for name in ("front.png", "course.png", "winner.png"):
        assert np.ptp(images.read(out / name)) > 60


def test_limits_that_nothing_keeps_are_told(stand: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = stand / "none.yaml"
    plan.write_text((stand / "plan.yaml").read_text().replace("clearance: 15", "clearance: 900"))
    assert main(["optimise", str(plan), "--trials", "3", "--confirm", "0"]) == 2
    assert "clearance of Camera: 3" in capsys.readouterr().err

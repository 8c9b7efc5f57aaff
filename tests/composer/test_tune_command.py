"""`brightfield tune` as a user runs it: the chessboard of docs/tune, from a simulated series to photographs."""

import csv
import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

from composer.cli import main
from interchange.formats import images

EXAMPLE = Path(__file__).parents[2] / "docs" / "tune" / "chessboard.py"


@pytest.fixture(scope="module")
def chessboard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    spec = importlib.util.spec_from_file_location("chessboard_example", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    out = tmp_path_factory.mktemp("chessboard")
    example.make(out, 8, 2, 0)
    return out


def test_tuned_on_simulations_verified_on_photographs(
    chessboard: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = chessboard / "tuned"
    words = ["tune", str(chessboard / "simulated.json"), "--algorithm", "subpixel-edges", "--of", "white"]
    words += ["--of", "black", "--objective", "edge_pixels", "--objective", "line_distance", "--trials", "8"]
    words += ["--holdout", "0.5", "--real", str(chessboard / "real.json"), "--out", str(out)]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert told.index("before any is scored") < told.index("inside")
    tuned = json.loads((out / "tune.json").read_text())
    assert tuned["algorithm"] == "subpixel-edges"
    assert len(tuned["held_out"]) == 4
    assert tuned["front"]
    stated = json.loads((out / "prediction.json").read_text())
    came = json.loads((out / "verification.json").read_text())
    assert stated["stated"] < came["scored"]
    assert stated["parameters"] == tuned["parameters"]
    by_name = {m["measure"]: m for m in came["measures"]}
    # the photographs' edges are found: all of them but where a hand or glare is in the way
    assert min(by_name["recall"]["real"].values()) > 0.9
    assert max(by_name["position"]["real"].values()) < 0.8
    with open(out / "trials.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 8
    assert float(rows[0]["high"]) == tuned["defaults"]["high"]
    picture = images.read(out / "found.png")
    assert picture.shape == (480, 1286, 3)
    orange = (picture[..., 0] > 200) & (picture[..., 2] < 60)
    assert orange[:, :640].sum() > 500
    assert orange[:, 646:].sum() > 500
    for name in ("search.png", "slices.png", "robustness.png", "prediction.png"):
        assert np.ptp(images.read(out / name)) > 100


def test_what_cannot_be_tuned_is_told(chessboard: Path, capsys: pytest.CaptureFixture[str]) -> None:
    series = str(chessboard / "simulated.json")
    out = ["--out", str(chessboard / "none")]
    for words, told in (
        (["--algorithm", "cany", "--of", "white"], 'Did you mean "canny"'),
        (["--algorithm", "canny"], "--features or by --of"),
        (["--algorithm", "circle-gauge", "--of", "white"], "--features"),
        (["--algorithm", "canny", "--of", "white", "--bound", "high=x"], "NAME=LOW:HIGH"),
        (["--algorithm", "canny", "--of", "whte"], 'has no body "whte"'),
        (["--algorithm", "canny", "--of", "white", "--trials", "0"], "--trials must be 1 or more"),
    ):
        assert main(["tune", series, *words, *out]) == 2
        assert told in capsys.readouterr().err

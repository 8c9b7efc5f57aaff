"""Tuning on a folder that `brightfield sweep` wrote: scenes as the plan set them, masks of its defects, weights."""

import json
from pathlib import Path

import numpy as np
import pytest

from analysis.sweep import plan_file
from analysis.sweep.run import sweep
from analysis.tune.features import parse
from analysis.tune.reading import read_series
from composer.cli import main
from interchange.problems import FileError
from realtime.renderers.rasterizer import Rasterizer

STATION = Path(__file__).parents[3] / "docs" / "examples" / "station.usda"
PLAN = f"""
scene: {STATION}
renderer: {{name: realtime, samples: 4}}
sampling: {{method: sobol, count: 8, seed: 1}}
objects: [Plate, Plug]
width: 128
write: [png]
parameters:
  Camera.pose.tx: {{range: [-4, 4], unit: mm}}
defects:
  - kind: stain
    on: Plate
    present: {{values: [0, 1], shares: [0.5, 0.5], nature: [0.9, 0.1]}}
    radius: {{value: 3, unit: mm}}
    x: {{value: -8, unit: mm}}
    cover: 1.0
"""


@pytest.fixture(scope="module")
def series(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "plan.yaml").write_text(PLAN)
    done = sweep(plan_file.read(folder / "plan.yaml"), folder / "out", workers=1)
    assert (done.frames, done.failed) == (8, ())
    return folder / "out"


def test_frames_know_their_scene_their_defects_and_their_weight(series: Path) -> None:
    with Rasterizer() as renderer:
        frames = read_series(series, parse({"edges": ["Plate"], "blobs": ["defects"]}), renderer)
        with pytest.raises(FileError, match='"scratch"'):
            read_series(series, parse({"blobs": ["scratch"]}), renderer)
    assert len(frames) == 8
    bad = np.array([f.truth.regions.max() > 0 for f in frames])  # type: ignore[union-attr]
    weights = np.array([f.weight for f in frames])
    assert 0 < bad.sum() < 8
    assert weights[bad] == pytest.approx(0.1 / 0.5)
    assert weights[~bad] == pytest.approx(0.9 / 0.5)
    assert any("pose.tx" in name for name in frames[0].variation)
    for f in frames:
        assert f.truth.regions is not None
        assert f.image.shape == f.truth.regions.shape
        assert f.image.shape[1] == 128
        assert f.truth.edges is not None
        assert len(f.truth.edges.points) > 100
    # the plate's edges move with the camera: true edges follow the image's own
    x = np.array([f.variation[next(n for n in f.variation if "pose.tx" in n)] for f in frames])
    middle = np.array([f.truth.edges.points[:, 0].mean() for f in frames])  # type: ignore[union-attr]
    assert (
        np.corrcoef(x, middle)[0, 1] < -0.5
    )  # to the left, though edges come and go at the rim of the image


def test_blobs_are_tuned_on_a_sweep(series: Path, tmp_path: Path) -> None:
    words = ["tune", str(series), "--algorithm", "threshold-blobs", "--of", "defects", "--trials", "12"]
    words += ["--holdout", "0.5", "--objective", "f1", "--out", str(tmp_path)]
    assert main(words) == 0
    about = json.loads((tmp_path / "tune.json").read_text())
    assert about["units"]["area"] == "px²"
    assert about["scores"]["f1"]["tuned_on"] >= 0
    assert (tmp_path / "found.png").is_file()

"""The gallery's figures are drawn from renders, and the command does what its parts do."""

import json

import numpy as np
import pytest

from analysis.series.folder import camera_record, read, write_json
from analysis.series.lightings import hemisphere, unit
from analysis.series.specimens import camera_above
from composer.cli import main
from composer.gallery.series import make, matched, sample_boxes
from interchange.formats import images


@pytest.mark.slow
def test_all_figures_are_drawn(tmp_path):
    """Small: 32 px, 8 x 3 lamps. Materials are told apart all the same, by both kinds of features."""
    found = make(tmp_path / "out", tmp_path / "keep", size=32, azimuths=8, polar=3, samples=1)
    for name in ("figure8", "figure9", "figure10", "figure11", "normals"):
        assert (tmp_path / "out" / f"{name}.png").stat().st_size > 10000
    assert found["ari_values"] > 0.6
    assert found["ari_features"] > 0.6
    assert found["normals_deg"] < 8


def test_clusters_take_the_names_of_what_they_show():
    truth = np.array([[0, 0, 1, 1, 2]])
    assert np.array_equal(matched(np.array([[2, 2, 0, 0, 1]]), truth), truth)
    row, column, side = sample_boxes(np.pad(np.ones((3, 3), int), 2), 3)[1]
    assert (row, column, side) == (2, 2, 3)


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plate")
    words = [
        "--width",
        "32",
        "--azimuths",
        "8",
        "--polar",
        "3",
        "--samples",
        "1",
        "--dn",
        "--out",
        str(folder),
    ]
    assert main(["series", "capture", "plastic", *words]) == 0
    return folder


def run(plate, tmp_path, *words):
    status = main(["series", words[0], str(plate), *words[1:], "--out", str(tmp_path)])
    return status, json.loads((tmp_path / f"{words[0]}.json").read_text()) if status == 0 else {}


def test_defects_by_command(plate, tmp_path):
    truth = str(plate / "truth.png")
    status, about = run(plate, tmp_path, "anomalies", "--truth", truth, "--skip-registration")
    assert status == 0
    assert about["auc"] > 0.8
    mask = images.read(tmp_path / "mask.png")
    assert abs((mask > 0).mean() - about["anomalous_share"]) < 1e-9


def test_normals_lamps_fusion_and_classes_by_command(plate, tmp_path):
    status, about = run(plate, tmp_path, "normals", "--method", "ranks", "--skip-registration")
    assert status == 0
    assert about["pixels_without_normal"] == 0
    assert 1 < about["median_tilt_deg"] < 10  # grain of slope 0.07
    _, about = run(plate, tmp_path, "choose", "--count", "3", "--skip-registration")
    scores = [lamp["score_so_far"] for lamp in about["lamps"]]
    assert scores == sorted(scores)
    _, about = run(plate, tmp_path, "fuse", "--skip-registration", "--smoothness", "0")
    assert about["mean_contrast_of_places_chosen"] > about["mean_contrast_of_best_single"]
    words = ["cluster", "--classes", "2", "--features", "azimuth", "--skip-registration"]
    _, about = run(plate, tmp_path, *words)
    assert sum(about["pixels"]) == 32 * 32


def test_a_missing_image_is_one_line(plate, tmp_path, capsys):
    broken = tmp_path / "broken"
    (broken / "images").mkdir(parents=True)
    (broken / "series.json").write_text((plate / "series.json").read_text())
    for file in sorted((plate / "images").iterdir())[1:]:
        (broken / "images" / file.name).write_bytes(file.read_bytes())
    assert main(["series", "fuse", str(broken), "--out", str(tmp_path / "out")]) == 2
    assert "1 of 24 images are missing: images/000.png" in capsys.readouterr().err
    assert (
        main(
            [
                "series",
                "fuse",
                str(broken),
                "--without-missing",
                "--skip-registration",
                "--out",
                str(tmp_path),
            ]
        )
        == 0
    )


def test_lamps_are_calibrated_from_a_mirror_sphere_by_command(tmp_path):
    """A ball of 5 mm seen from above: the highlight of a lamp θ off the axis lies sin(θ / 2) of the radius out."""
    camera = camera_above(200, 12e-3)
    column, row = np.meshgrid(np.arange(200.0), np.arange(200.0))
    truth = unit(hemisphere(np.radians([20, 50]), 3))
    up, entries = np.array([0.0, 0.0, 1.0]), []
    for k, w in enumerate(truth):
        half = (w + up) / np.linalg.norm(w + up)
        x, y = 99.5 + half[0] * 5 / 0.06, 99.5 - half[1] * 5 / 0.06
        spot = 4000 * np.exp(-((column - x) ** 2 + (row - y) ** 2) / 8)
        images.write(tmp_path / f"{k}.png", spot.astype(np.uint16))
        entries.append({"image": f"{k}.png"})
    ball = np.clip(5 / 0.06 - np.hypot(column - 99.5, row - 99.5) + 0.5, 0, 1)
    images.write(tmp_path / "mask.png", np.rint(255 * ball).astype(np.uint8))
    write_json(tmp_path / "series.json", {"camera": camera_record(camera), "images": entries})
    other = tmp_path / "other"
    other.mkdir()
    write_json(other / "series.json", {"images": [{**e, "direction": [0, 0, 1]} for e in entries]})
    for e in entries:
        (other / e["image"]).write_bytes((tmp_path / e["image"]).read_bytes())
    words = ["--radius", "5", "--mask", str(tmp_path / "mask.png"), "--apply", str(other)]
    assert main(["series", "lights", str(tmp_path), *words, "--out", str(tmp_path / "out")]) == 0
    found = read(other / "calibrated.json").wi
    # a highlight is found to 0.02 px; a pixel at 50 degrees is 1.5 degrees
    assert np.degrees(np.arccos(np.sum(found * truth, axis=1))).max() < 0.1

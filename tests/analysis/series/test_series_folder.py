"""A series on disk says what it is, and what is wrong with it."""

import json

import numpy as np
import pytest

from analysis.series import folder
from analysis.series.lightings import hemisphere, unit
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.formats import images
from interchange.frames import look_at
from interchange.problems import BrightfieldError, FileError
from interchange.series import Series

ANGLES = hemisphere(np.radians([20, 60]), 4)


def made(rng, lamps=8, size=6):
    wi = unit(ANGLES)[:lamps]
    return Series(rng.random((lamps, size, size + 1, 1)) + 0.1, wi, np.linspace(1, 2, lamps))


def test_a_round_trip_loses_nothing(tmp_path):
    rng = np.random.default_rng(0)
    series = made(rng)
    valid = rng.random(series.images.shape[:3]) > 0.1
    series = Series(series.images, series.wi, series.irradiance, valid=valid)
    again = folder.read(folder.write(tmp_path, series))
    assert np.array_equal(again.usable, valid)
    assert np.array_equal(again.images[valid], series.images[valid])
    np.testing.assert_allclose(again.wi, series.wi, atol=1e-15)
    np.testing.assert_allclose(again.irradiance, series.irradiance)


def test_near_lamps_come_back_where_they_stood(tmp_path):
    """E = I / d² and w = (p - x) / d, of a lamp over the middle pixel and seen from the corner."""
    camera = Camera(
        "c", look_at(np.array([0, 0, 0.5]), np.zeros(3), (0, 1, 0)), Lens(projection=Projection.ORTHOGRAPHIC),
        Sensor((5, 5), (0.01, 0.01)),
    )  # fmt: skip
    rng = np.random.default_rng(1)
    images.write(tmp_path / "0.png", rng.integers(0, 4095, (5, 5)).astype(np.uint16))
    entry = {"image": "0.png", "position": [0, 0, 0.1], "strength": 2.0}
    data = {"quantity": "DN", "camera": folder.camera_record(camera), "images": [entry]}
    folder.write_json(tmp_path / "series.json", data)
    series = folder.read(tmp_path)
    corner = np.array([-0.02, 0.02, 0.0])
    to = np.array([0, 0, 0.1]) - corner
    np.testing.assert_allclose(series.irradiance[0, 2, 2], 2 / 0.01)
    np.testing.assert_allclose(series.irradiance[0, 0, 0], 2 / (to @ to))
    np.testing.assert_allclose(series.wi[0, 0, 0], to / np.linalg.norm(to), atol=1e-6)
    again = folder.read(folder.write(tmp_path / "again", series))
    np.testing.assert_allclose(again.irradiance, series.irradiance, rtol=1e-6)


def written(tmp_path, count=3, **head):
    for k in range(count):
        images.write(tmp_path / f"{k}.png", np.full((2, 3), 100 * (k + 1), np.uint16))
    entries = [{"image": f"{k}.png", "direction": [0.1 * k, 0, 2]} for k in range(count)]
    data = {"images": entries, **head}
    (tmp_path / "series.json").write_text(json.dumps(data))
    return data


def test_dn_become_light_and_saturated_pixels_are_marked(tmp_path):
    written(tmp_path, black_level=50, saturation=300, exposure=0.5, responsivity=10)
    series = folder.read(tmp_path)
    np.testing.assert_allclose(series.grey[:, 0, 0], [10, 30, 50])  # (DN - 50) / 0.5 s / 10
    assert series.usable[:, 0, 0].tolist() == [True, True, False]
    assert series.quantity == "radiance"


def test_missing_images_are_named_and_can_be_left_out(tmp_path):
    written(tmp_path)
    (tmp_path / "1.png").unlink()
    with pytest.raises(
        FileError, match=r"1 of 3 images are missing: 1\.png\. Capture again .* --without-missing"
    ):
        folder.read(tmp_path)
    assert folder.read(tmp_path, without_missing=True).names == ("0.png", "2.png")


def test_every_problem_is_told_at_once(tmp_path):
    data = written(tmp_path)
    data["images"][0] = {"image": "0.png", "direction": [0, 0, 0]}
    data["images"][1] = {"image": "1.png", "direction": [0, 0, 1], "position": [0, 0, 1]}
    data["images"][2] = {"image": "2.png", "dirction": [0, 0, 1], "strength": -1}
    (tmp_path / "series.json").write_text(json.dumps(data))
    with pytest.raises(FileError) as error:
        folder.read(tmp_path)
    text = str(error.value)
    for part in ("must not be zero", "and not both", 'Did you mean "direction"?', "must be a number above 0"):
        assert part in text


def test_images_of_other_sizes_are_refused(tmp_path):
    written(tmp_path)
    images.write(tmp_path / "2.png", np.zeros((3, 3), np.uint16))
    with pytest.raises(FileError, match=r"2\.png has 3 x 3 px and 1 channels, the first 3 x 2 px"):
        folder.read(tmp_path)


def test_a_series_must_fit_together():
    rng = np.random.default_rng(2)
    with pytest.raises(BrightfieldError, match="must have wi of shape"):
        Series(rng.random((3, 2, 2, 1)), unit(ANGLES)[:2])
    with pytest.raises(BrightfieldError, match="unit vectors; one has length 2"):
        Series(rng.random((1, 2, 2, 1)), np.array([[0, 0, 2.0]]))
    with pytest.raises(BrightfieldError, match="irradiance above 0"):
        Series(rng.random((1, 2, 2, 1)), np.array([[0, 0, 1.0]]), np.zeros(1))

"""A distorted image gathered from a wide pinhole one."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.camera import Camera, Lens, Sensor
from interchange.distortion import LensModel
from interchange.problems import BrightfieldError
from offline.gathering import Gathering, pick
from offline.wide import bands, is_native, oversampling, wide_camera

DISTORTION = (-0.28, 0.11, 0.0012, -0.0009, 0.02, 0.03, -0.01, 0.004)
CAMERA = Camera(
    "camera",
    lens=Lens(6e-3, distortion=DISTORTION),
    sensor=Sensor((80, 60), (80e-6, 78e-6)),
    principal_point=(42.0, 28.5),
)
LENSES = {
    "8 parameters": CAMERA.lens,
    "pincushion": Lens(6e-3, distortion=(0.1, 0.05, 0, 0, 0, 0, 0, 0)),
    "no distortion": Lens(6e-3),
    "14 parameters": Lens(6e-3, distortion=(*DISTORTION, 0.01, -0.003, -0.008, 0.002, 0.06, -0.04)),
    "fisheye": Lens(3e-3, distortion=(-0.03, 0.01, -0.004, 0.001), model=LensModel.FISHEYE),
}


def places(wide: Camera, camera: Camera) -> np.ndarray:
    """(h, w, 2) where each fine pixel falls on the sensor, px."""
    w, h = wide.sensor.resolution
    column, row = np.meshgrid(np.arange(w), np.arange(h))
    fine, K = wide.K, camera.K
    u, v = camera.lens.distort((column - fine[0, 2]) / fine[0, 0], (row - fine[1, 2]) / fine[1, 1])
    return np.stack([K[0, 0] * u + K[0, 2], K[1, 1] * v + K[1, 2]], axis=-1)


def gathered(plane: np.ndarray, wide: Camera, camera: Camera) -> np.ndarray:
    gathering = Gathering(wide, camera)
    gathering.add({"a": plane})
    return gathering.means()["a"]


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
@pytest.mark.parametrize("samples", [4, 16, 64])
def test_the_centroid_of_what_a_pixel_gathers_is_its_centre(lens, samples):
    camera = replace(CAMERA, lens=lens)
    fine, _ = oversampling(samples)
    wide = wide_camera(camera, fine)
    found = gathered(places(wide, camera), wide, camera)
    column, row = np.meshgrid(np.arange(80), np.arange(60))
    off = np.hypot(found[..., 0] - column, found[..., 1] - row)
    # tents keep first moments: what is left is the lens's curvature within a fine pixel, as 1 / fine²
    assert off.max() < 0.01 / fine**2
    if samples == 64:
        assert off.max() < 0.001


def test_a_pixel_gathers_from_little_more_than_its_square():
    """Its variance along an axis: 1/12 of the square and three times the fine pixel's, 3 h² / 12."""
    camera = replace(CAMERA, lens=LENSES["no distortion"])
    fine, _ = oversampling(64)
    wide = wide_camera(camera, fine)
    place = places(wide, camera)
    # the constant within a fine pixel adds the first of the three
    squared = gathered(place**2 + 1 / (12 * fine**2), wide, camera) - gathered(place, wide, camera) ** 2
    assert 12 * squared[20:40, 20:60, 0].mean() == pytest.approx(
        1 + 3 / fine**2, abs=2e-3
    )  # float32 of 60² px²


def test_an_even_image_stays_even():
    wide = wide_camera(CAMERA, 3)
    w, h = wide.sensor.resolution
    assert gathered(np.full((h, w, 1), 0.7), wide, CAMERA) == pytest.approx(0.7)


def test_the_centre_of_a_pixel_is_the_nearest_fine_one():
    wide = wide_camera(CAMERA, 6)
    found = np.zeros((60, 80, 2))
    pick(places(wide, CAMERA), wide, CAMERA, 0, found)
    column, row = np.meshgrid(np.arange(80), np.arange(60))
    off = np.hypot(found[..., 0] - column, found[..., 1] - row)
    assert off.max() < 0.2  # half a fine pixel's diagonal, stretched by the lens


def test_bands_make_the_same_image_as_the_whole(monkeypatch):
    monkeypatch.setattr("offline.wide.BAND", 20_000)
    wide = wide_camera(CAMERA, 4)
    plane = np.random.default_rng(1).random((*wide.sensor.resolution[::-1], 2), np.float32)
    whole, gathering = gathered(plane, wide, CAMERA), Gathering(wide, CAMERA)
    found = [np.zeros((60, 80, 2), np.float32) for _ in range(2)]
    pick(plane, wide, CAMERA, 0, found[0])
    parts = list(bands(wide))
    assert len(parts) > 3
    for first, band in parts:
        rows = band.sensor.resolution[1]
        gathering.add({"a": plane[first : first + rows]}, first)
        pick(plane[first : first + rows], wide, CAMERA, first, found[1])
        assert np.allclose(band.rays(np.array([3.0, 2.0]))[1], wide.rays(np.array([3.0, 2.0 + first]))[1])
    assert gathering.means()["a"] == pytest.approx(whole, rel=1e-6)  # sums in another order
    assert np.array_equal(*found)


def test_a_budget_of_samples_is_met():
    for samples in range(8, 600):
        fine, each = oversampling(samples)
        assert abs(fine**2 * each / samples - 1) < 0.15
    assert oversampling(64) == (8, 1)
    assert oversampling(256) == (8, 4)
    assert oversampling(64, denoised=True) == (4, 4)
    assert oversampling(81, denoised=True) == (3, 9)


def test_a_lens_that_folds_inside_the_image_is_refused():
    with pytest.raises(BrightfieldError, match="folds inside it"):
        wide_camera(replace(CAMERA, lens=Lens(2e-3, distortion=(-0.5, 0, 0, 0, 0, 0, 0, 0))), 2)


def test_a_camera_without_distortion_needs_no_detour():
    assert not is_native(CAMERA)
    assert is_native(replace(CAMERA, lens=Lens(6e-3)))  # whatever sides its pixels have
    assert not is_native(replace(CAMERA, lens=Lens(6e-3), sensor=Sensor((80, 60), (80e-6, 80e-6 / 201))))

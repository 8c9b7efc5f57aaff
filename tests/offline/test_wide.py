"""A distorted image gathered from a wide pinhole one."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.camera import Camera, Lens, Sensor, distort
from interchange.problems import BrightfieldError
from offline.wide import gather, is_native, oversampling, pick, wide_camera

DISTORTION = (-0.28, 0.11, 0.0012, -0.0009, 0.02, 0.03, -0.01, 0.004)
CAMERA = Camera(
    "camera",
    lens=Lens(6e-3, distortion=DISTORTION),
    sensor=Sensor((80, 60), (80e-6, 78e-6)),
    principal_point=(42.0, 28.5),
)


def places(wide: Camera, camera: Camera) -> np.ndarray:
    """(h, w, 2) where each fine pixel falls on the sensor, px."""
    w, h = wide.sensor.resolution
    column, row = np.meshgrid(np.arange(w), np.arange(h))
    fine, K = wide.K, camera.K
    u, v = distort(
        (column - fine[0, 2]) / fine[0, 0], (row - fine[1, 2]) / fine[1, 1], camera.lens.distortion
    )
    return np.stack([K[0, 0] * u + K[0, 2], K[1, 1] * v + K[1, 2]], axis=-1)


@pytest.mark.parametrize("distortion", [DISTORTION, (0.1, 0.05, 0, 0, 0, 0, 0, 0), (0.0,) * 8])
def test_the_centroid_of_what_a_pixel_gathers_is_its_centre(distortion):
    camera = replace(CAMERA, lens=Lens(6e-3, distortion=distortion))
    wide = wide_camera(camera, oversampling(64))
    found = gather({"place": places(wide, camera)}, wide, camera)["place"]
    column, row = np.meshgrid(np.arange(80), np.arange(60))
    off = np.hypot(found[..., 0] - column, found[..., 1] - row)
    assert off.max() < 0.005  # six fine pixels to one: what is left is the curvature within a fine pixel
    nearest = pick(places(wide, camera), wide, camera)
    assert (
        np.hypot(nearest[..., 0] - column, nearest[..., 1] - row).max() < 0.2
    )  # half a fine pixel's diagonal


def test_an_even_image_stays_even():
    wide = wide_camera(CAMERA, 3)
    w, h = wide.sensor.resolution
    assert gather({"a": np.full((h, w, 1), 0.7)}, wide, CAMERA)["a"] == pytest.approx(0.7)


def test_a_lens_that_folds_inside_the_image_is_refused():
    with pytest.raises(BrightfieldError, match="folds inside it"):
        wide_camera(replace(CAMERA, lens=Lens(2e-3, distortion=(-0.5, 0, 0, 0, 0, 0, 0, 0))), 2)


def test_square_pixels_without_distortion_need_no_detour():
    assert not is_native(CAMERA)
    assert is_native(Camera("camera", sensor=Sensor((80, 60), (8e-5, 8e-5))))

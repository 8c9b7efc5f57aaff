"""The camera model is OpenCV's."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interchange.camera import Camera, Lens, Projection, Sensor, undistort
from interchange.frames import look_at

DISTORTION = (-0.28, 0.11, 0.0012, -0.0009, 0.02, 0.03, -0.01, 0.004)


def camera(distortion=DISTORTION):
    return Camera(
        world_from_camera=look_at(np.array([0.1, -0.4, 0.5]), np.zeros(3)),
        lens=Lens(16e-3, distortion=distortion),
        sensor=Sensor((1280, 960), (15e-6, 14.5e-6)),
        principal_point=(655.3, 470.8),
    )


def test_projection_is_opencvs():
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (200, 3))
    c = camera()
    rvec, _ = cv2.Rodrigues(c.camera_from_world[:3, :3])
    expected, _ = cv2.projectPoints(points, rvec, c.camera_from_world[:3, 3], c.K, np.array(DISTORTION))
    assert c.project(points) == pytest.approx(expected[:, 0], abs=1e-9)


@given(column=st.floats(0, 1279), row=st.floats(0, 959), distance=st.floats(0.05, 5))
@settings(max_examples=50, deadline=None)
def test_a_ray_projects_onto_its_pixel(column, row, distance):
    c = camera()
    origin, direction = c.rays(np.array([column, row]))
    assert c.project(origin + distance * direction) == pytest.approx([column, row], abs=1e-6)


def test_telecentric_camera_keeps_size_with_distance():
    c = Camera(
        world_from_camera=look_at(np.array([0, 0, 1.0]), np.zeros(3)),
        lens=Lens(projection=Projection.ORTHOGRAPHIC),
        sensor=Sensor((640, 480), (50e-6, 50e-6)),
    )
    near, far = c.project(np.array([[0.005, 0, 0.5], [0.005, 0, -0.5]]))
    assert near == pytest.approx(far)
    assert abs(near[0] - 319.5) == pytest.approx(100)  # 5 mm at 50 µm a pixel


def test_behind_the_camera_is_nowhere():
    assert np.isnan(camera().project(np.array([[0.2, -0.8, 1.0]]))).all()


def test_where_the_lens_folds_there_is_no_ray():
    x, _ = undistort(np.array(5.0), np.array(0.0), (-0.28, 0, 0, 0, 0, 0, 0, 0))
    assert np.isnan(x)


def test_half_the_width_shows_the_same_field():
    whole, half = camera(), camera().resized(640)
    corner = whole.rays(np.array([-0.5, -0.5]))[1]
    assert half.rays(np.array([-0.5, -0.5]))[1] == pytest.approx(corner, abs=1e-12)

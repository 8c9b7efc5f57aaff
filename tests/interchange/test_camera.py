"""The camera model is OpenCV's."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interchange.camera import Camera, Lens, Projection, Sensor, undistort
from interchange.distortion import LensModel, widest
from interchange.frames import apply, look_at
from interchange.parameter import ParameterError

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


FOURTEEN = (*DISTORTION, 0.003, -0.002, -0.004, 0.001, 0.05, -0.03)
KANNALA = (-0.03, 0.01, -0.004, 0.001)


@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_every_opencv_model_is_opencvs(count):
    points = np.random.default_rng(count).uniform(-0.1, 0.1, (200, 3))
    d = FOURTEEN[:count]
    c = camera(d)
    rvec, _ = cv2.Rodrigues(c.camera_from_world[:3, :3])
    expected, _ = cv2.projectPoints(points, rvec, c.camera_from_world[:3, 3], c.K, np.array(d))
    pixels = c.project(points)
    assert pixels == pytest.approx(expected[:, 0], abs=1e-9)
    origin, direction = c.rays(pixels)
    back = np.cross(points - origin, direction)  # 1e-11 m at 0.6 m is 1e-8 px
    assert np.abs(back).max() < 1e-11


def test_fisheye_is_opencvs():
    """Up to 85° from the axis."""
    angle, turn = np.random.default_rng(1).uniform(0, [np.radians(85), 2 * np.pi], (200, 2)).T
    rays = np.stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)], -1)
    c = camera()
    c = replace(c, lens=Lens(2e-3, distortion=KANNALA, model=LensModel.FISHEYE))
    points = apply(c.world_from_camera, rays)
    rvec, _ = cv2.Rodrigues(c.camera_from_world[:3, :3])
    expected, _ = cv2.fisheye.projectPoints(
        points[:, None], rvec, c.camera_from_world[:3, 3], c.K, np.array(KANNALA)
    )
    pixels = c.project(points)
    assert pixels == pytest.approx(expected[:, 0], abs=1e-9)
    assert c.rays(pixels)[1] == pytest.approx(rays @ c.world_from_camera[:3, :3].T, abs=1e-12)


def test_a_fisheye_sees_nothing_at_right_angles_or_where_its_image_shrinks():
    lens = Lens(distortion=(0, 0, 0, 0), model=LensModel.FISHEYE)
    x, _ = lens.undistort(np.array([1.57, 1.58]), np.zeros(2))
    assert np.isfinite(x[0])
    assert np.isnan(x[1])
    turned = Lens(distortion=(-0.3, 0, 0, 0), model=LensModel.FISHEYE)  # grows up to θ = 1.054
    x, _ = turned.undistort(np.array([0.70, 0.71]), np.zeros(2))
    assert np.tan(widest(turned.distortion)) > x[0] > 1
    assert np.isnan(x[1])


def test_distortion_is_filled_up_with_zeros():
    assert Lens(distortion=FOURTEEN[:5]).distortion == (*FOURTEEN[:5], 0, 0, 0)
    assert Lens(distortion=FOURTEEN[:12]).distortion == (*FOURTEEN[:12], 0, 0)
    assert Lens(distortion=(*FOURTEEN[:8], 0, 0, 0, 0, 0, 0)).distortion == FOURTEEN[:8]
    with pytest.raises(ParameterError, match="up to 14 finite numbers"):
        Lens(distortion=(0.0,) * 15)
    with pytest.raises(ParameterError, match="up to 4 finite numbers"):
        Lens(distortion=(0.0,) * 5, model=LensModel.FISHEYE)
    with pytest.raises(ParameterError, match="finite"):
        Lens(distortion=(np.nan,))
    with pytest.raises(ParameterError, match="perspective"):
        Lens(model=LensModel.FISHEYE, projection=Projection.ORTHOGRAPHIC)

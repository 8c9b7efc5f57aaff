"""A projector is a camera that emits: its geometry, its power, its patterns."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.distortion import LensModel
from interchange.frames import look_at
from interchange.lamps.projecting import defocused, gray_code, laser_line, projector, stripes
from interchange.light import LightKind
from interchange.power import emitted_power
from interchange.problems import BrightfieldError
from interchange.projector import of_camera

BENT = (-0.2, 0.08, 0.002, -0.001, 0.01, 0.02, -0.01, 0.003, 0.001, 0.0, -0.002, 0.0, 0.02, -0.01)
LENSES = {
    "pinhole": Lens(8e-3),
    "rational, prism, tilted": Lens(8e-3, distortion=BENT),
    "fisheye": Lens(5e-3, distortion=(0.05, -0.01, 0.0, 0.0), model=LensModel.FISHEYE),
}


def camera_of(lens: Lens, size: tuple[int, int] = (64, 48)) -> Camera:
    pose = look_at(np.array([0.1, -0.2, 0.5]), np.array([0.0, 0.05, 0.0]))
    return Camera(
        "/p", pose, lens, Sensor(size, (8e-3 / size[0], 8e-3 / size[0])), principal_point=(30.0, 25.0)
    )


@pytest.mark.parametrize("lens", LENSES)
def test_a_ray_lights_what_the_camera_would_see(lens: str) -> None:
    """World points, seen by the camera and lit by the projector, fall on the same pixel."""
    camera = camera_of(LENSES[lens])
    light = projector(camera, np.ones((48, 64, 1)), intensity=1.0)
    assert light.projector is not None
    points = np.random.default_rng(1).uniform([-0.05, -0.03, -0.05], [0.05, 0.1, 0.05], (200, 3))
    R, t = light.world_from_light[:3, :3], light.world_from_light[:3, 3]
    direction = (points - t) @ R
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    pixels = light.projector.pixels(direction)
    assert pixels == pytest.approx(camera.project(points), abs=1e-9)
    assert light.projector.directions(pixels) == pytest.approx(direction, abs=1e-9)
    if LENSES[lens].model is LensModel.OPENCV:
        rvec, _ = cv2.Rodrigues(camera.camera_from_world[:3, :3])
        seen, _ = cv2.projectPoints(
            points, rvec, camera.camera_from_world[:3, 3], camera.K, np.array(LENSES[lens].distortion)
        )
        assert pixels == pytest.approx(seen[:, 0], abs=1e-6)


def test_the_image_is_its_value_at_pixel_centres_and_half_at_its_border() -> None:
    rng = np.random.default_rng(0)
    image = rng.uniform(0, 1, (48, 64, 3)).astype(np.float32)
    shown = of_camera(camera_of(LENSES["rational, prism, tilted"]), image)
    column, row = np.meshgrid(np.arange(64.0), np.arange(48.0))
    values = shown.evaluate(shown.directions(np.stack([column, row], -1)))
    assert values == pytest.approx(image, abs=1e-5)
    edge = shown.evaluate(shown.directions(np.array([[-0.5, 20.0], [-1.0, 20.0], [63.5, 3.0]])))
    assert edge[0] == pytest.approx(image[20, 0] / 2, abs=1e-5)
    assert edge[1] == pytest.approx(0, abs=1e-6)
    assert edge[2] == pytest.approx(image[3, 63] / 2, abs=1e-5)
    assert (shown.evaluate(np.array([0.0, 0.0, 1.0])) == 0).all()  # behind


@settings(deadline=None, max_examples=10)
@given(tan_x=st.floats(0.05, 0.8), tan_y=st.floats(0.05, 0.8))
def test_a_white_image_has_the_solid_angle_of_its_frame(tan_x: float, tan_y: float) -> None:
    """Ω = 4 asin(sin a sin b) for a pyramid of half-angles a and b; no cos⁴ in it."""
    size = (40, 30)
    pitch = (2 * tan_x * 1e-2 / size[0], 2 * tan_y * 1e-2 / size[1])
    camera = Camera("/p", np.eye(4), Lens(1e-2), Sensor(size, pitch))
    light = projector(camera, np.ones((30, 40, 1)), intensity=2.0)
    a, b = np.arctan(tan_x), np.arctan(tan_y)
    # the border's ramp is as wide on both sides; on a curve, over a pixel: 1/12 px² of the second derivative
    assert emitted_power(light) == pytest.approx([8 * np.arcsin(np.sin(a) * np.sin(b))] * 3, rel=3e-3)


def test_a_pixels_power_is_its_solid_angle() -> None:
    """I cos³ θ / (fx fy)."""
    camera = Camera("/p", np.eye(4), Lens(8e-3), Sensor((64, 48), (1e-4, 1e-4)))
    image = np.zeros((48, 64, 1))
    image[10, 50] = 1.0
    light = projector(camera, image, intensity=3.0)
    x, y = (50 - 31.5) / 80, (10 - 23.5) / 80
    cos3 = (1 + x * x + y * y) ** -1.5
    # a pixel's tent covers 32 x 32 points of the sum
    assert emitted_power(light) == pytest.approx([3.0 * cos3 / 80**2] * 3, rel=5e-3)


def test_power_and_colour() -> None:
    camera = camera_of(LENSES["fisheye"])
    light = projector(camera, stripes((64, 48), 8), power=5.0, color=(0.5, 1.0, 1.5))
    assert emitted_power(light).mean() == pytest.approx(5.0)
    assert light.kind is LightKind.SPHERE
    assert light.is_delta
    red = np.ones((48, 64, 3)) * (1.0, 0.25, 0.0)  # an image keeps its colour
    assert emitted_power(projector(camera, red, power=5.0)) == pytest.approx([12.0, 3.0, 0.0])


def test_patterns() -> None:
    fringes = [stripes((60, 4), 12, phase)[..., 0] for phase in (0, np.pi / 2, np.pi, 3 * np.pi / 2)]
    found = np.arctan2(fringes[3] - fringes[1], fringes[0] - fringes[2])[0]
    assert np.unwrap(found) == pytest.approx(2 * np.pi * np.arange(60) / 12, abs=1e-5)
    bits = np.stack([b[0, :, 0] for b in gray_code((60, 4))])
    assert bits.shape == (6, 60)
    assert (np.abs(np.diff(bits, axis=1)).sum(axis=0) == 1).all()  # one bit changes from column to column
    line = laser_line((61, 5), 4.0)[0, :, 0]
    assert line[30] == 1
    assert line[32] == pytest.approx(np.exp(-2))
    assert laser_line((5, 61), 4.0, 12.0, vertical=False)[12, 0, 0] == 1


def test_mistakes_are_told() -> None:
    camera = camera_of(LENSES["pinhole"])
    with pytest.raises(BrightfieldError, match="64 x 48 px and 1 or 3 channels"):
        projector(camera, np.ones((64, 48, 1)), intensity=1.0)
    with pytest.raises(BrightfieldError, match="one of them"):
        projector(camera, np.ones((48, 64, 1)))
    with pytest.raises(BrightfieldError, match="lets none out"):
        projector(camera, np.zeros((48, 64, 1)), power=1.0)
    with pytest.raises(BrightfieldError, match="must be perspective"):
        projector(
            replace(camera, lens=Lens(projection=Projection.ORTHOGRAPHIC)),
            np.ones((48, 64, 1)),
            intensity=1.0,
        )


def test_a_projectors_aperture_blurs_what_is_not_at_its_focus() -> None:
    """A point becomes a disc of v² |z - z_f| / (N z_f z) with its second moment, d² / 16, to the disc's 7 %."""
    lens = Lens(0.02, f_stop=2.0, focus_distance=0.5)
    camera = Camera(lens=lens, sensor=Sensor((81, 61), (8e-6, 8e-6)))
    point = np.zeros((61, 81, 1), np.float32)
    point[30, 40] = 1
    assert np.array_equal(defocused(point, camera, 0.5), point)
    out = defocused(point, camera, 0.6)[..., 0]
    diameter = 0.02**2 * 0.1 / (2.0 * 0.5 * 0.6) / 8e-6
    x = np.arange(81) - 40
    assert out.sum() == pytest.approx(1, rel=1e-5)
    assert (out.sum(axis=0) * x**2).sum() == pytest.approx(diameter**2 / 16, rel=0.07)
    white = defocused(np.ones((61, 81, 1), np.float32), camera, 0.6)[..., 0]
    assert white[30, 40] == pytest.approx(1, rel=1e-5)
    assert white[30, 0] == pytest.approx(
        0.5, abs=0.1
    )  # half of the light beyond the edge's middle is not there
    with pytest.raises(BrightfieldError, match="f-number"):
        defocused(point, replace(camera, lens=Lens()), 0.6)

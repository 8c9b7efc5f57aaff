"""What time does to irradiance: paths, shutters and line cameras, against closed forms and means over moments."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from scipy.integrate import quad

from interchange.effects import line_scan
from interchange.effects.line_scan import LineScan
from interchange.effects.motion_blur import MotionBlur
from interchange.effects.rolling_shutter import RollingShutter
from interchange.exposure import expose
from interchange.filtering import convolve, line
from interchange.image import Image, Quantity
from interchange.lamps.exposed import STROBED
from interchange.moments import over_exposure
from interchange.scene import Scene
from interchange.strobe import Strobe
from tests.interchange.test_effects_optics import CAMERA, blobs, moments, point


@pytest.mark.parametrize("path", [(6.0, 0.0), (0.0, 3.5), (4.0, -3.0), (0.4, 0.2)])
def test_motion_has_the_second_moment_of_a_line(path):
    """L²/12 along each axis, exactly: Lagrange's weights keep the moments."""
    out = convolve(point(channels=1).pixels, line(*path))[..., 0]
    assert out.sum() == pytest.approx(1, rel=1e-5)
    centre, variance = moments(out)
    assert centre == pytest.approx((50, 40), abs=1e-3)
    for v, length in zip(variance, path, strict=True):
        assert v == pytest.approx(length**2 / 12, abs=1e-3)


def test_a_short_path_blurs_with_the_square_of_its_length():
    """The kernel's change is 4 times as large at twice the length, not twice: no kink at a path of no length."""
    none = np.zeros((7, 7))
    none[3, 3] = 1
    short, twice = (np.abs(line(u, 0.0) - none).sum() for u in (0.1, 0.2))
    assert twice / short == pytest.approx(4, rel=0.01)  # terms of the fourth order


def rendered(at, camera, count):
    """Pixels over the camera's exposure of images at moments, s."""
    return over_exposure(
        lambda code: Scene(time=code),
        lambda _: camera,
        lambda scene, c, k, p: at(scene.time),
        0.0,
        1.0,
        count,
    ).pixels


def test_the_motion_pass_gives_what_moving_renderings_give():
    """A spot that moves by 12 px a frame, open for half of it: the effect against the mean over moments."""
    c = replace(CAMERA, t_exp=0.01, sensor=replace(CAMERA.sensor, frame_rate=50.0))
    motion = np.broadcast_to(np.array([12.0, 4.0], np.float32), (81, 101, 2)).copy()
    still = replace(blobs([(50, 40)]), passes={"motion": motion})
    got = expose(still, c, until=Quantity.IRRADIANCE).pixels
    want = rendered(lambda t: blobs([(50 + 600 * t, 40 + 200 * t)]), c, 32)
    assert got == pytest.approx(want, abs=1e-3)  # 24 steps along 6 px; a spot of σ = 3 px
    uniform = MotionBlur(6.0, 2.0).apply(blobs([(50, 40)]), c, None).pixels
    assert uniform == pytest.approx(want, abs=1e-3)


@pytest.mark.parametrize("t_exp", [0.001, 0.004])
def test_an_image_that_runs_past_a_camera_blurs_with_the_exposure_time(t_exp):
    """1500 px/s and 0.5 px of a vibration beside it, against the mean over moments of where the image is."""
    sensor = replace(CAMERA.sensor, image_path=(0.5, 0.0), image_speed=(1500.0, -500.0))
    c = replace(CAMERA, t_exp=t_exp, sensor=sensor)
    got = expose(blobs([(50, 40)]), c, until=Quantity.IRRADIANCE).pixels / t_exp
    still = replace(CAMERA, t_exp=t_exp)
    path = np.array([0.5 + 1500 * t_exp, -500 * t_exp])
    moments_ = [blobs([tuple(np.array([50, 40]) + k * path)]) for k in (np.arange(64) + 0.5) / 64 - 0.5]
    want = np.mean([expose(m, still, until=Quantity.IRRADIANCE).pixels for m in moments_], axis=0) / t_exp
    assert got == pytest.approx(want, abs=1e-3 * want.max())  # 64 steps along 6.8 px; a spot of σ = 3 px


@pytest.mark.parametrize("acceleration", [-3.0, 1.0, 2.5])
def test_a_path_that_is_run_through_ever_faster_is_where_its_moments_are(acceleration):
    """6 px to the right and 2 px up while the speed grows by exp(a): against the mean over moments, whose place solves
    x' ~ exp(a t); around the mean of its places, and no path the other way."""
    c = replace(
        CAMERA, sensor=replace(CAMERA.sensor, image_path=(6.0, -2.0), image_acceleration=acceleration)
    )
    times = (np.arange(400) + 0.5) / 400
    run = np.cumsum(np.exp(acceleration * times))
    run = run / run[-1] - np.mean(run / run[-1])
    want = np.mean([blobs([(50 + 6 * x, 40 - 2 * x)]).pixels for x in run], axis=0)
    got = MotionBlur.of(c).apply(blobs([(50, 40)]), c, None).pixels
    assert got == pytest.approx(want, abs=1e-3)
    still = replace(c, sensor=replace(c.sensor, image_path=(0.0, 0.0)))
    seen, whole = (expose(blobs([(50, 40)]), x, until=Quantity.IRRADIANCE).pixels for x in (c, still))
    assert seen / whole.max() == pytest.approx(want, abs=2e-3)  # as a camera takes it, with its other optics
    back = replace(MotionBlur.of(c), acceleration=-acceleration).apply(blobs([(50, 40)]), c, None).pixels
    assert np.abs(back - want).max() > 20e-3


@pytest.mark.parametrize("acceleration", [-2.0, 4.0])
def test_an_accelerated_path_has_its_own_moments(acceleration):
    """Mean, variance and third moment of 5 px, by quadrature."""
    kernel = line(5.0, 0.0, acceleration).sum(axis=0)
    place = -(np.arange(len(kernel)) - len(kernel) // 2)  # a weight is of what lies that far to the right

    def run(t):
        return 5 * np.expm1(acceleration * t) / np.expm1(acceleration)

    mean = quad(run, 0, 1)[0]
    for power in (1, 2, 3):
        want = quad(lambda t, n=power: (run(t) - mean) ** n, 0, 1)[0]
        assert (kernel * place**power).sum() == pytest.approx(want, abs=2e-3)  # 256 steps and more


def test_a_flash_lights_its_part_of_the_way_alone():
    """A web at 3000 px/s, 4 ms of exposure, lit for 1 ms of it from 0.5 ms on: 3 px, 3 px behind the middle."""
    c = replace(CAMERA, t_exp=0.004, sensor=replace(CAMERA.sensor, image_speed=(3000.0, 0.0)))
    flash = asdict(Strobe(start=0.0005, duration=0.001))
    made = {STROBED: {"flash": flash, "bands": [], "t_exp_s": 0.004, "line_time_s": 0.0, "seconds": 0.0}}
    spot = replace(blobs([(50, 40)]), made_by=made)
    centre, variance = moments(MotionBlur.of(c).apply(spot, c, None).pixels[..., 0])
    assert centre == pytest.approx((50 - 3, 40), abs=0.01)
    assert np.array(variance) == pytest.approx((9 + 9 / 12, 9), abs=0.03)  # drawn in eight steps


def test_a_rolling_shutter_slants_what_moves():
    """A vertical bar at 2000 px/s and 50 µs a row leans by 0.1 px a row; the same from renderings at moments."""
    c = replace(CAMERA, t_exp=1e-7, sensor=replace(CAMERA.sensor, line_time=50e-6, frame_rate=100.0))
    x = np.arange(101)

    def bar(t):
        L = np.exp(-((x - (40 + 2000 * t)) ** 2) / 18)
        return Image(np.broadcast_to(L[None, :, None], (81, 101, 3)).astype(np.float32))

    motion = np.broadcast_to(np.array([20.0, 0.0], np.float32), (81, 101, 2)).copy()
    got = expose(replace(bar(0), passes={"motion": motion}), c, until=Quantity.IRRADIANCE).pixels[..., 0]
    centre = (got * x).sum(axis=1) / got.sum(axis=1)
    assert centre == pytest.approx(40 + 0.1 * np.arange(81), abs=0.002)
    velocity = RollingShutter(50e-6, u=2000.0).apply(bar(0), c, None).pixels[..., 0]
    assert velocity == pytest.approx(got, abs=1e-4)
    want = rendered(bar, c, 320)[..., 0]
    assert got == pytest.approx(want, abs=0.01)


def test_a_line_camera_stretches_what_runs_too_slowly():
    """Two lines a pixel of motion: a spot at row 20 stands at 2 · 20.5 - 0.5, twice as tall, and exposure smears it."""
    out = LineScan(stretch=2.0).apply(blobs([(50, 20)], 2.0), CAMERA, None).pixels[..., 0]
    centre, variance = moments(out)
    assert centre == pytest.approx((50, 40.5), abs=0.02)
    assert np.sqrt(variance) == pytest.approx((2, 4), rel=0.01)
    smeared = LineScan(open_share=3.0).apply(point(), CAMERA, None).pixels[:, 50, 0]
    assert smeared[37:44] == pytest.approx([0, 0, 1 / 3, 1 / 3, 1 / 3, 0, 0], abs=1e-6)
    lines = [blobs([(50, 40 - k)]) for k in range(30)]
    assert line_scan.assemble(lines, 40).pixels.shape == (30, 101, 3)

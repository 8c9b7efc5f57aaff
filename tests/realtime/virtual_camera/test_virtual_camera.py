"""Laws of the live camera: what is set is what the sensor does, and the truth is what was set."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from interchange.image import Image, Quantity
from interchange.problems import BrightfieldError
from interchange.sensor import Mosaic
from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.drawing import Drawing
from realtime.virtual_camera.moving_scene import MovingScene


@pytest.fixture(scope="module")
def drawing():
    shared = Drawing()  # shaders are compiled once for all tests
    yield shared
    shared.release()


@pytest.fixture
def camera(bench, drawing):
    with VirtualCamera(bench, format="Mono12", draw=drawing) as one:
        yield one


def test_numbers_and_times_go_up_by_one_frame(empty, live):
    with VirtualCamera(empty, "Top", draw=live.Pattern(), frame_rate=50) as camera:
        truths = [camera.take().truth for _ in range(5)]
    assert [t.number for t in truths] == [1, 2, 3, 4, 5]
    np.testing.assert_allclose([t.seconds for t in truths], np.arange(5) / 50)
    stamps = [t.stamp_ns for t in truths]
    assert stamps == sorted(stamps)


def test_the_same_calls_give_the_same_numbers_and_another_seed_others(bench, drawing):
    def second(seed):
        with VirtualCamera(bench, draw=drawing, seed=seed) as camera:
            camera.read()
            return camera.read()[1]

    np.testing.assert_array_equal(second(1), second(1))
    assert (second(1) != second(2)).any()


@pytest.mark.parametrize(("t_exp", "gain_dB"), [(2e-3, 0.0), (1e-3, 6.0), (5e-4, 12.0)])
def test_dn_above_black_go_with_exposure_time_and_with_gain_in_dB(camera, t_exp, gain_dB):
    """DN - black = c t 10^(g / 20): EMVA 1288, 3."""

    def white():
        return np.mean([camera.read()[1][24:30, 35:41] for _ in range(8)]) - 64

    one = white()
    camera.configure(t_exp=t_exp, gain_dB=gain_dB)
    # 288 pixels of 509 or, at half the time, 255 e-, with 5 e- of read noise: σ of the ratio 0.47 %; four of it
    assert white() / one == pytest.approx(t_exp / 1e-3 * 10 ** (gain_dB / 20), rel=0.019)


@pytest.mark.parametrize("gain_dB", [0.0, 12.0])
@pytest.mark.parametrize("electrons", [0.5, 20.0, 255.0])
def test_the_mean_of_dark_frames_is_that_of_their_electrons(bench, gain_dB, electrons):
    """DN - black = K e 10^(g / 20), and its variance K² 10^(g / 10) (e + σ_d²) + 1/12, where noise outweighs light too:
    nothing of it is cut off below, as black lies eight σ above zero."""
    sensor = replace(bench.cameras[0].sensor, resolution=(320, 240))
    scene = replace(bench, cameras=(replace(bench.cameras[0], sensor=sensor),))
    radiance = electrons / (sensor.responsivity * 5e-4)

    def even(scene, camera, passes):
        return Image(np.full((240, 320, 3), radiance, np.float32), Quantity.RADIANCE, camera)

    with VirtualCamera(scene, format="Mono12", draw=even, t_exp=5e-4, gain_dB=gain_dB) as camera:
        dn = np.stack([camera.read()[1] for _ in range(2)]).astype(float) - 64
    K = (4095 - 64) / 10_000 * 10 ** (gain_dB / 20)
    variance = K**2 * (electrons + 25) + 1 / 12
    # four σ of the mean over N pixels, and of their variance, relatively the root of 2 / N
    assert dn.mean() == pytest.approx(K * electrons, abs=4 * np.sqrt(variance / dn.size))
    assert dn.var() == pytest.approx(variance, rel=4 * np.sqrt(2 / dn.size))


def test_a_frame_has_the_noise_of_its_sensor(camera):
    """Variance over pixels of two frames' difference, halved, is K (DN - black) + K² σ_d² + 1/12."""
    a, b = (camera.read()[1][20:28, 30:40].astype(float) for _ in range(2))
    a2, b2 = (camera.read()[1][20:28, 30:40].astype(float) for _ in range(2))
    K = (4095 - 64) / 10_000
    expected = K * (a.mean() - 64) + K**2 * 25 + 1 / 12
    measured = (np.var(a - b) + np.var(a2 - b2)) / 4
    assert measured == pytest.approx(expected, rel=0.45)  # 160 pixels: a relative σ of 0.11; four of it


def test_formats_are_readings_of_the_same_sensor(bench, drawing):
    """Mono8 is Mono12 over 16 (4095 to 255), Bayer is the mosaic of RGB, and read gives RGB as B, G, R."""
    lamp = replace(bench.lights[0], intensity=(1.0, 0.6, 0.3))
    scene = replace(bench, lights=(lamp,))
    found = {}
    for name in ("Mono8", "Mono12", "RGB8", "BayerRG8"):
        with VirtualCamera(scene, draw=drawing, noise=False, format=name) as camera:
            found[name] = camera.take()
    mono8, mono12 = (found[n].pixels.astype(float) for n in ("Mono8", "Mono12"))
    assert np.abs(mono8 - mono12 * 255 / 4095).max() <= 0.51  # rounded
    rgb, bayer = found["RGB8"].pixels, found["BayerRG8"].pixels
    np.testing.assert_array_equal(bayer[0::2, 0::2], rgb[0::2, 0::2, 0])
    np.testing.assert_array_equal(bayer[0::2, 1::2], rgb[0::2, 1::2, 1])
    np.testing.assert_array_equal(bayer[1::2, 1::2], rgb[1::2, 1::2, 2])
    np.testing.assert_array_equal(found["RGB8"].bgr, rgb[..., ::-1])
    assert rgb[24, 36, 0] > rgb[24, 36, 1] > rgb[24, 36, 2]


def test_a_sensor_gives_its_own_formats_alone(bench, live):
    mono = replace(
        bench.cameras[0], sensor=replace(bench.cameras[0].sensor, mosaic=Mosaic.MONO, bit_depth=10)
    )
    with VirtualCamera(replace(bench, cameras=(mono,)), draw=live.Pattern()) as camera:
        assert camera.formats == ("Mono8", "Mono10")
        with pytest.raises(BrightfieldError, match="mono sensor of 10 bits gives Mono8, Mono10; got RGB8"):
            camera.configure(format="RGB8")
        with pytest.raises(BrightfieldError, match='Did you mean "Mono8"'):
            camera.configure(format="Mono9")


def test_a_region_is_a_part_of_the_whole_frame_noise_included(bench, drawing):
    whole, part = (VirtualCamera(bench, draw=drawing, format="Mono8") for _ in range(2))
    part.configure(region=(10, 6, 30, 20))
    full, cut = whole.take(), part.take()
    np.testing.assert_array_equal(cut.pixels, full.pixels[6:26, 10:40])
    point = np.array([0.02, -0.01, 0.0])
    np.testing.assert_allclose(cut.truth.project(point), full.truth.project(point) - [10, 6])
    np.testing.assert_allclose(cut.truth.K @ [0, 0, 1], full.truth.K @ [0, 0, 1] - [10, 6, 0])
    with pytest.raises(BrightfieldError, match="must lie on the sensor's 64 x 48 px"):
        part.configure(region=(40, 0, 30, 20))
    assert part.settings.region == (10, 6, 30, 20)


def test_one_software_trigger_gives_one_frame(empty, live):
    with VirtualCamera(empty, "Top", draw=live.Pattern(), triggered=True, timeout=0.05) as camera:
        assert camera.read() == (False, None)
        camera.trigger()
        assert camera.read()[0]
        assert camera.read() == (False, None)
        for _ in range(3):
            camera.trigger()
        assert [camera.read()[0] for _ in range(4)] == [True, True, True, False]
        assert camera.position[0] == 4


def test_a_timer_triggers_every_period_as_long_as_exposures_are_shorter(empty, live):
    how = {"draw": live.Pattern(), "triggered": True, "trigger_period": 0.25, "frame_rate": 50}
    with VirtualCamera(empty, "Top", **how) as camera:
        assert [camera.take().truth.seconds for _ in range(3)] == [0.0, 0.25, 0.5]
        camera.configure(t_exp=0.5)
        camera.take()
        assert camera.take().truth.seconds == 1.25
        camera.configure(trigger_period=0.0)
        camera.timeout = 0.05
        assert camera.read() == (False, None), "software triggers again"


def test_the_truth_is_the_pose_that_was_set_and_what_the_pixels_show(bench, drawing, live):
    scene = MovingScene(bench)
    with VirtualCamera(scene, draw=drawing, maps=("object_id",), noise=False) as camera:
        for x, y in ((0.0, 0.0), (0.05, 0.02), (-0.04, -0.03)):
            scene.set_body_pose("/World/Part", live.at(x, y))
            frame = camera.take()
            np.testing.assert_array_equal(frame.truth.pose("/World/Part"), live.at(x, y))
            part = bench.object_names.index("/World/Part")
            rows, columns = np.nonzero(frame.maps["object_id"] == part)
            # the centre of a square's pixels is its centre within half a pixel
            seen = frame.truth.project(np.array([x, y, 0.0]))
            assert abs(seen - [columns.mean(), rows.mean()]).max() <= 0.5
        pose = bench.cameras[0].world_from_camera @ live.at(0.01, 0, 0)
        camera.set_pose(pose)
        truth = camera.take().truth
        np.testing.assert_array_equal(truth.camera.world_from_camera, pose)
        camera.set_pose(None)
        assert camera.take().truth.camera.world_from_camera is bench.cameras[0].world_from_camera


def test_a_consumer_moves_the_part_until_it_is_centred(bench, drawing):
    """The loop is closed through pixels alone: centroid, a step against the offset."""
    scene = MovingScene(bench)
    with VirtualCamera(scene, draw=drawing, format="Mono12") as camera:
        m_per_px = 0.2 / 64
        for _ in range(4):
            picture = camera.read()[1]
            light = np.float32(picture) - np.median(picture)  # the ground is most of the picture
            moments = cv2.moments(np.where(light > light.max() / 8, light, 0))
            offset = np.array([moments["m10"], moments["m01"]]) / moments["m00"] - [31.5, 23.5]
            pose = camera.take().truth.pose("/World/Part").copy()
            pose[:2, 3] -= offset * m_per_px * [1, -1]  # the camera's y points down
            scene.set_body_pose("/World/Part", pose)
        final = camera.take().truth
    assert np.abs(final.project(final.pose("/World/Part")[:3, 3]) - [31.5, 23.5]).max() < 0.5
    # px: of 2 x 2 samples a pixel, an edge is known to half a pixel


def test_properties_of_opencv(empty, live):
    with VirtualCamera(empty, "Top", draw=live.Pattern()) as camera:
        assert camera.isOpened()
        size = camera.get(cv2.CAP_PROP_FRAME_WIDTH), camera.get(cv2.CAP_PROP_FRAME_HEIGHT)
        assert size == (64, 48)
        assert camera.read()[1].shape == (48, 64, 3)
        assert camera.get(cv2.CAP_PROP_POS_FRAMES) == 1
        for prop, value in (
            (cv2.CAP_PROP_EXPOSURE, 0.004), (cv2.CAP_PROP_GAIN, 6.0), (cv2.CAP_PROP_FPS, 12.5),
            (cv2.CAP_PROP_FRAME_WIDTH, 32), (cv2.CAP_PROP_FRAME_HEIGHT, 16), (cv2.CAP_PROP_TRIGGER, 1),
            (cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"GREY")),
        ):  # fmt: skip
            assert camera.set(prop, value)
            assert camera.get(prop) == value
        camera.trigger()
        assert camera.read()[1].shape == (16, 32)
        for prop, value in (
            (cv2.CAP_PROP_FRAME_WIDTH, 65), (cv2.CAP_PROP_EXPOSURE, -1.0), (cv2.CAP_PROP_POS_FRAMES, 1),
            (cv2.CAP_PROP_HUE, 1.0), (cv2.CAP_PROP_FOURCC, 0), (cv2.CAP_PROP_FPS, float("nan")),
        ):  # fmt: skip
            assert not camera.set(prop, value)
        assert camera.get(cv2.CAP_PROP_HUE) == 0
    assert not camera.isOpened()
    assert camera.read() == (False, None)


def test_an_exposure_longer_than_the_period_slows_the_camera(empty, live):
    with VirtualCamera(empty, "Top", draw=live.Pattern(), frame_rate=100, t_exp=0.05) as camera:
        assert camera.settings.period == 0.05
        assert [camera.take().truth.seconds for _ in range(2)] == [0.0, 0.05]


def test_grab_fixes_the_moment_for_two_cameras(empty, live):
    scene = MovingScene(empty)
    pair = [VirtualCamera(scene, name, draw=live.Pattern()) for name in ("Top", "Side")]
    for camera in pair:
        assert camera.grab()
    scene.set_body_pose("/World/Part", live.at(1, 0))
    for camera in pair:
        assert camera.retrieve()[0]
        np.testing.assert_array_equal(camera.develop().truth.pose("/World/Part"), np.eye(4))
        np.testing.assert_array_equal(camera.take().truth.pose("/World/Part"), live.at(1, 0))


def test_a_frame_cannot_be_changed(empty, live):
    with VirtualCamera(empty, "Top", draw=live.Pattern()) as camera:
        frame = camera.take()
        with pytest.raises(ValueError, match="read-only"):
            frame.pixels[0, 0] = 1


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"camera": "Topp"}, 'Did you mean "Top"'),
        ({"maps": ("motion",)}, "can carry depth"),
        ({"t_exp": 0.0}, "exposure time"),
        ({"frame_rate": 0.0}, "frames a second"),
    ],
)
def test_what_cannot_be_is_one_clear_error(empty, live, wrong, message):
    with pytest.raises(BrightfieldError, match=message):
        VirtualCamera(empty, **{"camera": "Top", "draw": live.Pattern(), **wrong})


def test_live_cameras_of_one_rate_show_the_same_moments(empty, live):
    """Whenever they were started, and however late the machine is: frames are of multiples of the period."""
    scene = MovingScene(empty, live=True)
    pair = [VirtualCamera(scene, name, draw=live.Pattern(), frame_rate=200) for name in ("Top", "Side")]
    seconds = []
    for camera in pair:
        with camera:
            seconds.append([camera.take().truth.seconds for _ in range(5)])
    grid = np.array(seconds) * 200
    np.testing.assert_allclose(grid, np.rint(grid), atol=1e-6)
    assert (np.diff(grid) > 0.5).all()


def test_live_cameras_of_one_exposure_see_one_scene(empty, live):
    """What is moved between the two frames of a moment holds from the next moment on."""
    scene = MovingScene(empty, live=True)
    before = scene.at(5.0)
    scene.set_body_pose("/World/Part", live.at(1, 0))
    assert scene.at(5.0) is before
    np.testing.assert_array_equal(scene.at(5.1).scene.bodies[0].world_from_body, live.at(1, 0))

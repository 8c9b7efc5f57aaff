"""What moves while the shutter is open, against closed forms: a box blurred by a box, rows that lean."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interchange.frames import look_at
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene
from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.drawing import Drawing
from realtime.virtual_camera.joint import Conveyor
from realtime.virtual_camera.moving_scene import MovingScene, TimeLine
from realtime.virtual_camera.shutter_path import longest_path, renderings

PX = 0.2 / 64  # m of a pixel of ``bench``'s camera
PART, SIDE = "/World/Part", 0.03 / PX  # px


@pytest.fixture(scope="module")
def drawing():
    shared = Drawing(64)  # shaders are compiled once for all tests
    yield shared
    shared.release()


def carried(bench, px, length=0.0, **sensor):
    """The part on a belt that runs ``px`` during the exposure."""
    camera = bench.cameras[0]
    still = replace(
        bench, cameras=(replace(camera, sensor=replace(camera.sensor, read_noise=0.0, **sensor)),)
    )
    return MovingScene(
        still, conveyors=[Conveyor("belt", (PART,), (1, 0, 0), px * PX / camera.t_exp, length)]
    )


def shot(scene, drawing, **how):
    """Frame 1: signal (H, W) over the ground's, 1 on the part; and its truth."""
    how = {"moments": 64, **how}
    with VirtualCamera(scene, format="Mono12", draw=drawing, noise=False, **how) as camera:
        frame = camera.take()
    dark, bright = np.percentile(frame.pixels, 5), frame.pixels.max()
    return (frame.pixels - dark) / (bright - dark), frame.truth


@pytest.mark.parametrize("path", [0.0, 3.0, 6.0])
def test_a_carried_square_is_its_box_blurred_by_its_way(bench, drawing, path):
    signal, truth = shot(carried(bench, path), drawing)
    middle = truth.project(truth.pose(PART)[:3, 3])
    x = np.arange(64) - middle[0]
    lowest = (SIDE - path) / 2  # the trapezoid of two boxes, and the box of a pixel
    fine = x[:, None] + (np.arange(50) + 0.5) / 50 - 0.5
    expected = np.clip(((SIDE + path) / 2 - np.abs(fine)) / max(path, 1e-9), 0, 1).mean(axis=1)
    expected[np.abs(x) < lowest - 1] = 1
    # an edge along the columns meets 8 rows of samples a pixel: it is placed to within a 16th, and 1 DN of 200
    np.testing.assert_allclose(signal[int(middle[1])], expected, atol=0.07)
    row = signal[int(middle[1])]
    assert row @ x / row.sum() == pytest.approx(0, abs=0.03), "the truth is the exposure's middle"
    assert truth.path_px == pytest.approx(path, abs=1e-6)
    assert truth.renderings == max(1, np.ceil(path - 1e-6))


def test_rows_that_are_exposed_later_lean(bench, drawing):
    line_time = 2e-4
    scene = carried(bench, 1.0, line_time=line_time)  # 1 px/ms, and 0.2 px from row to row
    signal, truth = shot(scene, drawing)
    rows = np.flatnonzero(signal.max(axis=1) > 0.9)[1:-1]
    centres = signal[rows] @ np.arange(64) / signal[rows].sum(axis=1)
    slope, first = np.polyfit(rows, centres, 1)
    assert slope == pytest.approx(1e3 * line_time, abs=0.01)
    assert first == pytest.approx(truth.project(truth.pose(PART)[:3, 3])[0], abs=0.1), "row 0's truth"


def test_what_comes_in_again_at_the_belt_s_start_leaves_no_ghost(bench, drawing):
    """The middle of frame 1 is the moment at which the belt is at its end and its start."""
    signal, truth = shot(carried(bench, 6.0, length=0.05), drawing)
    assert truth.path_px == pytest.approx(6.0, abs=1e-6)
    assert signal[:, 40:].max() > 0.9
    assert abs(signal[:, :28]).max() < 0.02


def test_a_time_line_s_end_is_not_seen_to_jump_to_its_start(bench):
    def at(code):
        bodies = tuple(
            replace(b, world_from_body=np.array(b.world_from_body)) if b.name != PART else moved(b, code)
            for b in bench.bodies
        )
        return replace(bench, bodies=bodies, time=code)

    def moved(body, code):
        pose = body.world_from_body.copy()
        pose[0, 3] = 0.01 * code
        return replace(body, world_from_body=pose)

    scene = MovingScene(TimeLine(at, 0.0, 4.0, per_second=24.0))
    near = scene.at(0.0).near
    assert [near(t).time for t in (-0.1, 0.0, 0.1)] == [0.0, 0.0, pytest.approx(2.4)]
    assert scene.at(3.99 / 24).near(0.1).time == 4.0


def test_what_stands_or_is_put_elsewhere_is_drawn_once(bench, drawing):
    still = MovingScene(bench)
    with VirtualCamera(still, draw=drawing) as camera:
        truths = [camera.take().truth]
        still.set_body_pose(PART, np.eye(4))
        truths.append(camera.take().truth)
    with VirtualCamera(carried(bench, 6.0), draw=drawing, moments=1) as camera:
        truths.append(camera.take().truth)
    assert [(t.renderings, round(t.path_px)) for t in truths] == [(1, 0), (1, 0), (1, 6)]
    with pytest.raises(BrightfieldError, match="at least 1 rendering; got 0"):
        VirtualCamera(bench, moments=0)


def test_maps_of_a_blurred_frame_are_those_of_its_truth(bench, drawing):
    scene = carried(bench, 6.0)
    with VirtualCamera(scene, draw=drawing, maps=("object_id",)) as camera:
        blurred = camera.take()
    with VirtualCamera(scene, draw=drawing, maps=("object_id",), moments=1) as camera:
        scene.at(0.0)
        frozen = camera.take()
    np.testing.assert_array_equal(blurred.maps["object_id"], frozen.maps["object_id"])
    assert (blurred.pixels != frozen.pixels).any()


@settings(deadline=None, max_examples=30)
@given(dx=st.floats(-0.05, 0.05), dy=st.floats(-0.05, 0.05), z=st.floats(0.2, 2.0))
def test_a_camera_that_moves_along_a_plane_sees_it_pass_by_f_t_over_z(live, dx, dy, z):
    ground = Body("/Ground", live.square(50.0), None)  # reaches behind the horizon of every corner
    camera = replace(
        live.camera_above(), world_from_camera=look_at(np.array([0, 0, z]), np.zeros(3), (0, 1, 0))
    )
    pose = camera.world_from_camera.copy()
    pose[:2, 3] += dx, dy
    end = replace(camera, world_from_camera=pose)
    path = longest_path((Scene((ground,)), camera), (Scene((ground,)), end))
    assert path == pytest.approx(camera.K[0, 0] * np.hypot(dx, dy) / z, rel=1e-6, abs=1e-9)


def test_a_pixel_of_way_is_a_rendering():
    assert [renderings(p, 8) for p in (0.0, 0.2, 0.3, 1.5, 2.0, 7.5, 100.0)] == [1, 1, 2, 2, 2, 8, 8]
    assert renderings(100.0, 1) == 1

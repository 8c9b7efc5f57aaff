"""Joints, belts and time lines against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene
from realtime.virtual_camera.joint import Conveyor, Joint
from realtime.virtual_camera.moving_scene import MovingScene, TimeLine
from realtime.virtual_camera.pace import Pace

ANGLE = st.floats(-7, 7)
L1, L2 = 0.4, 0.3


def arm(live):
    """Two links along x, as the file has them; the tool at the end."""
    names = ("/Arm/Upper", "/Arm/Upper/Fore", "/Arm/Upper/Fore/Tool")
    places = (0.0, L1, L1 + L2)
    bodies = tuple(
        Body(n, live.square(0.01), None, live.at(x, 0)) for n, x in zip(names, places, strict=True)
    )
    joints = (
        Joint("shoulder", ("/Arm/Upper",), (0, 0, 1)),
        Joint("elbow", ("/Arm/Upper/Fore",), (0, 0, 2), (L1, 0, 0)),
    )
    return MovingScene(Scene(bodies), joints)


@settings(deadline=None, max_examples=50)
@given(a=ANGLE, b=ANGLE)
def test_a_two_link_arm_stands_where_its_closed_form_says(live, a, b):
    scene = arm(live)
    scene.set_joint("shoulder", a)
    scene.set_joint("elbow", b)
    tool = scene.at(0.0).scene.bodies[2].world_from_body
    expected = [L1 * np.cos(a) + L2 * np.cos(a + b), L1 * np.sin(a) + L2 * np.sin(a + b), 0]
    np.testing.assert_allclose(tool[:3, 3], expected, atol=1e-12)
    np.testing.assert_allclose(tool[:2, 0], [np.cos(a + b), np.sin(a + b)], atol=1e-12)


@settings(deadline=None, max_examples=50)
@given(q=ANGLE, axis=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1))
def test_a_joint_is_rigid_leaves_its_axis_and_goes_back(q, axis):
    joint = Joint("j", ("/a",), axis, (0.1, -0.2, 0.3))
    m = joint.displacement(q)
    np.testing.assert_allclose(m[:3, :3] @ m[:3, :3].T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(joint.displacement(-q) @ m, np.eye(4), atol=1e-12)
    on_axis = np.array([*(np.array(joint.origin) + 0.7 * np.array(axis)), 1])
    np.testing.assert_allclose(m @ on_axis, on_axis, atol=1e-12)


def test_a_belt_keeps_its_place_when_its_speed_changes_and_counts_pulses(live):
    belt = Conveyor("belt", ("/Part",), (0, 2, 0), speed=0.5, pulses_per_metre=1000)
    belt = belt.at(-0.25, 4.0)  # 2 m on, then back
    assert belt.position(4.0) == 2.0
    assert belt.position(6.0) == 1.5
    assert belt.pulses(6.0) == 1500
    scene = MovingScene(Scene((Body("/Part", live.square(0.01), None),)), conveyors=(belt,))
    moment = scene.at(6.0)
    np.testing.assert_allclose(moment.scene.bodies[0].world_from_body[:3, 3], [0, 1.5, 0])
    assert moment.encoders == {"belt": 1500}
    assert moment.belts == {"belt": 1.5}


def test_what_leaves_a_belt_of_a_length_comes_in_again(live):
    belt = Conveyor("belt", ("/Part",), (1, 0, 0), speed=1.0, length=0.75)
    scene = MovingScene(Scene((Body("/Part", live.square(0.01), None),)), conveyors=(belt,))
    x = [scene.at(t).scene.bodies[0].world_from_body[0, 3] for t in (0.5, 0.75, 1.0)]
    np.testing.assert_allclose(x, [0.5, 0.0, 0.25])
    assert scene.at(1.0).encoders["belt"] == 1000  # the encoder counts on


def test_a_belt_is_started_and_stopped_by_a_consumer(live):
    belt = Conveyor("belt", ("/Part",), (1, 0, 0))
    scene = MovingScene(Scene((Body("/Part", live.square(0.01), None),)), conveyors=(belt,))
    scene.at(2.0)
    scene.run("belt", 0.1)
    assert scene.at(3.0).belts["belt"] == pytest.approx(0.1)
    scene.run("belt", 0.0)
    assert scene.at(9.0).belts["belt"] == pytest.approx(0.1)


def test_a_time_line_runs_and_starts_again_or_stays():
    asked = []

    def scene_at(code):
        asked.append(code)
        return Scene(time=code)

    line = TimeLine(scene_at, 10.0, 14.0, per_second=2.0)
    scene = MovingScene(line)
    assert [scene.at(t).scene.time for t in (0.0, 1.0, 1.5, 2.5)] == [10, 12, 13, 11]
    stays = TimeLine(scene_at, 10.0, 14.0, 2.0, loop=False)
    assert [stays.code(t) for t in (0.5, 2.0, 50.0)] == [11, 14, 14]


def test_a_change_is_whole_or_not_at_all(live):
    scene = arm(live)
    with pytest.raises(BrightfieldError, match=r'No joint is called "elbo".*Did you mean "elbow"'):
        scene.change(bodies={"/Arm/Upper": live.at(1, 1)}, joints={"elbo": 1.0})
    with pytest.raises(BrightfieldError, match="must be a finite"):
        scene.change(joints={"elbow": 1.0}, bodies={"/Arm/Upper": [[1]]})
    moment = scene.at(0.0)
    assert moment.joints == {"shoulder": 0.0, "elbow": 0.0}
    np.testing.assert_array_equal(moment.scene.bodies[0].world_from_body, np.eye(4))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda live: Joint("j", ("/a",), (0, 0, 0)), "must be finite and not zero"),
        (
            lambda live: Joint("j", ("/a",), (0, 0, 1), low=0, high=1).checked(2.0),
            r"must lie in \[0, 1\] rad",
        ),
        (
            lambda live: MovingScene(Scene(), [Joint("j", ("/a",), (0, 0, 1))]),
            "which the scene does not have",
        ),
        (lambda live: arm(live).set_camera_pose("/Cam", np.eye(4)), "No camera.*There is none"),
        (lambda live: arm(live).set_body_pose("/Arm/Upper", np.diag([1, 1, 0, 1.0])), "not be flat"),
    ],
)
def test_what_cannot_move_is_one_clear_error(live, make, message):
    with pytest.raises(BrightfieldError, match=message):
        make(live)


def test_a_pace_keeps_to_its_grid_and_counts_what_it_misses():
    """Frames are due at multiples of the period whatever the last one cost."""
    clock, now, starts = Pace(), 100.0, []
    for cost in (0.01, 0.01, 0.35, 0.01, 0.01):
        due = clock.due(0.1, now)
        now = max(now, due)
        clock.took(now, due, 0.1)
        starts.append(now - 100)
        now += cost
    np.testing.assert_allclose(starts, [0.0, 0.1, 0.2, 0.55, 0.6])
    assert clock.missed == 2
    assert clock.timing.frames == 5
    assert clock.due(0.5, now) == pytest.approx(101.0)  # another period: the next multiple of that
    late = Pace()
    assert late.due(0.1, 100.23) == pytest.approx(100.3)  # a camera that begins later is due with the others

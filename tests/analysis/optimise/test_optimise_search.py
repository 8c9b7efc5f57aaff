"""Searches with known fronts, limits by closed forms, aims that hit, plans that tell what is wrong."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from analysis.optimise import limits
from analysis.optimise.measures.evenness import Evenness
from analysis.optimise.measures.scale import Scale
from analysis.optimise.plan import Limits, Plan
from analysis.optimise.plan_file import read
from analysis.optimise.search import Judge, Searched, Trial, best_of, hypervolume, hypervolumes, loss, search
from analysis.optimise.setting import aimed, focused, turned
from analysis.sweep.laws import LogUniform, Uniform
from analysis.sweep.sampling import Axis
from analysis.tune.search import pareto
from interchange.camera import Camera
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import from_corners
from interchange.problems import FileError
from interchange.scene import Body, Scene

patient = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # of a busy machine
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def box(at: tuple[float, float, float]) -> Body:
    corners = 0.01 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    faces = np.array([[q[i] for i in t] for q in QUADS for t in ((0, 1, 2), (0, 2, 3))])
    pose = np.eye(4)
    pose[:3, 3] = at
    return Body("/World/Part", from_corners(corners, faces), Material("m"), pose)


SCENE = Scene(
    (box((0.05, 0, 0)),),
    (
        Light(
            "/World/Lamp",
            LightKind.DISK,
            (1.0,) * 3,
            look_at(np.array([0, 0, 0.3]), np.zeros(3)),
            radius=0.01,
        ),
    ),
    (Camera("/World/Camera", look_at(np.array([0.02, -0.1, 0.3]), np.zeros(3))),),
)
AXES = (
    Axis("/World/Camera.pose.tx", Uniform(0, 1)), Axis("/World/Camera.pose.ty", Uniform(0, 1)),
    Axis("/World/Camera.lens.f_stop", LogUniform(1, 16)),
)  # fmt: skip
PLAN = Plan(
    Path("plan.yaml"), Path("scene.usda"), "/World/Camera", ("/World/Part",), AXES,
    {"evenness": Evenness(), "scale": Scale()}, trials=60,
)  # fmt: skip


class Known(Judge):
    """Evenness x, scale 10^(1 - x + (y - 0.3)² + ln² N), and a limit that y > 0.8 breaks: best where y = 0.3, N = 1."""

    def trial(self, parameters: Mapping[str, float], render: Any, runs: int = 1) -> Trial:
        x, y, n = parameters.values()
        if y > 0.8:
            return Trial(dict(parameters), (float("nan"),) * 2, "y")
        worse = (y - 0.3) ** 2 + np.log(n) ** 2
        return Trial(dict(parameters), (x, float(10 ** (x + worse))))


def no_image(*_: Any) -> Any:
    raise AssertionError("nothing is rendered")


@pytest.mark.parametrize(
    ("method", "trials"), [("tpe", 60), ("nsga2", 240)]
)  # a population needs generations
def test_a_search_beats_random_search_with_the_same_budget(method: str, trials: int) -> None:
    judge = Known(replace(PLAN, trials=trials), SCENE, None)
    found, random = search(judge, no_image, method, 0), search(judge, no_image, "random", 1)
    assert len(found.trials) == len(random.trials) == trials
    volumes = hypervolumes(PLAN, [found, random])
    assert volumes[0][-1] > volumes[1][-1]
    assert (np.diff(volumes[0]) >= 0).all()
    assert all(not found.trials[i].broken for i in found.front)
    again = search(judge, no_image, method, 0)
    assert [t.parameters for t in again.trials] == [t.parameters for t in found.trials]


def test_hypervolumes_of_known_fronts() -> None:
    assert hypervolume(np.array([[0.25]])) == pytest.approx(0.75)
    assert hypervolume(np.array([[0.0, 0.5], [0.5, 0.0]])) == pytest.approx(0.75)
    assert hypervolume(np.array([[0.5, 0.5, 0.5], [0.0, 0.5, 0.75]])) == pytest.approx(
        0.125 + 0.5 * 0.5 * 0.25
    )


@patient
@given(arrays(np.float64, (5, 3), elements=st.integers(0, 9).map(lambda k: k / 10)))
def test_a_hypervolume_is_the_share_of_points_that_are_dominated(front: np.ndarray) -> None:
    front = front[pareto(front)]
    grid = (np.stack(np.meshgrid(*[np.arange(10)] * 3), -1).reshape(-1, 3) + 0.5) / 10
    dominated = (front[None] <= grid[:, None]).all(axis=-1).any(axis=-1)
    assert hypervolume(front) == pytest.approx(dominated.mean())  # exact: coordinates are tenths


def test_the_best_few_are_spread_over_the_front() -> None:
    x = np.linspace(0, 1, 11)
    trials = [Trial({}, (float(a), float(10 ** (a**2)))) for a in x]
    measures = list(PLAN.objectives.values())
    front = pareto(np.array([[loss(m, v) for m, v in zip(measures, t.values, strict=True)] for t in trials]))
    assert front == list(range(11))
    chosen = best_of(PLAN, trials, front, 3)
    assert {0, 10} < set(chosen)
    assert len(chosen) == 3


def test_nothing_dominated_is_no_hypervolume() -> None:
    empty = Searched("tpe", (Trial({}, (float("nan"),) * 2, "y"),) * 4, ())
    assert not hypervolumes(PLAN, [empty, empty])[0].any()


def test_what_is_aimed_hits_and_keeps_its_roll() -> None:
    turned_scene = focused(
        aimed(SCENE, {"/World/Camera": "/World/Part", "/World/Lamp": "/World/Part"}),
        "/World/Camera",
        "/World/Part",
    )
    camera, lamp = turned_scene.cameras[0], turned_scene.lights[0]
    target = np.array([0.05, 0, 0])
    assert camera.world_from_camera[:3, 3] == pytest.approx(SCENE.cameras[0].world_from_camera[:3, 3])
    away = target - camera.world_from_camera[:3, 3]
    assert camera.world_from_camera[:3, 2] == pytest.approx(away / np.linalg.norm(away))
    assert camera.lens.focus_distance == pytest.approx(np.linalg.norm(away))
    away = target - lamp.world_from_light[:3, 3]
    assert -lamp.world_from_light[:3, 2] == pytest.approx(away / np.linalg.norm(away))


@patient
@given(arrays(np.float64, 3, elements=st.floats(-1, 1)), arrays(np.float64, 3, elements=st.floats(-1, 1)))
def test_the_turn_is_a_rotation_and_the_shortest(start: np.ndarray, towards: np.ndarray) -> None:
    if min(np.linalg.norm(start), np.linalg.norm(towards)) < 1e-3:
        return
    pose = look_at(np.zeros(3), start)
    new = turned(pose, towards, 1.0)
    R = new[:3, :3] @ pose[:3, :3].T
    assert pytest.approx(np.eye(3), abs=1e-9) == R @ R.T
    assert np.linalg.det(R) == pytest.approx(1)
    between = np.clip(start @ towards / np.linalg.norm(start) / np.linalg.norm(towards), -1, 1)
    assert (np.trace(R) - 1) / 2 == pytest.approx(between, abs=1e-6)


def test_a_clearance_is_the_distance_from_the_nearest_face() -> None:
    bodies = [box((0, 0, 0)), box((0.1, 0, 0))]
    assert limits.distance(bodies, np.array([0.0, 0, 0.03])) == pytest.approx(0.02)
    assert limits.distance(bodies, np.array([0.06, 0, 0])) == pytest.approx(0.03)
    assert limits.distance([], np.zeros(3)) == np.inf
    close = replace(PLAN, limits=Limits(clearance=0.3, clear=("/World/Lamp",)))
    assert limits.broken_before(close, SCENE, None) == "clearance of Lamp"
    wide = replace(PLAN, limits=Limits(clearance=0.2, clear=("/World/Lamp",)))
    assert limits.broken_before(wide, SCENE, None) == ""


def test_a_plan_tells_all_that_is_wrong(tmp_path: Path) -> None:
    from interchange.formats.document import Document
    from interchange.formats.usd_author import author_scene

    Document(author_scene(SCENE), tmp_path / "s.usda").save(tmp_path / "s.usda")
    (tmp_path / "plan.yaml").write_text(
        "scene: s.usda\npart: [Prt]\nparameters:\n  Camera.pose.tx: {range: [-1, 1]}\n  Camera.lens.f_stp: 4\n"
        "  Part.material: [m]\n"
        "objectives: {defect_visibility: {}, scal: {}}\nlimits: {clearance: 5, clear: [Lmp]}\n"
        "search: {method: grid}\naim: {Camera: Part}\n"
    )
    with pytest.raises(FileError) as error:
        read(tmp_path / "plan.yaml")
    told = str(error.value)
    for words in (
        'Did you mean "Part"', "must say its unit", 'Did you mean "lens.f_stop"', "needs defects in the plan",
        'Did you mean "scale"', 'Did you mean "Lamp"', "The clearance must say its unit", "tpe or nsga2",
        "a set-up is searched over numbers",
    ):  # fmt: skip
        assert words in told, words
    (tmp_path / "plan.yaml").write_text(
        "scene: s.usda\npart: [Part]\nparameters:\n  Camera.pose.tx: {range: [-1, 1], unit: cm}\n  Lamp.radius_mm: 4\n"
        "objectives: [scale]\nfocus: Part\n"
    )
    plan = read(tmp_path / "plan.yaml")
    assert plan.camera == "/World/Camera"
    assert plan.axes[0].law == Uniform(-10, 10)
    assert plan.fixed == {"Lamp.radius_mm": pytest.approx(0.004)}
    assert plan.focus == "/World/Part"


class Killed(BaseException):
    """As a signal ends a program: no handler of the search's takes it."""


@pytest.mark.parametrize("method", ["tpe", "random"])
def test_a_search_that_was_broken_off_goes_on_as_if_it_had_not_been(method: str, tmp_path: Path) -> None:
    """Trials that break a limit among them, whose values are NaN; the last line cut off in the middle."""
    whole = search(Known(PLAN, SCENE, None), no_image, method, 0)
    judged = []

    class Counted(Known):
        def trial(self, parameters: Mapping[str, float], render: Any, runs: int = 1) -> Trial:
            judged.append(dict(parameters))
            if len(judged) == 25:
                raise Killed
            return super().trial(parameters, render, runs)

    file = tmp_path / "kept" / "trials.jsonl"
    with pytest.raises(Killed):
        search(Counted(PLAN, SCENE, None), no_image, method, 0, keep=file)
    file.write_text(file.read_text()[:-9])  # the 24th
    again = search(Counted(PLAN, SCENE, None), no_image, method, 0, keep=file)
    assert again.resumed == 23
    assert len(judged) == 25 + 60 - 23
    assert [t.parameters for t in again.trials] == [t.parameters for t in whole.trials]
    np.testing.assert_array_equal([t.values for t in again.trials], [t.values for t in whole.trials])
    assert [t.broken for t in again.trials] == [t.broken for t in whole.trials]
    assert again.front == whole.front
    third = search(Counted(PLAN, SCENE, None), no_image, method, 0, keep=file)
    assert (third.resumed, len(judged)) == (60, 25 + 60 - 23)  # nothing is left to do
    other = search(Counted(replace(PLAN, text="another"), SCENE, None), no_image, method, 0, keep=file)
    assert other.resumed == 0

"""A camera whose mount gives way while it captures, from one condition to the next."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition, conditions
from analysis.gap.compared.state import State
from analysis.gap.corrected.scene import Change, changed
from analysis.gap.light.radiance import Rendered, render_all
from analysis.gap.renderers import renderer
from analysis.gap.terms.geometry import CREEPS_IN, geometry_terms
from analysis.gap.terms.mounts import CREEPING
from interchange.captures import Tolerances
from interchange.effects.camera_pose import CameraPose
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from tests.analysis.gap.bench import SAMPLES, Rig

NAME = "/World/Camera0"
BY = (0.2, -0.12)  # px that its images move by from the first to the last condition, to the right and down
# of that: what gradients tell of edges that are as sharp as pixels, whose second derivative they leave out
LINEAR = 0.1


@pytest.fixture(scope="module")
def found(rig: Rig) -> list[Condition]:
    """Each condition as the scene has it rendered."""
    of = conditions(rig.captured("creeping", ()), rig.document)
    rendered = dict(zip((f"{t:02d}.png" for t in rig.times), rig.truth, strict=True))
    return [replace(c, rendered=rendered[c.name]) for c in of]


def turned(rig: Rig, scene: Scene, since: float) -> Rendered:
    camera = scene.camera(NAME)
    by = CameraPose(ry=1e3 * since * BY[0] / camera.K[0, 0], rx=-1e3 * since * BY[1] / camera.K[1, 1])
    there = by.on_scene(replace(scene, cameras=(camera,))).cameras[0]
    with renderer("realtime", SAMPLES, False) as (render, settings):
        return render_all([(scene, there)], render, settings, rig.cache)[0]


def test_conditions_are_counted_by_camera_from_first_to_last(found: list[Condition]) -> None:
    for name in (NAME, "/World/Camera1"):
        when = [c.when for c in found if c.camera.name == name]
        np.testing.assert_allclose(when, np.linspace(0, 1, len(when)))


@pytest.mark.slow
def test_what_each_condition_shows_of_it_tells_by_how_much_a_camera_creeps(
    rig: Rig, found: list[Condition]
) -> None:
    creep = [t for t in geometry_terms(found, Tolerances()) if t.target == NAME + CREEPING]
    own = [c for c in found if c.camera.name == NAME and c.lamps]
    X, r = [], []
    for c in own:
        state = State(c)
        there = replace(c, rendered=turned(rig, c.scene, c.when - 0.5))
        sigma = np.sqrt(c.simulated().temporal + 1)
        X.append(np.stack([t.field(state) / sigma for t in creep], axis=-1)[state.usable].reshape(-1, 2))
        r.append(((there.simulated().dn - state.simulation.dn) / sigma)[state.usable].ravel())
    theta = np.linalg.lstsq(np.concatenate(X), np.concatenate(r), rcond=None)[0]
    K = own[0].camera.K
    expected = 1e3 * np.array([-BY[1] / K[1, 1], BY[0] / K[0, 0]])
    np.testing.assert_allclose(theta, expected, atol=LINEAR * np.abs(expected).max())


def test_few_conditions_do_not_tell_it(found: list[Condition]) -> None:
    few = [c for c in found if c.camera.name == NAME][: CREEPS_IN - 1]
    assert not any(t.target.endswith(CREEPING) for t in geometry_terms(few, Tolerances()))


def test_a_scene_file_cannot_say_that_a_camera_creeps(rig: Rig) -> None:
    scene = rig.document.scene(0)
    change = Change("camera_pose", NAME + CREEPING, {"turn about x from first to last capture": 1.0}, {})
    with pytest.raises(BrightfieldError, match="for each capture"):
        changed(scene, scene, change)

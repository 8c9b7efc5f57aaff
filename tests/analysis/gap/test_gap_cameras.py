"""Every camera has a lens and a sensor of its own."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.corrected.scene import Change, changed
from analysis.gap.finding import Finding, names
from analysis.gap.search.fit import fit
from analysis.gap.sensor.expected import Expected
from analysis.gap.terms.base import NUISANCE, Term
from analysis.gap.terms.camera import OWN, camera_terms
from analysis.gap.terms.chain import SHARED, VIBRATION, black_of_channels, chain_terms, effects_at
from analysis.gap.terms.color_shading import COLORED, color_shading
from analysis.gap.terms.form import EXPOSURE, MODULATIONS, Changed, form_terms
from analysis.gap.terms.generic import image_wave
from analysis.gap.terms.geometry import geometry_terms
from analysis.gap.terms.sensitivities import drawn
from interchange.captures import Tolerances
from interchange.effects.black_level import BlackLevel
from interchange.effects.vignetting import Vignetting

LEFT, RIGHT = "/World/Camera0", "/World/Camera1"


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory, small_bench) -> list[Condition]:
    """Three conditions, two of one camera and one of the other."""
    shots = {0: "Camera0", 2: "Camera0", 6: "Camera1"}
    return small_bench(tmp_path_factory.mktemp("cameras"), shots, 16)


def lens(terms: list[Term]) -> dict[tuple[str, str, str], Term]:
    return {t.key: t for t in terms if t.cause != NUISANCE}


def test_one_camera_has_no_effects_of_its_own(found: list[Condition]) -> None:
    alone = [c for c in found if c.camera.name == LEFT]
    terms = [*camera_terms(alone, Tolerances()), *geometry_terms(alone, Tolerances())]
    assert not any(t.camera or t.form for t in terms)
    plain = chain_terms(State(max(alone, key=lambda c: float(np.median(c.mean)))), Tolerances())
    assert {t.key: t.spike for t in plain}.items() <= {t.key: t.spike for t in terms}.items()


def test_what_all_and_each_may_be_off_adds_up_to_the_tolerance(found: list[Condition]) -> None:
    """Of the black level, whose tolerance is in DN, and of the others, by what one camera alone has."""
    many = lens([*camera_terms(found, Tolerances()), *geometry_terms(found, Tolerances())])
    alone = [c for c in found if c.camera.name == LEFT]
    one = lens([*camera_terms(alone, Tolerances()), *geometry_terms(alone, Tolerances())])
    for cause, parameter in (("vignetting", "a2"), ("defocus", "blur"), ("lens_distortion", "k1")):
        both = np.hypot(many[cause, "", parameter].spike, many[cause, LEFT, parameter].spike)
        assert both == pytest.approx(one[cause, "", parameter].spike, rel=1e-6)
        assert many[cause, RIGHT, parameter].spike / OWN == pytest.approx(
            many[cause, "", parameter].spike / SHARED, rel=1e-6
        )
        assert many[cause, "", parameter].form
        assert not many[cause, LEFT, parameter].form
    level = [many["black_level", target, "black_level"].spike for target in ("", LEFT)]
    level += [t.spike for t in black_of_channels(found, Tolerances())[:1]]
    assert np.linalg.norm(level) == pytest.approx(Tolerances().black_level_dn)


def test_a_camera_alone_shows_its_own(found: list[Condition]) -> None:
    terms = lens([*camera_terms(found, Tolerances()), *geometry_terms(found, Tolerances())])
    keys = [("vignetting", "a2"), ("lens_distortion", "k1")]
    own = [terms[cause, target, p] for cause, p in keys for target in ("", LEFT, RIGHT)]
    for c in found:
        rows = drawn(State(c), own)
        here = c.camera.name
        for shared, left, right in (rows[:3], rows[3:]):
            assert np.abs(shared).max() > 0
            assert left == pytest.approx(shared if here == LEFT else np.zeros_like(shared))
            assert right == pytest.approx(shared if here == RIGHT else np.zeros_like(shared))
        at = {terms["vignetting", RIGHT, "a2"].key: -0.2}
        (*effects,) = effects_at(list(terms.values()), at, State(c))
        assert [e.name() for e in effects] == (["vignetting"] if here == RIGHT else [])


def test_the_corrected_scene_has_it_on_that_camera(found: list[Condition]) -> None:
    scene = replace(found[0].scene, cameras=(found[0].camera, found[-1].camera))
    for target, want in ((RIGHT, (0.0, -0.2)), ("", (-0.2, -0.2))):
        new = changed(scene, scene, Change("vignetting", target, {"a2": -0.2}, {"a2": 0.0}))
        assert [c.lens.vignetting[0] for c in new.cameras] == pytest.approx(want)


def test_a_camera_alone_vibrates_where_its_exposures_tell_that_from_a_motion(found: list[Condition]) -> None:
    first = found[0]
    short = replace(first, camera=replace(first.camera, t_exp=0.5 * first.camera.t_exp))
    terms = lens(camera_terms([short, *found[1:]], Tolerances()))
    own = f"{LEFT}, {VIBRATION}"
    assert ("motion_blur", own, "u") in terms
    assert ("motion_blur", f"{RIGHT}, {VIBRATION}", "u") not in terms
    assert terms["motion_blur", own, "u"].form
    at = {("motion_blur", own, "u"): 1.0}
    (effect,) = effects_at(list(terms.values()), at, State(short))
    assert (effect.u, effect.v) == (1.0, 0.0)  # of the whole path, in half of the exposure
    assert effects_at(list(terms.values()), at, State(found[-1])) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "cameras", "target"),
    [
        (Vignetting(-0.5, 0.0), (RIGHT,), RIGHT),
        (Vignetting(-0.5, 0.0), (LEFT, RIGHT), ""),
        (BlackLevel(94.0), (LEFT,), LEFT),
    ],
)
def test_an_effect_of_one_camera_is_told_from_one_of_all(found, effect, cameras, target) -> None:
    rng = np.random.default_rng(1)

    def captured(c: Condition) -> Condition:
        e: Expected = c.simulated([effect] if c.camera.name in cameras else [])
        dn = e.dn + np.sqrt(e.variance) * rng.standard_normal(e.dn.shape)
        shots = tuple(replace(x, pixels=dn.astype(np.float32)) for x in c.captures[:1])
        return replace(c, captures=shots, mean=dn, spread=None)

    told = fit([captured(c) for c in found], Tolerances())
    assert told.best.causes == ((effect.name(), target),)
    assert told.probability[told.best.causes[0]] > 0.9


def test_a_verdict_says_whose_lens_it_is() -> None:
    of_all = Finding("lens_distortion", 0.9, {}, (), None, 2.0, 1.0, 0.5)
    assert (
        names([of_all, replace(of_all, cameras=("Camera1",))])
        == "lens distortion and lens distortion of Camera1"
    )
    assert names([replace(of_all, cameras=("A", "B"))]) == "lens distortion of A and B"


def test_flat_fields_may_differ_from_channel_to_channel_by_a_part_of_their_tolerance(
    found: list[Condition],
) -> None:
    terms = [t for t in color_shading(found, Tolerances(flat_field=0.01)) if t.target == LEFT]
    assert np.linalg.norm([t.spike for t in terms]) == pytest.approx(COLORED * 0.01)
    state = State(next(c for c in found if c.camera.name == LEFT))
    parts = [np.asarray(t.field(state)) for t in terms if t.parameter.endswith("1,0")]
    assert sum(parts) == pytest.approx(np.asarray(image_wave(LEFT, 1, 0, True)(state)))
    assert [np.flatnonzero(np.abs(x).sum(axis=(0, 1))).tolist() for x in parts] == [[0], [1], [2]]
    assert terms[0].field(State(next(c for c in found if c.camera.name == RIGHT))) is None
    assert color_shading([replace(c, mean=c.mean[..., :1]) for c in found], Tolerances()) == []


def test_forms_of_what_all_cameras_have_differ_from_one_to_the_other(found: list[Condition]) -> None:
    """A vignetting's may be another in each camera; one camera's effect and a lamp's have but one."""
    states = [State(c) for c in found]
    change = {c.name: Changed(np.full_like(s.signal, 2.0), {}) for c, s in zip(found, states, strict=True)}
    for cause, more in ((("vignetting", ""), 2), (("vignetting", LEFT), 0), (("light_beam", ""), 0)):
        forms = form_terms({cause: change}, [LEFT, RIGHT])
        assert len(forms) == (1 + more) * len(MODULATIONS)
        assert form_terms({cause: change}, [LEFT])[0].target == forms[0].target
    whole = form_terms({("vignetting", ""): change}, [LEFT, RIGHT])
    shown = {camera: [t.column(s) is not None for s in states for t in whole if t.target.endswith(camera)]
             for camera in (LEFT, RIGHT)}  # fmt: skip
    n = len(MODULATIONS)
    assert [any(shown[LEFT][k * n : (k + 1) * n]) for k in range(3)] == [True, True, False]
    assert [any(shown[RIGHT][k * n : (k + 1) * n]) for k in range(3)] == [False, False, True]


def test_a_form_may_go_with_the_exposure(found: list[Condition]) -> None:
    """By its logarithm, of mean 0 and deviation 1 over the conditions; of one exposure there is none."""
    times = [0.1, 0.1, 0.4, 1.0]
    some = [replace(found[0], camera=replace(found[0].camera, t_exp=t)) for t in times]
    change = {found[0].name: Changed(np.full_like(State(found[0]).signal, 2.0), {})}
    cause = ("exposure", "")
    assert len(form_terms({cause: change}, [LEFT], [0.1, 0.1])) == len(MODULATIONS)
    (term,) = [t for t in form_terms({cause: change}, [LEFT], times) if t.parameter == EXPOSURE]
    of = [float(np.asarray(term.field(State(c))).mean()) / 2 for c in some]
    assert np.mean(of) == pytest.approx(0, abs=1e-6)
    assert np.std(of) == pytest.approx(1)
    assert (of[3] - of[2]) / (of[2] - of[0]) == pytest.approx(np.log(2.5) / np.log(4))

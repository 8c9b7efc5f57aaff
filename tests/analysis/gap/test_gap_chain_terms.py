"""Terms of the image chain whose formulas take more than one number for one cause."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.corrected.scene import Change, changed
from analysis.gap.evidence.hypotheses import best_first
from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.light.radiance import Rendered
from analysis.gap.terms.base import NUISANCE, Term
from analysis.gap.terms.chain import (
    VIBRATION,
    black_levels,
    black_of_channels,
    chain_terms,
    dark_current,
    dark_shading,
    effects_at,
    shutter_delay,
    signed,
)
from analysis.gap.terms.generic import BLURS, SHARP
from analysis.gap.terms.geometry import EACH, geometry_terms
from analysis.gap.terms.normal_equations import NormalEquations
from analysis.gap.terms.saturation import KNEES, saturation_terms
from analysis.gap.terms.subpixel import PRODUCT, is_path, straight
from interchange.camera import Camera, Sensor
from interchange.captures import Capture, Tolerances
from interchange.effects.exposure import Exposure
from interchange.effects.motion_blur import MotionBlur
from interchange.effects.response_curve import ResponseCurve
from interchange.effects.veiling_glare import VeilingGlare
from interchange.effects.vignetting import Vignetting
from interchange.light import Light, LightKind
from interchange.scene import Scene
from interchange.sensor import Response

LAMP, SIZE = "/lamp", (96, 72)
SENSOR = Sensor(
    SIZE, (3e-6, 3e-6), responsivity=4000, full_well=10000, bit_depth=12, black_level=64, mosaic="mono"
)


@pytest.fixture(scope="module")
def condition() -> Condition:
    """Edges of every direction, some blurred."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]].astype(float)
    rings = np.clip(0.5 + np.hypot(x - 40, y - 30) % 12 - 6, 0, 1)
    corner = np.clip(0.5 + x - 60, 0, 1) * np.clip(0.5 + y - 40, 0, 1)
    L = np.repeat((0.3 + 0.5 * rings + 0.6 * corner)[..., None], 3, axis=2).astype(np.float32)
    camera = Camera("/eye", sensor=SENSOR, t_exp=1.0)
    scene = Scene(lights=(Light(LAMP, LightKind.SPHERE, (1.0, 1.0, 1.0)),))
    nothing = np.zeros_like(L)
    shown = Rendered(scene, camera, {LAMP: L}, {LAMP: np.ones(3)}, nothing, nothing, {}, {})
    pixels = np.ones((SIZE[1], SIZE[0], 1), np.float32)
    captures = (Capture("a.png", "/eye", 0, 1.0, pixels, bits=16),)
    bare = Condition(captures, scene, camera, pixels, None, np.ones(pixels.shape[:2], bool))
    return replace(bare, rendered=shown)


def fitted(
    terms: list[Term], condition: Condition, truth: object, at: dict[tuple[str, str, str], float]
) -> dict[str, float]:
    """Least squares around ``at``, by name of the parameter, without noise."""
    stands = State(condition, effects_at(terms, at, State(condition)))
    want = State(condition).dn([truth]) - stands.simulation.dn
    X = np.stack([np.asarray(t.field(stands)).ravel() for t in terms])
    found, *_ = np.linalg.lstsq(X.T, want.ravel(), rcond=None)
    return {t.parameter: at.get(t.key, 0.0) + float(x) for t, x in zip(terms, found, strict=True)}


@pytest.mark.parametrize("path", [(0.9, 0.7), (0.9, -0.7), (1.4, -0.3), (0.0, 1.2)])
def test_a_motion_is_told_with_its_direction(condition: Condition, path: tuple[float, float]) -> None:
    """Within 3 % of its length: fourth moments of the path are another formula's."""
    terms = [t for t in chain_terms(State(condition), Tolerances()) if t.cause == "motion_blur"]
    assert [t.parameter for t in terms] == ["u", "v", PRODUCT]
    at: dict[tuple[str, str, str], float] = {}
    for _ in range(4):
        theta = fitted(terms, condition, MotionBlur(*path), at)
        found_here = np.array([max(theta[t.parameter], t.low) for t in terms])
        at = {t.key: float(x) for t, x in zip(terms, straight(terms, found_here), strict=True)}
    (found,) = effects_at(terms, at, State(condition))
    got = np.array([found.u, found.v])
    missed = min(np.abs(sign * got - path).max() for sign in (1, -1))  # forth and back is one blur
    assert missed < 0.03 * np.hypot(*path)


def test_a_vibration_is_as_long_in_every_exposure(condition: Condition) -> None:
    """Two exposures tell it from a motion, a tenth of difference does not. Where one form is in force, half the
    exposure has half the path, or all of it."""
    one = [t for t in chain_terms(State(condition), Tolerances(), {1.0, 1.1}) if t.cause == "motion_blur"]
    assert {t.candidate for t in one} == {("motion_blur", "")}
    assert not any(t.form for t in one)
    both = [t for t in chain_terms(State(condition), Tolerances(), {0.5, 1.0}) if t.cause == "motion_blur"]
    assert len(both) == 6
    assert all(t.form for t in both)
    short = replace(condition, camera=replace(condition.camera, t_exp=0.5))
    for target, kept in (("", 0.5), (VIBRATION, 1.0)):
        own = [t for t in both if t.target == target]
        at: dict[tuple[str, str, str], float] = {}
        for _ in range(4):
            theta = fitted(own, short, MotionBlur(0.9 * kept, -0.7 * kept), at)
            here = np.array([max(theta[t.parameter], t.low) for t in own])
            at = {t.key: float(x) for t, x in zip(own, straight(own, here), strict=True)}
        long = State(condition)
        (found,) = effects_at(both, at, long)
        size = np.hypot(0.9, 0.7)
        assert np.hypot(found.u, found.v) == pytest.approx(size, rel=0.05)
        (found,) = effects_at(both, at, State(short))
        assert np.hypot(found.u, found.v) == pytest.approx(kept * size, rel=0.05)


def test_no_hypothesis_has_two_forms_of_an_effect() -> None:
    """Two that are there, each with columns of its own: the stronger one is taken; where they are two effects, both."""
    rng = np.random.default_rng(5)
    X = rng.standard_normal((2, 4000)) / 0.05
    r = 0.3 * X[0] + 0.2 * X[1] + rng.standard_normal(4000)
    signal = 4000 / 0.05**2
    e = NormalEquations(X @ X.T, X @ r, float(r @ r), signal, np.full(2, signal), 0.0, 4000)
    for form in (True, False):
        terms = [
            Term("motion_blur", t, "u", "px^2", 0.001, lambda s: None, form=form) for t in ("", VIBRATION)
        ]
        best = best_first(Evidence(e, terms))[0]
        assert [c[1] for c in best.causes] == ([""] if form else ["", VIBRATION])


@pytest.mark.parametrize(
    ("squares", "path"),
    [((1.0, 1.0, 0.9), True), ((1.0, 0.0, 0.0), True), ((1.0, 0.1, 0.0), True), ((1.0, 0.9, 0.0), False),
     ((0.6, 0.5, -0.1), False), ((-0.2, -0.3, 0.0), True)],
)  # fmt: skip
def test_a_path_is_straight(squares: tuple[float, float, float], path: bool) -> None:
    """Known to 0.01 px² what is as wide as it is long is none; known to 0.5 px² all of them may be."""
    theta = np.array(squares)
    assert is_path(theta, 1e-4 * np.eye(3)) is path
    assert is_path(theta, 0.25 * np.eye(3))


def test_a_path_stands_at_the_straight_one_that_is_nearest() -> None:
    """Of a blur of 0.3 px² every way and a path of 1.3 px² along (2, 1) the path is left, and the blur's in it."""
    way = np.array([2.0, 1.0]) / np.sqrt(5)
    both = 0.3 * np.eye(2) + 1.3 * np.outer(way, way)
    terms = [Term("motion_blur", "", p, "px^2", 1.0, lambda s: None) for p in ("u", "v", PRODUCT)]
    other = Term("defocus", "", "blur", "px", 1.0, lambda s: None)
    at = straight([other, *terms], np.array([7.0, both[0, 0], both[1, 1], both[0, 1]]))
    want = 1.6 * np.outer(way, way)
    assert at == pytest.approx([7.0, want[0, 0], want[1, 1], want[0, 1]])


def test_a_blur_is_no_motion_and_a_sharpening_stands_beside_neither() -> None:
    """What is as wide as it is long is a defocus, however well a path's three numbers fit it."""
    rng = np.random.default_rng(6)
    along, down, product = rng.standard_normal((3, 4000)) / 0.05
    X = np.stack([along + down, along, down, product, rng.standard_normal(4000) / 0.05])
    r = 0.3 * (along + down) + rng.standard_normal(4000) + 0.2 * X[4]
    signal = 4000 / 0.05**2
    e = NormalEquations(X @ X.T, X @ r, float(r @ r), signal, np.full(5, signal), 0.0, 4000)
    names = [("defocus", "blur"), *(("motion_blur", p) for p in ("u", "v", PRODUCT)), (SHARP, "gain")]
    terms = [
        Term(n, "", p, "1", 0.001, lambda s: None, against=BLURS if n == SHARP else ()) for n, p in names
    ]
    evidence = Evidence(e, terms)
    assert evidence.at((("motion_blur", ""),), (0.1,)).log_Z == -np.inf
    found = best_first(evidence)
    assert found[0].causes == (("defocus", ""),)
    assert not any({SHARP, "defocus"} <= {c[0] for c in h.causes} for h in found)


def test_a_product_gives_the_second_way_its_sign() -> None:
    assert signed({"u": 1.0, "v": 2.0, PRODUCT: -1.5}) == {"u": 1.0, "v": -2.0}
    assert signed({"u": 1.0, "v": 2.0, PRODUCT: 1.5}) == {"u": 1.0, "v": 2.0}
    assert signed({"g": 1.0}) == {"g": 1.0}


def test_glare_is_told_by_what_goes_far_and_what_stays_near(condition: Condition) -> None:
    terms = [t for t in chain_terms(State(condition), Tolerances()) if t.cause == "veiling_glare"]
    assert [t.parameter for t in terms] == ["g", "halo", "lost"]
    theta = fitted(terms, condition, VeilingGlare(0.02, 0.03, 0.0, 0.01), {})
    assert theta == pytest.approx({"g": 0.02, "halo": 0.03, "lost": 0.01}, rel=1e-3)


def test_a_number_that_is_almost_nothing_has_a_term_too(condition: Condition) -> None:
    """A step of a hundredth of it would not show."""
    lens = replace(condition.camera.lens, vignetting=(-1e-7, 0.0))
    camera = replace(condition.camera, lens=lens)
    terms = chain_terms(State(replace(condition, camera=camera)), Tolerances())
    (slope,) = (t for t in terms if t.parameter == "a2")
    assert slope.start == -1e-7


def test_each_of_several_cameras_has_a_black_level_of_its_own(condition: Condition) -> None:
    other = replace(condition, camera=replace(condition.camera, name="/other"))
    terms = black_levels([condition, other], Tolerances())
    assert [(t.cause, t.target) for t in terms] == [(NUISANCE, n) for n in ("/eye", "/other")]
    shared = next(t for t in chain_terms(State(condition), Tolerances()) if t.cause == "black_level")
    channels = black_of_channels([condition, other], Tolerances())
    parts = (shared.spike, terms[0].spike, channels[0].spike)
    assert np.linalg.norm(parts) == pytest.approx(Tolerances().black_level_dn)
    assert terms[0].field(State(other)) is None
    assert np.asarray(terms[1].field(State(other))).min() == 1
    assert [(t.cause, t.target) for t in channels] == [
        (NUISANCE, n) for n in ("/eye", "/other")
    ]  # of one channel


def test_each_channel_has_a_black_level_of_its_own(condition: Condition) -> None:
    color = replace(condition, mean=np.repeat(condition.mean, 3, axis=2))
    terms = black_of_channels([color], Tolerances(black_level_dn=2.0))
    levels = [np.asarray(t.field(State(color))) for t in terms]
    assert np.stack(levels).mean(axis=(1, 2)) == pytest.approx(np.eye(3))
    assert {t.spike for t in terms} == {1.0}


def test_a_black_level_may_be_uneven_by_half_of_its_tolerance(condition: Condition) -> None:
    """Along rows and columns, half a wave and a whole one, whatever is seen; the second half as much."""
    terms = dark_shading([condition], Tolerances(black_level_dn=2.0))
    assert [t.spike for t in terms] == [1.0, 0.5, 1.0, 0.5]
    assert {(t.cause, t.target) for t in terms} == {(NUISANCE, "/eye")}
    row, column = (np.asarray(terms[k].field(State(condition)))[..., 0] for k in (0, 2))
    assert (row[0] == row[-1]).all()
    assert (column[:, 0] == column[:, -1]).all()
    for wave in (row[0], column[:, 0]):
        assert wave == pytest.approx(-wave[::-1], abs=1e-6)
        assert wave[0] == pytest.approx(1, abs=0.01)
    other = replace(condition, camera=replace(condition.camera, name="/other"))
    assert terms[0].field(State(other)) is None


def test_a_dark_current_is_what_the_sensor_gives_more_where_exposures_tell(condition: Condition) -> None:
    """100 e-/s at two exposures, by the sensor's own model; of one exposure it is the black level."""
    longer = replace(condition, camera=replace(condition.camera, t_exp=4.0))
    assert dark_current([condition, condition], Tolerances()) == []
    (term,) = dark_current([condition, longer], Tolerances())
    assert term.candidate == ("black_level", "sensor")
    for c in (condition, longer):
        leaks = replace(c.camera, sensor=replace(c.camera.sensor, dark_current=100.0))
        real = replace(c, camera=leaks).simulated().dn - c.simulated().dn
        assert 100 * np.asarray(term.field(State(c))) == pytest.approx(real, rel=1e-3)
    change = Change("black_level", "sensor", {"dark_current": 100.0}, {"dark_current": 0.0})
    scene = replace(condition.scene, cameras=(condition.camera,))
    assert changed(scene, scene, change).cameras[0].sensor.dark_current == pytest.approx(100)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_corrected_scene_runs_as_fast_as_a_motion_and_shakes_as_far_as_a_vibration(way: float) -> None:
    """1.2 and 0.4 px at 8 ms, beside what the camera has: its own path at any exposure is what was found."""
    own = Camera("c", t_exp=0.002, sensor=Sensor(image_path=(0.1, 0.0), image_speed=(0.0, 50.0)))
    scene = replace(Scene(), cameras=(own, replace(own, name="d")))
    for target, t_exp in (("", 0.008), (VIBRATION, 0.0), ("c", 0.008), (f"c, {VIBRATION}", 0.0)):
        new, old = signed({"u": 1.2, "v": 0.4, PRODUCT: way}), {"u": 0.0, "v": 0.0}
        camera, other = changed(scene, scene, Change("motion_blur", target, new, old, t_exp)).cameras
        assert other.sensor == (own.sensor if target.startswith("c") else camera.sensor)
        for t in (0.002, 0.008):
            there = MotionBlur.of(replace(camera, t_exp=t)).path(replace(camera, t_exp=t))
            was = MotionBlur.of(own).path(replace(own, t_exp=t))
            grown = t / t_exp if t_exp else 1.0
            more = np.array([1.2, way * 0.4]) * grown
            assert there == pytest.approx(tuple(np.array(was) + more))


def test_a_late_shutter_is_what_the_effect_gives_where_exposures_tell(condition: Condition) -> None:
    """20 ms beyond 1 s and 4 s, by the effect itself; of one exposure it is the exposure."""
    longer = replace(condition, camera=replace(condition.camera, t_exp=4.0))
    assert shutter_delay([condition, condition], Tolerances()) == []
    (term,) = shutter_delay([condition, longer], Tolerances())
    assert term.candidate == ("exposure", "")
    assert term.spike == pytest.approx(0.001 * condition.camera.t_exp)
    for c in (condition, longer):
        real = State(c).dn([Exposure(delay=0.02)]) - State(c).dn(())
        assert 0.02 * np.asarray(term.field(State(c))) == pytest.approx(real, rel=1e-3, abs=1e-3)
    told = [t.parameter for t in chain_terms(State(condition), Tolerances()) if t.cause == "exposure"]
    assert told == ["scale"]


def test_a_lens_is_known_as_well_where_a_cut_holds_no_axis(condition: Condition) -> None:
    """A tolerance's worth of k1 moves the farthest corner by its part of the declared px, wherever the axis is."""
    passes = {"depth": np.ones(SIZE[::-1])}
    there = replace(condition, rendered=replace(condition.shown, passes=passes))
    for center in ((47.5, 35.5), (-200.0, 35.5)):
        off = replace(there, camera=replace(there.camera, principal_point=center))
        (k1,) = (t for t in geometry_terms([off], Tolerances()) if t.parameter == "k1")
        assert k1.flow is not None
        moved = np.hypot(*k1.flow(State(off)))
        assert k1.spike * moved.max() == pytest.approx(EACH * 0.05, rel=0.05)  # the corner pixel's middle


def test_a_late_shutter_is_followed_to_where_it_stands(condition: Condition) -> None:
    """From a fifth too early: a step from there is what the effect gives more, to 1e-3 of it and of a DN (float32)."""
    longer = replace(condition, camera=replace(condition.camera, t_exp=4.0))
    (term,) = shutter_delay([condition, longer], Tolerances())
    assert term.kind == "chain"
    for c in (condition, longer):
        stands = State(c, effects_at([term], {term.key: -0.2}, State(c)))
        assert stands.simulation.dn == pytest.approx(State(c).dn([Exposure(delay=-0.2)]))
        real = State(c).dn([Exposure(delay=-0.199)]) - State(c).dn([Exposure(delay=-0.2)])
        assert 0.001 * np.asarray(term.field(stands)) == pytest.approx(real, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize(
    "curve",
    [ResponseCurve(gamma=0.8), ResponseCurve(bow=0.2, skew=0.1), ResponseCurve(response=Response.SRGB)],
)
def test_what_light_adds_goes_by_the_curves_slope_where_it_is(
    condition: Condition, curve: ResponseCurve
) -> None:
    """Of a camera's own curve, of one in force, and of a dark that is cut off at DN 0 (where 0.4 of its noise is the
    mean of nothing): signals against 1 % more light and 1 % less, to the third order."""
    own = condition.camera
    cut_off = replace(own, sensor=replace(SENSOR, black_level=0.0, read_noise=300))
    cameras = (curve.on(own), cut_off)
    for state in (State(condition, [curve]), *(State(replace(condition, camera=c)) for c in cameras)):
        more, less = (state.dn([*state.effects, Exposure(scale=x)]) for x in (1.01, 0.99))
        assert state.signal == pytest.approx(state.take(more - less) / 0.02, rel=2e-3)


@pytest.mark.parametrize(
    ("share", "knee", "width", "least"), [(0.25, 0.55, 0.05, 0.15), (1.0, 0.79, 0.005, 0.02)]
)
def test_a_well_that_fills_up_is_about_a_sum_of_knees(
    condition: Condition, share: float, knee: float, width: float, least: float
) -> None:
    """One that loses a quarter of what is above 0.55 of the range, bent over 0.1 of it: to 15 % of its rms. One that is
    full at 0.79, nearly at once: to 2 %, of which knees at 0.5 and 0.7 alone leave 8 %. No knee is looked for where
    nothing is bright."""
    L = {k: 1.7 * v for k, v in condition.rendered.lamps.items()}
    bright = replace(condition, rendered=replace(condition.rendered, lamps=L))
    state = State(bright)
    span = 2**SENSOR.bits_out - 1 - SENSOR.black_level
    assert 0.8 * span < state.signal.max() < span
    over = (state.signal - knee * span) / (width * span)
    lost = -share * width * span * np.logaddexp(0, over)
    terms = saturation_terms([bright], Tolerances())
    assert len(terms) == sum(k * span < state.signal.max() for k in KNEES)
    X = np.stack([t.field(state).ravel() for t in terms], axis=1)

    def left(X: np.ndarray) -> float:
        a, *_ = np.linalg.lstsq(X, lost.ravel(), rcond=None)
        return float(np.linalg.norm(lost.ravel() - X @ a) / np.linalg.norm(lost))

    assert left(X) < least
    assert all(t.low == 0 for t in terms)  # what rises instead is no well
    dark = replace(condition, rendered=replace(condition.rendered, lamps={k: 0.5 * v for k, v in L.items()}))
    assert saturation_terms([dark], Tolerances()) == []


def test_a_loss_that_hardly_shows_has_no_knee(condition: Condition) -> None:
    """Less than a quarter of the way on to what is saturated: found there, it would be told of all that is brighter
    elsewhere."""
    span = 2**SENSOR.bits_out - 1 - SENSOR.black_level
    brightest = State(condition).signal.max()
    for share, knees in ((0.61, 0), (0.75, 1), (0.83, 2), (0.91, 3), (0.95, 4)):
        L = {k: np.float32(share * span / brightest) * v for k, v in condition.rendered.lamps.items()}
        there = replace(condition, rendered=replace(condition.rendered, lamps=L))
        assert State(there).signal.max() == pytest.approx(share * span, rel=1e-3)
        assert len(saturation_terms([there], Tolerances())) == knees


def test_a_number_is_told_within_what_the_effect_declares() -> None:
    """A fit's crosstalk of 1.03 ended a blind case without an answer."""
    term = Term("color_crosstalk", "", "rg", "1", 0.01, lambda s: None)
    assert term.value(1.03) == 1.0
    assert term.value(-1.2) == -1.0
    assert (
        Term("camera_pose", "", "dx", "m", 0.01, lambda s: None).value(1e3) == 1e3
    )  # no parameter of that name


def test_sensitivities_at_the_end_of_what_a_number_may_be_are_told_inwards(condition: Condition) -> None:
    """A vignetting is linear in its numbers: a unit of one adds the same wherever it stands, at its highest too."""
    term = next(t for t in chain_terms(State(condition), Tolerances()) if t.key == ("vignetting", "", "a2"))
    inside = np.asarray(term.field(State(condition, [Vignetting(a2=0.1)])))
    at_the_end = np.asarray(term.field(State(condition, [Vignetting(a2=1.0)])))
    assert at_the_end == pytest.approx(
        inside, abs=2e-3 * np.abs(inside).max()
    )  # float32 of what is twice as bright

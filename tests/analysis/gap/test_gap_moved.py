"""A motion of a part of a pixel moves the edges of a rendering as it moves them in a camera."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.light.radiance import FINE, Rendered, pixels
from analysis.gap.light.views import Views
from analysis.gap.sensor.fine_optics import EVEN, blurred
from analysis.gap.terms.base import Term, added, moving
from analysis.gap.terms.chain import chain_terms
from interchange.camera import Camera, Lens, Sensor
from interchange.captures import Tolerances
from interchange.effects.defocus import Defocus
from interchange.effects.lateral_chromatic_aberration import LateralChromaticAberration
from interchange.effects.motion_blur import MotionBlur
from interchange.light import Light, LightKind
from interchange.scene import Scene

LAMP, SIZE = "/lamp", (24, 16)


def shown(edge: float, finer: int = FINE) -> Rendered:
    """Light to the left of column ``edge``, px from the image's left side; 1 is what a lit pixel has."""
    camera = Camera("/eye", sensor=Sensor(SIZE, (1e-6, 1e-6)))
    n = finer * SIZE[0]
    row = np.clip(finer * edge - np.arange(n), 0, 1)
    fine = np.broadcast_to(row[None, :, None], (finer * SIZE[1], n, 3)).astype(np.float16)
    scene = Scene(lights=(Light(LAMP, LightKind.SPHERE, (1.0, 1.0, 1.0)),))
    nothing = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    lamps = {LAMP: pixels(fine, 1.0, camera)}
    whole = Rendered(scene, camera, lamps, {LAMP: np.ones(3)}, nothing, nothing, {}, {})
    return replace(whole, fine={LAMP: fine}) if finer == FINE else whole


@pytest.mark.parametrize("by", [0.1, -0.2, 1 / 3, 0.5])
def test_an_edge_moves_by_parts_of_a_pixel(by: float) -> None:
    """Which pixels alone cannot tell: there the edge is as wide as two of them, and by up to 0.2 of its height off."""
    flow = np.zeros((SIZE[1], SIZE[0], 2))
    flow[..., 0] = by
    want = shown(12.4 + by).lamps[LAMP][4, 4:-4, 0]
    got = Views(shown(12.4), flow, ()).here.lamps[LAMP][4, 4:-4, 0]
    alone = Views(replace(shown(12.4), fine={}), flow, ()).here.lamps[LAMP][4, 4:-4, 0]
    assert (
        np.abs(got - want).max() < 0.08
    )  # a quarter of a third of a pixel, where the fine grid rounds an edge
    assert got.sum() == pytest.approx(want.sum(), abs=0.01)
    assert np.abs(got - want).sum() < 0.5 * np.abs(alone - want).sum() + 1e-3


def test_a_step_of_the_finer_grid_is_a_motion_by_as_much() -> None:
    flow = np.full((SIZE[1], SIZE[0], 2), 0.0)
    flow[..., 0] = 1 / FINE
    want = Views(shown(12.4), flow, ()).here.lamps[LAMP]
    assert Views(shown(12.4), None, ()).beside((1, 0)).lamps[LAMP] == pytest.approx(want, abs=1e-3)
    assert Views(shown(12.4), flow, ()).beside((-1, 0)).lamps[LAMP] == pytest.approx(
        shown(12.4).lamps[LAMP], abs=1e-3
    )


def seen_by_a_sensor(bare: Rendered) -> Condition:
    camera = replace(bare.camera, sensor=replace(bare.camera.sensor, responsivity=1000.0, full_well=1e4))
    image = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    rendered = replace(bare, camera=camera)
    return Condition((), bare.scene, camera, image, None, np.ones(image.shape[:2], bool), rendered=rendered)


def blurred_edge(at: float, sigma: float) -> np.ndarray:
    """(n,) means over pixels of an edge at ``at`` px, 1 to its left, under a Gaussian: the integral of its integral."""

    def integral(x: np.ndarray) -> np.ndarray:
        t = (x - at) / sigma
        return sigma * (t * norm.cdf(t) + norm.pdf(t))

    ends = integral(np.arange(SIZE[0] + 1.0))
    return 1 - np.diff(ends)


@pytest.mark.parametrize("sigma", [0.2, 0.35, 0.6])
@pytest.mark.parametrize("edge", [12.0, 12.4])
def test_a_blur_within_a_pixel_is_that_of_the_light(edge: float, sigma: float) -> None:
    """Within two fifths of what it changes, and nearer than pixels alone: the finer grid has parts of a third."""
    condition = seen_by_a_sensor(shown(edge))
    sharp, soft = State(condition), State(condition, [Defocus(blur=sigma)])
    want = blurred_edge(edge, sigma) - shown(edge).lamps[LAMP][4, :, 0]
    got = (soft.shown.lamps[LAMP] - sharp.shown.lamps[LAMP])[4, :, 0]
    alone = (blurred(sharp.shown.lamps[LAMP], (sigma, 0, 0, 0, EVEN)) - sharp.shown.lamps[LAMP])[4, :, 0]
    inner = slice(4, -4)
    missed, missed_alone = (np.linalg.norm((x - want)[inner]) for x in (got, alone))
    assert missed < 0.4 * np.linalg.norm(want[inner]) + 2e-3
    assert missed < 0.7 * missed_alone


def test_what_acts_within_a_pixel_is_told_by_derivatives_there() -> None:
    """By what a small step of it changes, drawn anew, over edges anywhere in a pixel; a path is off by a third, its
    fourth moment is not a Gaussian's, and a channel is moved by a cubic, which rings at edges."""
    lateral = LateralChromaticAberration(red=0.002)
    here = [Defocus(blur=0.3), lateral, MotionBlur(u=0.4, v=0.1)]
    steps = {
        ("defocus", "blur"): (Defocus(blur=float(np.hypot(0.3, 0.05))), 0.05**2, 0.2),
        ("lateral_chromatic_aberration", "blue"): (replace(lateral, blue=1e-3), 1e-3, 0.2),
        ("motion_blur", "u"): (MotionBlur(u=float(np.hypot(0.4, 0.1)), v=0.1), 0.1**2, 0.35),
    }
    for key, (more, size, within) in steps.items():
        want, got = [], []
        for edge in np.arange(12.0, 13.0, 0.1):
            condition = seen_by_a_sensor(shown(edge))
            state = State(condition, here)
            terms = {(t.cause, t.parameter): t for t in chain_terms(State(condition), Tolerances())}
            others = [e for e in here if type(e) is not type(more)]
            change = state.dn([*others, more]) - state.simulation.dn
            want.append(change[4, 4:-4].ravel() / size)
            got.append(np.asarray(terms[key].field(state))[4, 4:-4].ravel())
        a, b = np.concatenate(got), np.concatenate(want)
        assert np.corrcoef(a, b)[0, 1] > (0.85 if key[1] == "blue" else 0.95), key
        assert a @ b / (b @ b) == pytest.approx(1.0, abs=within), key


def test_a_derivative_at_the_end_of_what_may_be_is_taken_from_within() -> None:
    """Where a search may come to: one of an opened case ended there with an error."""
    condition = seen_by_a_sensor(shown(12.4))
    terms = {t.parameter: t for t in chain_terms(State(condition), Tolerances())}
    told = [
        np.asarray(terms["red"].field(State(condition, [LateralChromaticAberration(red=red)])))
        for red in (-0.05, -0.0499)
    ]
    assert np.abs(told[0]).max() > 1
    assert told[0] == pytest.approx(told[1], abs=0.05 * np.abs(told[0]).max())


def test_motions_add_up() -> None:
    """Two that are drawn together, beside what does not move, against each by itself."""
    state = State(seen_by_a_sensor(shown(12.4)))
    column, row = (plane / 10 for plane in state.grid)
    flows = [(np.ones_like(column), 0 * row), (column, row)]
    terms = [moving("camera_pose", "/eye", f"{k}", "1", 1.0, lambda s, f=f: f) for k, f in enumerate(flows)]
    terms.append(Term("exposure", "", "gain", "1", 1.0, lambda s: s.signal))
    theta = np.array([0.1, -0.03, 0.02])
    alone = sum(x * np.asarray(t.field(state)) for x, t in zip(theta, terms, strict=True))
    assert np.abs(alone).max() > 5
    assert added(state, terms, theta) == pytest.approx(alone, abs=1e-3)
    unseen = replace(terms[0], flow=lambda s: None, field=lambda s: None)
    assert not added(state, [unseen], np.ones(1)).any()


def test_a_camera_with_a_blur_and_one_that_is_given_it_see_alike() -> None:
    condition = seen_by_a_sensor(shown(12.4))
    given = [Defocus(blur=0.4), LateralChromaticAberration(red=0.01)]
    lens = replace(condition.camera.lens, blur=0.4, lateral_chromatic_aberration=(0.01, 0, 0, 0, 0, 0, 0, 0))
    own = replace(condition, camera=replace(condition.camera, lens=lens))
    assert own.simulated().dn == pytest.approx(condition.simulated(given).dn, abs=1e-3)
    assert State(own).simulation.dn == pytest.approx(own.simulated().dn, abs=1e-3)


def test_a_colour_moves_by_parts_of_a_pixel() -> None:
    """As an edge does that lies so far aside; and without it there is none left."""
    bare = shown(12.4)
    condition = seen_by_a_sensor(bare)
    red = LateralChromaticAberration(red_u=0.3 / np.hypot(SIZE[0] / 2, SIZE[1] / 2))
    apart = State(condition, [red])
    want = shown(12.7).lamps[LAMP]
    assert apart.shown.lamps[LAMP][..., 0] == pytest.approx(want[..., 0], abs=0.08)
    assert np.array_equal(apart.shown.lamps[LAMP][..., 1], bare.lamps[LAMP][..., 1])
    assert apart.simulation.dn == pytest.approx(apart.dn([red]))
    assert np.array_equal(apart.dn([]), State(condition).simulation.dn)


def test_points_are_finite_where_the_lens_images_nothing() -> None:
    """This lens folds at r = 0.91, which lies at r' = 0.62; the corner's 0.74 has no ray. Where there is one, the point
    lies far away on it."""
    camera = Camera("/eye", sensor=Sensor(SIZE, (1e-6, 1e-6)), lens=Lens(18.5e-6, distortion=(-0.3, -0.1)))
    empty = np.full((SIZE[1], SIZE[0], 3), np.nan)
    image = np.zeros((SIZE[1], SIZE[0], 1))
    rendered = replace(shown(12.4), camera=camera, passes={"position": empty})
    state = State(Condition((), rendered.scene, camera, image, None, image[..., 0] == 0, rendered=rendered))
    _, direction = camera.rays(np.stack(state.grid, axis=-1))
    there = np.isfinite(direction).all(axis=-1)
    assert not there[0, 0]
    assert there[8, 12]
    assert np.isfinite(state.position).all()
    away = state.position[there] / np.linalg.norm(state.position[there], axis=-1, keepdims=True)
    assert np.allclose(away, direction[there])

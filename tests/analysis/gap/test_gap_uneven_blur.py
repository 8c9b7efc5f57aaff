"""A blur that differs over the image, against effects and closed forms that say so themselves."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.corrected.scene import Change, changed
from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.light.radiance import means
from analysis.gap.sensor.fine_optics import EVEN, blurred, told_apart
from analysis.gap.sensor.uneven_optics import Slopes, UnevenBlur, variances
from analysis.gap.terms.aperture import variance
from analysis.gap.terms.base import Term
from analysis.gap.terms.chain import chain_terms
from analysis.gap.terms.normal_equations import NormalEquations
from analysis.gap.terms.uneven_blur import CORNER, FOURTH, LEANING, NEARER, UNEVEN
from interchange.camera import Camera
from interchange.captures import Tolerances
from interchange.effects.defocus import Defocus
from interchange.effects.field_blur import FieldBlur
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from tests.analysis.gap import test_gap_chain_terms
from tests.analysis.gap.test_gap_moved import seen_by_a_sensor, shown

condition = test_gap_chain_terms.condition  # edges of every direction


def blurs(shown: Condition) -> list[Term]:
    return [t for t in chain_terms(State(shown), Tolerances()) if t.cause == "defocus"]


def fitted(terms: list[Term], shown: Condition, truth: object) -> dict[str, float]:
    """px² of each term, by least squares without noise."""
    stands = State(shown)
    X = np.stack([np.asarray(t.field(stands)).ravel() for t in terms])
    found, *_ = np.linalg.lstsq(X.T, (stands.dn([truth]) - stands.simulation.dn).ravel(), rcond=None)
    return {t.parameter: float(x) for t, x in zip(terms, found, strict=True)}


def test_a_lens_of_a_curved_field_is_told_by_its_corner(condition: Condition) -> None:
    """σ = 0.1 px on the axis, 0.3 px in the corner, as discs of the optics draw it, which are no Gaussians: within a
    quarter, and what leans is a tenth of it at most."""
    found = fitted(blurs(condition), condition, FieldBlur(0.4, 0.8, 0.8))
    assert list(found) == ["blur", CORNER, FOURTH, *LEANING]  # all of it lies at one depth
    assert found[CORNER] + found[FOURTH] == pytest.approx(0.3**2 - 0.1**2, rel=0.25)
    assert found["blur"] == pytest.approx(0.1**2, abs=0.01)
    assert np.abs([found[n] for n in LEANING]).max() < 0.1 * found[CORNER]


def test_discs_that_grow_by_the_square_have_a_variance_that_grows_by_the_fourth(condition: Condition) -> None:
    """0.3 px in the corner and nothing on the axis: of a variance that grew by the square alone, that on the axis would
    be less than nothing. Within a quarter, as discs are no Gaussians."""
    terms, lens = blurs(condition), FieldBlur(0.0, 1.2, 1.2)
    found = fitted(terms, condition, lens)
    assert found[FOURTH] == pytest.approx(0.3**2, rel=0.25)
    assert np.abs([found["blur"], found[CORNER]]).max() < 0.1 * found[FOURTH]
    by_square = fitted([t for t in terms if t.parameter != FOURTH], condition, lens)
    assert by_square["blur"] < -0.01 < -abs(found["blur"])


def test_a_blur_that_is_alike_everywhere_is_no_uneven_one(condition: Condition) -> None:
    found = fitted(blurs(condition), condition, Defocus(blur=0.25))
    assert found["blur"] == pytest.approx(0.25**2, rel=0.25)
    assert np.abs([found[n] for n in (CORNER, *LEANING)]).max() < 0.1 * found["blur"]


def leaning(shown: Condition, tilt: float) -> Condition:
    """Seen on a plane that is nearer to the right: 1 / z = 2 + ``tilt`` of the image's half width."""
    h, w = shown.mean.shape[:2]
    z = 1 / (2 + tilt * (np.arange(w) + 0.5 - w / 2) / (w / 2))
    ray = shown.camera.rays(np.stack(np.meshgrid(np.arange(w), np.arange(h)), axis=-1).astype(float))[1]
    position = ray / ray[..., 2:] * z[None, :, None]
    return replace(shown, rendered=replace(shown.shown, passes={"position": position}))


def test_what_is_nearer_has_a_blur_by_its_depth(condition: Condition) -> None:
    """A thin lens focused behind a plane that leans: σ² = 16 px² m² (1/z - 1/z_f)², drawn by columns."""
    tilt, k, focus = 0.1, 16.0, 1.95
    there = leaning(condition, tilt)
    terms = {t.parameter: t for t in blurs(there)}
    assert list(terms) == ["blur", *UNEVEN]
    state = State(there)
    along, down = state.curvature
    heat = 0.5 * (along + down)[..., 0]  # what a px² changes
    edge = np.abs(heat) > 1
    near, off = (np.asarray(terms[n].field(state))[..., 0][edge] / heat[edge] for n in NEARER)
    inverse = (2 + tilt * (state.grid[0] + 0.5 - 48) / 48)[edge]
    middle = float(np.mean(inverse / (1 + near)))
    k_w = 2 * k * middle * (middle - focus), k * middle**2  # of k (middle (1 + w) - focus)²
    got = k * (middle - focus) ** 2 + k_w[0] * near + k_w[1] * off
    assert got == pytest.approx(k * (inverse - focus) ** 2, abs=1e-5)
    assert terms[NEARER[0]].part < terms[CORNER].part  # depths differ by a twentieth: hardly any blur does
    assert terms[NEARER[1]].part < terms[NEARER[0]].part


@pytest.mark.parametrize(
    "slopes", [Slopes(0.5), Slopes(12.0), Slopes(0.1, 0.4, -0.2), Slopes(0.2, fourth=0.5, axis=(0.1, -0.2))]
)
@pytest.mark.parametrize("sigma", [0.0, 0.3])
def test_every_place_has_the_blur_that_is_its_own(sigma: float, slopes: Slopes) -> None:
    """Of edges all over the image, against the whole of it blurred so much: means of blurs that are 0.15 px apart at
    most differ by 1 % of an edge at most (two edges cross at corners), and by 3 % of all that changes."""
    width, height, finer = 60, 45, 3
    edges = np.arange(finer * width) // 11 % 2 ^ np.arange(finer * height)[:, None] // 13 % 2
    plane = edges.astype(np.float32)[..., None]
    rms = np.sqrt(variances((height, width), sigma, slopes))
    got = means(blurred(plane, (sigma, 0.0, 0.0, 0.0, slopes), finer), finer)
    off, change = [], []
    for row, column in np.ndindex(height, width):
        if row % 9 == 4 and column % 7 == 3:
            even = blurred(plane, (float(rms[row, column]), 0.0, 0.0, 0.0, EVEN), finer)
            off.append(float((got - means(even, finer))[row, column, 0]))
            change.append(float((means(even - plane, finer))[row, column, 0]))
    assert np.abs(off).max() < 0.01
    assert np.linalg.norm(off) < 0.03 * np.linalg.norm(change)


def test_a_slab_is_the_rms_of_a_cause_however_many_parts_it_has() -> None:
    whole = Term("defocus", "", "blur", "px", 1e-3, lambda s: None, relative=True)
    parts = [whole, *(replace(whole, parameter=n, part=0.5) for n in (CORNER, *LEANING))]
    for terms in ([whole], parts):
        q = len(terms)
        e = Evidence(NormalEquations(np.eye(q), np.zeros(q), 0.0, 1.0, np.ones(q), 0.0, 10.0), terms)
        (cause,) = e.members
        index, ratio = e._wide([cause], [1.0])
        width = ratio * e.spike[index] * e.share[index]
        assert float(np.linalg.norm(width)) == pytest.approx(1.0)


def test_what_differs_over_the_image_is_no_aperture() -> None:
    blur = Term("defocus", "", "blur", "px", 1e-3, lambda s: None, power=2)
    terms = [blur, replace(blur, parameter=CORNER), replace(blur, cause="motion_blur", parameter="u")]
    assert variance(terms, np.array([0.05, -0.3, 2.0])) == pytest.approx(0.35)


def blurs_more(blur: float, corner: float, leaning: float = 0.0, fourth: float = 0.0) -> Change:
    values = {"blur": blur, CORNER: corner, FOURTH: fourth, LEANING[0]: leaning}
    return Change("defocus", "", values, dict.fromkeys(values, 0.0))


@pytest.mark.parametrize(
    ("blur", "corner", "fourth", "within"),
    [(0.0, 0.86, 0.0, 0.13), (0.3, 0.16, 0.0, 0.03), (0.5, -0.2, 0.0, 0.03), (0.0, 0.0, 0.86, 0.003)],
)
def test_a_corrected_lens_shows_what_was_found(
    blur: float, corner: float, fourth: float, within: float
) -> None:
    """Drawn on the finer grid as the diagnosis draws it, over edges from side to side: within 3 % of the change, and
    13 % where nothing is blurred on the axis, since a diameter that grows with r² is no variance that does; one that
    grows with r⁴ is that to rounding."""
    off, change = [], []
    for edge in np.arange(2.4, 22, 2.3):
        there = seen_by_a_sensor(shown(float(edge)))
        scene = Scene(cameras=(there.camera,))
        (camera,) = changed(scene, scene, blurs_more(blur, corner, 0.01, fourth)).cameras
        assert camera.lens.blur == 0
        found = State(there, [Defocus(blur=blur), UnevenBlur(corner, fourth)]).simulation.dn
        off.append(State(replace(there, camera=camera)).simulation.dn - found)
        change.append(found - State(there).simulation.dn)
    assert np.linalg.norm(off) < within * np.linalg.norm(change)


def test_a_corrected_lens_is_alike_everywhere_where_that_is_what_was_found() -> None:
    scene = Scene(cameras=(Camera("/eye"),))
    (camera,) = changed(scene, scene, blurs_more(0.3, 0.005)).cameras
    assert camera.lens.blur == pytest.approx(0.3)
    assert not FieldBlur.of(camera).is_there


def test_a_lens_with_a_blur_over_the_field_has_no_second_one() -> None:
    curved = FieldBlur(0.4, 0.8, 0.8).on(Camera("/eye"))
    scene = Scene(cameras=(curved,))
    (camera,) = changed(scene, scene, blurs_more(0.3, 0.005)).cameras
    assert FieldBlur.of(camera) == FieldBlur.of(curved)
    with pytest.raises(BrightfieldError, match="over the field already"):
        changed(scene, scene, blurs_more(0.3, 0.16))


def test_round_discs_of_a_lens_are_drawn_within_pixels() -> None:
    """By the same light as a blur of their variance; what is no disc, and what depth adds to, is left to the chain."""
    there = seen_by_a_sensor(shown(12.4))
    lens = replace(there.camera.lens, field_blur=(1.6, 0.0, 0.0, 0.0))
    alike = State(replace(there, camera=replace(there.camera, lens=lens))).simulation.dn
    assert alike == pytest.approx(State(there, [Defocus(blur=0.4)]).simulation.dn, abs=1e-3)
    for left in (
        replace(lens, field_blur=(1.6, 0.5, 0.0, 0.0)),
        replace(lens, field_blur=(1.6, 0.0, 0.0, 0.3)),
        replace(lens, f_stop=4.0, focus_distance=0.5),
    ):
        optics, camera, _ = told_apart(replace(there.camera, lens=left), [], 3)
        assert not optics.is_there
        assert camera.lens.field_blur == left.field_blur

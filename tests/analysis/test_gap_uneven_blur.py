"""A blur that differs over the image, against effects and closed forms that say so themselves."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.aperture import variance
from analysis.gap.chain_terms import chain_terms
from analysis.gap.conditions import Condition
from analysis.gap.corrected import Change, changed
from analysis.gap.evidence import Evidence
from analysis.gap.normal_equations import NormalEquations
from analysis.gap.state import State
from analysis.gap.terms import Term
from analysis.gap.uneven_blur import CORNER, LEANING, NEARER, UNEVEN
from interchange.camera import Camera
from interchange.captures import Tolerances
from interchange.effects.defocus import Defocus
from interchange.effects.field_blur import FieldBlur
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from tests.analysis import test_gap_chain_terms

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
    assert list(found) == ["blur", CORNER, *LEANING]  # all of it lies at one depth
    assert found[CORNER] == pytest.approx(0.3**2 - 0.1**2, rel=0.25)
    assert found["blur"] == pytest.approx(0.1**2, abs=0.01)
    assert np.abs([found[n] for n in LEANING]).max() < 0.1 * found[CORNER]


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


def test_a_slab_is_the_rms_of_a_cause_however_many_parts_it_has() -> None:
    whole = Term("defocus", "", "blur", "px", 1e-3, lambda s: None, relative=True)
    parts = [whole, *(replace(whole, parameter=n, part=0.5) for n in (CORNER, *LEANING))]
    for terms in ([whole], parts):
        q = len(terms)
        e = Evidence(NormalEquations(np.eye(q), np.zeros(q), 0.0, 1.0, 0.0, 10.0), terms)
        (cause,) = e.members
        index, ratio = e._wide([cause], [1.0])
        width = ratio * e.spike[index] * e.share[index]
        assert float(np.linalg.norm(width)) == pytest.approx(1.0)


def test_what_differs_over_the_image_is_no_aperture() -> None:
    blur = Term("defocus", "", "blur", "px", 1e-3, lambda s: None, power=2)
    terms = [blur, replace(blur, parameter=CORNER), replace(blur, cause="motion_blur", parameter="u")]
    assert variance(terms, np.array([0.05, -0.3, 2.0])) == pytest.approx(0.35)


def test_a_corrected_lens_has_the_blur_on_the_axis_and_in_the_corner() -> None:
    scene = Scene(cameras=(Camera("/eye"),))
    change = Change(
        "defocus",
        "",
        {"blur": 0.3, CORNER: 0.16, LEANING[0]: 0.01},
        {"blur": 0.0, CORNER: 0.0, LEANING[0]: 0.0},
    )
    (camera,) = changed(scene, scene, change).cameras
    blur = FieldBlur.of(camera)
    assert camera.lens.blur == 0
    assert blur.sigma(0.0) == pytest.approx((0.3, 0.3))
    assert blur.sigma(1.0) == pytest.approx((0.5, 0.5))
    again = Scene(cameras=(camera,))
    with pytest.raises(BrightfieldError, match="over the field already"):
        changed(again, again, change)

"""A camera that turned and a principal point elsewhere are told apart by 1 + x²/f² alone."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.gap.compared.conditions import conditions
from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.evidence.sureness import TEMPERATURE
from analysis.gap.evidence.turned import SHIFTING, alike, unexplained
from analysis.gap.judgement.attribution import called
from analysis.gap.judgement.findings import _rivals
from analysis.gap.light.radiance import render_all
from analysis.gap.renderers import renderer
from analysis.gap.search.fit import fit
from analysis.gap.terms.base import Term
from analysis.gap.terms.normal_equations import NormalEquations
from interchange.captures import Tolerances
from interchange.effects.principal_point import PrincipalPoint
from tests.analysis.gap.bench import SAMPLES, TIMES, Rig

POSE, POINT = ("camera_pose", "/Camera at (0, 0, 300) mm"), ("principal_point", "/Camera")
ELSEWHERE = ("camera_pose", "/Camera at (90, 0, 300) mm")
N = 400  # pixels of a row, and of a column
STEEP, AWAY = 0.2, 6.0  # σ that their light changes by a px; px that the image is off by


def _evidence(field: float, *others: tuple[str, str]) -> Evidence:
    """Of a row and a column of pixels from -``field`` to ``field``, x/f; ``others``: causes that shift it alike."""
    x = np.linspace(-field, field, N)
    turned = {"cx": 1.0 + 0 * x, "ry": 1 + x**2, "cy": 1.0 + 0 * x, "rx": 1 + x**2}
    terms, columns = [], []
    for cause in (POINT, POSE, *others):
        for parameter in SHIFTING[cause[0]]:
            along = parameter in ("cx", "ry")
            terms.append(Term(*cause, parameter, "px", 0.02, lambda s: None, kind="flow"))
            shift = STEEP * turned[parameter]
            columns.append(np.concatenate([shift, 0 * x] if along else [0 * x, shift]))
    X = np.array(columns)
    theta = np.zeros(len(X))
    theta[0] = AWAY
    r = theta @ X
    share = np.full(len(X), 1e4)
    return Evidence(NormalEquations(X @ X.T, X @ r, float(r @ r) + 2 * N, 1e4, share, 0.0, 2 * N), terms)


@pytest.mark.parametrize("field", [0.1, 0.3, 1.0])
def test_what_the_other_leaves_is_that_of_least_squares(field: float) -> None:
    evidence = _evidence(field)
    evidence.spike[:] = 1e-9  # nothing is free but the turn
    theta = np.array([AWAY, 0, 0, 0])
    x = np.linspace(-field, field, N)
    turn = 1 + x**2
    expected = (AWAY * STEEP) ** 2 * (N - turn.sum() ** 2 / (turn**2).sum())
    assert unexplained(evidence, POINT, theta, POSE) == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_a_narrow_field_leaves_them_tied_and_a_wide_one_does_not() -> None:
    for field, tied in ((0.1, True), (2.0, False)):
        evidence = _evidence(field)
        best = evidence.best((POINT,), {})
        other, times = alike(evidence, best, evidence.theta(best))[POINT]
        assert other == POSE
        assert (times > 0.95) is tied
        assert times == pytest.approx(
            np.exp(-unexplained(evidence, POINT, evidence.theta(best), POSE) / (2 * TEMPERATURE))
        )
    assert times < 0.01


def test_a_turned_camera_has_the_principal_point_beside_it() -> None:
    evidence = _evidence(0.1)
    best = evidence.best((POSE,), {})
    assert alike(evidence, best, evidence.theta(best))[POSE][0] == POINT


def test_where_a_camera_has_several_stands_none_of_its_poses_is_a_principal_point() -> None:
    evidence = _evidence(0.1, ELSEWHERE)
    best = evidence.best((POINT,), {})
    assert alike(evidence, best, evidence.theta(best)) == {}


def test_what_is_found_already_or_is_another_camera_s_is_no_rival() -> None:
    evidence = _evidence(0.1)
    both = evidence.best((POSE, POINT), {})
    assert alike(evidence, both, evidence.theta(both)) == {}
    terms = [replace(t, target="/Other") if t.candidate == POINT else t for t in evidence.terms]
    apart = Evidence(evidence.e, terms)
    best = apart.best((POSE,), {})
    assert alike(apart, best, apart.theta(best)) == {}


def test_the_report_lists_it_as_a_rival() -> None:
    evidence = _evidence(0.1)
    best = evidence.best((POINT,), {})
    fitted = SimpleNamespace(
        best=best, hypotheses=(best,), probability={POINT: 0.48}, alike={POINT: (POSE, 0.9)}
    )
    assert _rivals(fitted, [POINT]) == (("camera_pose", pytest.approx(0.432)),)


@pytest.mark.slow
def test_captures_do_not_tell_a_shift_of_the_image_from_a_turn(rig: Rig) -> None:
    """Its sensitivities and those of the pose are of one stand: from 0.1 px away edges look another way, and what one
    of them left of the other was up to 54 sigma²."""
    off, times = PrincipalPoint(cx=0.4, cy=-0.2), TIMES[:5]  # of Camera0, the last two alike
    scenes = [off.on_scene(rig.document.scene(t), "/World/Camera0") for t in times]
    views = [(s, s.camera("/World/Camera0")) for s in scenes]
    with renderer("realtime", SAMPLES, reflected=False) as (render, settings):
        moved = replace(rig, truth=render_all(views, render, settings, rig.cache), times=times)
    given = conditions(moved.captured("a shift", ()), rig.document)
    shown = dict(zip(TIMES, rig.truth, strict=True))
    found = fit([replace(c, rendered=shown[c.captures[0].time]) for c in given], Tolerances())
    cause = ("principal_point", "/World/Camera0")
    assert found.best.causes == (cause,)
    (name, _), as_probable = found.alike[cause]
    assert name == "camera_pose"
    assert as_probable > 0.7  # M of 1.4; the field is 25 degrees wide
    assert called(found) == [cause]
    assert 0.4 < found.probability[cause] < 0.6

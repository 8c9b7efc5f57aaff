"""Tolerances that are too small, told from numbers drawn with another width; and one number that is off by itself."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.evidence.hypotheses import best_first
from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.evidence.scales import (
    COLORS,
    DRIFT,
    EXPOSURES,
    LEFT,
    PATTERNS,
    averaged,
    factors,
    shares,
    told_apart,
    widths,
)
from analysis.gap.terms.base import Term
from analysis.gap.terms.generic import CAPTURE
from analysis.gap.terms.normal_equations import NormalEquations
from interchange.captures import Tolerances

EACH, PIXELS, NOISE = 20, 4000, 0.05
SPIKE = 0.005


def _terms(t: Tolerances) -> list[Term]:
    """Twenty lamps and twenty albedos; a flat field and what is told by it without being one."""
    told = [("light_intensity", t.light_intensity), ("albedo", t.albedo)]
    terms = [Term(n, f"{n} {k}", "scale", "1", s, lambda s: None) for n, s in told for k in range(EACH)]
    field = Term("fixed to the image, multiplicative", "", "1,0", "1", t.flat_field, lambda s: None)
    return [*terms, field, replace(field, cause="veiling_glare", spike=t.flat_field / 12)]


def _evidence(theta: np.ndarray, left: float = 1.0) -> Evidence:
    """A signal of 1 that ``theta`` changes by columns that are noise, seen with ``left`` times the noise expected."""
    rng = np.random.default_rng(5)
    X = rng.standard_normal((len(theta), PIXELS)) / NOISE
    r = theta @ X + left * rng.standard_normal(PIXELS)
    own = np.full(len(theta), PIXELS / NOISE**2)
    e = NormalEquations(X @ X.T, X @ r, float(r @ r), PIXELS / NOISE**2, own, 0.0, PIXELS)
    return Evidence(e, _terms(Tolerances()))


def _found(evidence: Evidence) -> dict[str, float]:
    own = shares(_terms(Tolerances()), _terms(told_apart(Tolerances())))
    return factors(evidence, evidence.spike, own, best_first(evidence))


def _drawn(lamps: float, albedos: float, seed: int = 7) -> np.ndarray:
    scale = np.repeat([lamps, albedos, 0.0], [EACH, EACH, 2])
    return scale * SPIKE * np.random.default_rng(seed).standard_normal(len(scale))


def test_what_goes_with_which_tolerance() -> None:
    own = shares(_terms(Tolerances()), _terms(told_apart(Tolerances())))
    assert own["light_intensity"] == pytest.approx([1.0] * EACH + [0.0] * (EACH + 2))
    assert own["flat_field"] == pytest.approx([0.0] * 2 * EACH + [1.0, 0.0])
    assert own[LEFT] == pytest.approx([0.0] * 2 * EACH + [0.0, 1.0])
    wide = widths(own, {"light_intensity": 3.0, LEFT: 2.0}, 2 * EACH + 3)
    assert wide == pytest.approx([3.0] * EACH + [1.0] * (EACH + 1) + [2.0, 1.0])


def test_as_declared_stays_as_declared() -> None:
    assert _found(_evidence(_drawn(1, 1))) == {}


def test_a_tolerance_that_is_too_small_is_told_and_no_effect_beside_it() -> None:
    """Of 20 numbers a width is known to 1 / sqrt(40), 16 %, and drawn towards what is declared; steps of the ladder are
    33 to 50 %. Of eight draws, one may have a number so far off that it is called."""
    called = {"declared": 0, "as large as they look": 0}
    for seed in range(100, 108):
        evidence = _evidence(_drawn(1, 3, seed))
        called["declared"] += bool(best_first(evidence)[0].causes)
        found = _found(evidence)
        assert found == {"albedo": pytest.approx(2.2, abs=1)}
        spikes = evidence.spike * widths(
            shares(_terms(Tolerances()), _terms(told_apart(Tolerances()))), found, len(evidence.terms)
        )
        there = Evidence(evidence.e, evidence.terms, spikes=spikes)
        called["as large as they look"] += bool(best_first(there)[0].causes)
    assert called["declared"] == 8
    assert called["as large as they look"] <= 1


def test_what_needs_a_tolerance_to_be_just_so_is_less_probable() -> None:
    """Three numbers of twenty are off by 5 tolerances: an effect each as declared; a tolerance twice as large says
    nearly the same."""
    theta = _drawn(1, 1)
    theta[EACH : EACH + 3] = [5 * SPIKE, -5 * SPIKE, 5 * SPIKE]
    evidence, own = _evidence(theta), shares(_terms(Tolerances()), _terms(told_apart(Tolerances())))
    hypotheses = best_first(evidence)
    told = averaged(evidence, evidence.spike, own, hypotheses, {})
    assert {h.causes for h in told} == {h.causes for h in hypotheses}
    best = hypotheses[0]
    assert best.causes
    none = [next(h.score for h in some if not h.causes) for some in (hypotheses, told)]
    assert next(h.score for h in told if h.causes == best.causes) == pytest.approx(best.score)
    assert none[1] > none[0] + 1


def test_one_number_far_off_is_an_effect() -> None:
    theta = _drawn(1, 1)
    theta[3] = 8 * SPIKE
    evidence = _evidence(theta)
    assert best_first(evidence)[0].causes == (("light_intensity", "light_intensity 3"),)
    assert _found(evidence) == {}


def test_where_nothing_explains_the_captures_no_tolerance_is_judged() -> None:
    assert _found(_evidence(_drawn(1, 3), left=1.2)) == {}


def test_few_numbers_tell_no_tolerance() -> None:
    """Both numbers that go by the flat field are far off."""
    theta = _drawn(1, 1)
    theta[-2:] = [20 * 0.003, 0.0]
    assert "flat_field" not in _found(_evidence(theta))


def test_one_material_that_is_off_is_no_tolerance() -> None:
    """Eight numbers of two things, all off by four tolerances; the same of eight things."""
    for things, judged in ((2, False), (8, True)):
        terms = [Term("gloss", str(k % things), f"p{k}", "1", 0.02, lambda s: None) for k in range(8)]
        rng = np.random.default_rng(3)
        X = rng.standard_normal((8, PIXELS)) / NOISE
        theta = 0.08 * np.where(np.arange(8) % 3, 1.0, -1.0)
        r = theta @ X + rng.standard_normal(PIXELS)
        e = NormalEquations(
            X @ X.T, X @ r, float(r @ r), PIXELS / NOISE**2, np.full(8, PIXELS / NOISE**2), 0.0, PIXELS
        )
        evidence = Evidence(e, terms)
        own = {"gloss": np.ones(8)}
        assert bool(factors(evidence, evidence.spike, own, best_first(evidence))) == judged


def test_what_is_not_declared_is_judged_apart_from_what_it_is_a_share_of() -> None:
    """Colors, exposures and what differs between captures go with the lamps' intensity, patterns of surfaces with the
    albedo, by shares that are guesses."""

    def terms(t: Tolerances) -> list[Term]:
        lamp, *_ = _terms(t)
        of_lamps = [
            replace(lamp, cause=c, spike=0.2 * t.light_intensity)
            for c in ("light_spectrum", CAPTURE, "exposure")
        ]
        albedo = replace(lamp, cause="albedo", spike=t.albedo)
        return [lamp, *of_lamps, albedo, replace(albedo, cause="texture", spike=0.5 * t.albedo)]

    own = shares(terms(Tolerances()), terms(told_apart(Tolerances())))
    wanted = ("light_intensity", COLORS, DRIFT, EXPOSURES, "albedo", PATTERNS)
    for k, name in enumerate(wanted):
        assert own[name] == pytest.approx(np.eye(6)[k])
    assert sum(own.values()) == pytest.approx(np.ones(6))

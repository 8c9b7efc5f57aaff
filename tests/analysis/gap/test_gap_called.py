"""What is not probable closes nothing, and what is left is fitted without it."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.evidence.belief import in_its_place
from analysis.gap.evidence.caution import Caution
from analysis.gap.evidence.likelihood import Evidence, Hypothesis
from analysis.gap.judgement.attribution import called, errors_alone
from analysis.gap.judgement.calling import beside_structure, less_what_is_slight, only_called
from analysis.gap.search.fit import Fit
from analysis.gap.search.model import Model
from analysis.gap.terms.base import Term
from analysis.gap.terms.normal_equations import NormalEquations

A, B = ("response_curve", ""), ("exposure", "")


def _fit(p_a: float, p_b: float) -> Fit:
    """Two causes that do nearly the same; both were fitted."""
    rng = np.random.default_rng(2)
    x = rng.standard_normal(3000) / 0.05
    X = np.stack([x, x + 0.3 * rng.standard_normal(3000) / 0.05])
    r = 0.3 * X[0] + 0.2 * X[1] + rng.standard_normal(3000)
    signal = 3000 / 0.05**2
    e = NormalEquations(X @ X.T, X @ r, float(r @ r), signal, np.full(2, signal), 0.0, 3000)
    terms = tuple(Term(*c, "p", "1", 0.001, lambda s: None) for c in (A, B))
    evidence, both, none = Evidence(e, terms), Hypothesis((A, B), (0.1, 0.1), 30.0, 0.0), np.zeros(2)
    before, after = Model(terms, none, none), Model(terms, evidence.theta(both), none)
    return Fit(
        before,
        after,
        (both,),
        {A: p_a, B: p_b},
        terms,
        evidence,
        evidence,
        (),
        none,
        none,
        none[None][:0],
        {},
        lambda h: Model(terms, evidence.theta(h), none),
    )


def test_the_likeliest_of_several_that_look_alike_is_called_where_one_of_them_is_there() -> None:
    """A white balance and the colour of the one material that is seen: one is there, no capture says which."""
    fitted = replace(_fit(0.9, 0.4), in_place={A: 1.0, B: 2.0})
    assert called(fitted) == [A, B]
    assert called(replace(fitted, in_place={A: 1.0, B: 1.2})) == [A]  # that there is one is not probable
    assert called(replace(fitted, probability={A: 0.9, B: 0.2}, in_place={A: 1.0, B: 4.0})) == [
        A
    ]  # of too many
    doubtful = {B: Caution(0.0, 0.6, 0.45)}
    assert called(replace(fitted, cautions=doubtful)) == [A]  # conditions do not agree on it


def test_beside_what_has_no_name_the_likeliest_is_not_all_that_may_be_there() -> None:
    fitted = replace(_fit(0.9, 0.4), in_place={A: 1.0, B: 2.0})
    unnamed = Hypothesis((A, B, ("fixed to the image", "")), (0.1,) * 3, 30.0, 0.0)
    assert called(replace(fitted, hypotheses=(unnamed,))) == [A]


def test_what_may_be_in_a_cause_s_place_has_a_name_and_is_beside_the_same_others() -> None:
    C, unnamed = ("albedo", "paint"), ("fixed to the image", "")
    log = {(A, B): 0.6, (A, C): 0.3, (A, unnamed): 0.05, (B,): 0.05}
    hypotheses = [
        Hypothesis(causes, (0.1,) * len(causes), float(np.log(p)), 0.0) for causes, p in log.items()
    ]
    named = {A, B, C}
    assert in_its_place(hypotheses, (A, B), B, named) == pytest.approx(0.95 / 0.65)
    assert in_its_place(hypotheses, (A, B), A, named) == pytest.approx(
        1.0
    )  # B alone has nothing in its place


def test_all_that_is_called_stays_as_it_was_fitted() -> None:
    fitted = _fit(0.9, 0.8)
    assert called(fitted) == [A, B]
    assert only_called(fitted) is fitted
    assert fitted.after.theta == pytest.approx([0.3, 0.2], abs=0.01)


def test_what_is_called_is_fitted_without_the_rest() -> None:
    """Least squares on the first column, of what the second's tolerance leaves: a tenth of what it was fitted to be."""
    sure = only_called(_fit(0.9, 0.3))
    assert called(sure) == [A]
    G, b, theta = sure.evidence.e.G, sure.evidence.e.b, sure.after.theta
    assert theta[0] == pytest.approx((b[0] - G[0, 1] * theta[1]) / G[0, 0], rel=1e-3)
    assert theta[0] == pytest.approx(0.48, abs=0.03)
    assert abs(theta[1]) < 0.03


def test_what_is_called_closes_no_more_than_it_does() -> None:
    """A black level 4 DN off, which an error of the calibration may be, is one after and before: the vignetting that
    was called closed it."""
    sure = only_called(_fit(0.9, 0.3))
    assert sure.before.theta[0] == 0.0
    assert sure.before.theta[1] == sure.after.theta[1] != 0.0


def test_errors_have_what_calibration_leaves_of_causes_that_are_not_called() -> None:
    """As the claim has: photographs of a board had a lens and a glare that was not called, 17 DN in black squares of
    the file rendered anew and 20 where it was claimed."""
    sure = only_called(_fit(0.9, 0.3))
    errors = errors_alone(sure)
    assert errors.theta[0] == sure.before.theta[0] == 0.0
    assert errors.theta[1] == sure.after.theta[1] != 0.0


def test_nothing_called_is_the_file_at_its_best() -> None:
    fitted = _fit(0.3, 0.3)
    assert only_called(fitted).after is fitted.before


def test_a_larger_error_of_the_calibration_is_the_files_at_its_best() -> None:
    """A camera's pose six tolerances off that is "none" left chi 1.65, as no simulation had it."""
    fitted = replace(_fit(0.2, 0.3), cautions={A: Caution(0.7, 0.0, 1.0), B: Caution(0.3, 0.0, 1.0)})
    said = only_called(fitted)
    assert said.before is said.after
    assert called(said) == []
    alone = fitted.stood(fitted.best.of([A]))
    assert said.after.theta == pytest.approx(alone.theta)
    assert said.after.theta[0] == pytest.approx(
        0.48, abs=0.03
    )  # with what the other's tolerance leaves of that


@pytest.mark.parametrize(
    ("none", "tail", "causes"), [(-0.4, 0.4, ()), (-2.0, 0.45, (A, B)), (-2.0, 0.1, None)]
)
def test_none_is_simulated_as_what_explains_it(
    none: float, tail: float, causes: tuple[tuple[str, str], ...] | None
) -> None:
    """Tolerances as declared, where they are likelier than larger ones; larger ones, where those are; what a fit with
    causes leaves of them, where that there is nothing is improbable."""
    best = Hypothesis((A, B), (0.1, 0.1), 0.0, 0.0)
    both = {c: Caution(tail**0.5, 0.0, 1.0) for c in (A, B)}
    fitted = replace(_fit(0.3, 0.3), hypotheses=(best, Hypothesis((), (), none, 0.0)), cautions=both)
    if causes:  # each by itself is as likely an effect
        assert fitted.larger_errors == causes
    said = only_called(fitted)
    expected = fitted.before if causes is None else fitted.stood(best.of(causes))
    assert said.after.theta == pytest.approx(expected.theta)
    assert said.before is said.after


@pytest.mark.parametrize(("p", "gain", "goes"), [(0.3, 5.0, True), (0.3, 15.0, False), (0.6, 5.0, False)])
def test_what_is_slight_goes_before_anything_is_told_of_it(p: float, gain: float, goes: bool) -> None:
    """Neither what is called, nor what captures speak for: that may be when it is weighed by another noise."""
    fitted = _fit(p, 0.1)
    none = Hypothesis((), (), fitted.best.log_Z - gain, 0.0)
    fitted = replace(fitted, hypotheses=(fitted.best, none))
    assert fitted.gain == pytest.approx(gain)
    found = less_what_is_slight(fitted)
    assert (found.after is fitted.before) is goes
    assert (found is fitted) is not goes
    assert found.best is fitted.best  # what may be there is told all the same


def test_beside_structure_a_cause_is_as_probable_as_it_outweighs_it() -> None:
    """p E / (E + p_left E_left) of each, E of 3000 values; as it was where there is none."""
    fitted = _fit(0.9, 0.8)
    assert beside_structure(fitted, -1.0, 0.4) is fitted
    G, theta = fitted.evidence.e.G, fitted.after.theta
    left = 0.25 * theta[0] ** 2 * G[0, 0] / 3000  # σ² of a value
    doubted = beside_structure(fitted, left, 0.8)
    assert doubted.probability[A] == pytest.approx(0.9 / 1.2)
    own = theta[1] ** 2 * G[1, 1]
    assert doubted.probability[B] == pytest.approx(0.8 * own / (own + 0.2 * theta[0] ** 2 * G[0, 0]))
    assert doubted.after is fitted.after


@pytest.mark.parametrize("causes", [(), (A,), (A, B)])
def test_numbers_vary_together_as_their_hypothesis_says(causes: tuple[tuple[str, str], ...]) -> None:
    """(G + P)^-1, with P of the hypothesis's own widths."""
    evidence = _fit(0.9, 0.9).evidence
    h = evidence.best(causes, dict.fromkeys(causes, 0.1))
    wide = [max(0.1 / evidence.together[k], 2 * 0.001) for k in range(2)]
    sd = [min(wide[k], 40 * 0.001) if c in causes else 0.001 for k, c in enumerate((A, B))]
    covariance = np.linalg.inv(evidence.e.G + np.diag(1 / np.square(sd)))
    np.testing.assert_allclose(evidence.covariance(h, [1, 0]), covariance[:, [1, 0]], rtol=1e-6)

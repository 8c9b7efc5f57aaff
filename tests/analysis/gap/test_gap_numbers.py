"""The numbers of a hypothesis, where some may not be below a least one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.search.numbers import possible
from analysis.gap.terms.base import NUISANCE, Term
from analysis.gap.terms.normal_equations import NormalEquations

GLARE = ("glare", "")


def _evidence(truth: np.ndarray, low: float) -> Evidence:
    """A cause with three numbers that look alike by three quarters, and a tolerance that looks like them by half."""
    alike = np.array(
        [[1.0, 0.75, 0.75, 0.5], [0.75, 1.0, 0.75, 0.5], [0.75, 0.75, 1.0, 0.5], [0.5, 0.5, 0.5, 1.0]]
    )
    G = 4e4 * alike
    number = Term("glare", "", "g", "1", 0.004, lambda s: None, low=low)
    terms = [replace(number, parameter=p) for p in ("g", "halo", "lost")]
    terms.append(Term(NUISANCE, "", "field", "1", 0.004, lambda s: None))
    signal = np.full(4, 4e4)
    return Evidence(NormalEquations(G, G @ truth, float(truth @ G @ truth), 4e4, signal, 0.0, 1000), terms)


@pytest.mark.parametrize(
    "truth", [(-0.02, 0.1, 0.15, 0.01), (-0.02, -0.1, 0.1, -0.01), (0.02, 0.05, 0.1, 0.01)]
)
def test_numbers_below_their_least_are_that_and_the_rest_is_found_beside_them(
    truth: tuple[float, ...],
) -> None:
    """Against the least of what the evidence minimises, -log of the posterior, within the bounds, by another way."""
    evidence = _evidence(np.array(truth), 0.0)
    h = evidence.best((GLARE,), {})
    index, ratio = evidence._wide(h.causes, h.slabs)
    width = evidence.spike.copy()
    width[index] *= ratio
    A = evidence.e.G + np.diag(width**-2)
    scale = 1 / np.sqrt(np.diag(A))
    found = minimize(
        lambda x: (0.5 * x @ A @ x - evidence.e.b @ x, A @ x - evidence.e.b),
        np.zeros(4),
        jac=True,
        bounds=[(0, None)] * 3 + [(None, None)],
        options={"ftol": 1e-15, "gtol": 1e-9, "maxiter": 10000},
    ).x
    theta = possible(evidence, h)
    assert theta == pytest.approx(found, abs=0.01 * scale.max())  # a hundredth of a standard deviation
    assert (theta[:3] >= 0).all()


def test_numbers_that_nothing_tells_apart_are_no_error() -> None:
    """Two columns that are the same: their sum alone is told."""
    evidence = _evidence(np.array([-0.02, 0.1, 0.15, 0.01]), 0.0)
    e = evidence.e
    pick = [1, 1, 2, 3]
    same = replace(e, G=e.G[np.ix_(pick, pick)], b=e.b[pick] - 4e4 * 0.4 * np.array([0, 0, 1, 0]))
    twice = Evidence(same, evidence.terms)
    h = twice.best((GLARE,), {})
    theta = possible(twice, h)
    assert twice.theta(h)[:3].min() < 0 <= theta[:3].min()
    assert theta[0] == pytest.approx(theta[1], rel=1e-6)


def test_numbers_that_may_be_what_they_are_stay() -> None:
    truth = np.array([-0.02, 0.1, 0.15, 0.01])
    evidence = _evidence(truth, -np.inf)
    h = evidence.best((GLARE,), {})
    np.testing.assert_array_equal(possible(evidence, h), evidence.theta(h))


def test_the_covariance_of_terms_is_their_deviation_squared() -> None:
    evidence = _evidence(np.array([0.02, 0.05, 0.1, 0.01]), 0.0)
    h = evidence.best((GLARE,), {})
    covariance = evidence.covariance(h, np.arange(4))
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), evidence.sigma(h), rtol=1e-8)
    along = np.array([1.0, -2.0, 0.5, 3.0])
    assert along @ covariance @ along == pytest.approx(evidence.variance(h, along))

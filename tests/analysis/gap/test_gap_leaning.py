"""A search tells log Z of hypotheses from the causes that it leans on: the same as from none."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.evidence.bounded import raised
from analysis.gap.evidence.hypotheses import best_first
from analysis.gap.evidence.likelihood import REACH, Evidence
from analysis.gap.terms.base import Term
from analysis.gap.terms.normal_equations import NormalEquations

NAMES = ("a", "a", "b", "c", "c", "c")


@pytest.fixture
def equations() -> NormalEquations:
    rng = np.random.default_rng(0)
    X = rng.standard_normal((len(NAMES), 400)) @ np.diag(rng.uniform(5, 20, 400))
    r = np.array([0.02, -0.01, 0.03, 0.0, 0.01, 0.0]) @ X + rng.standard_normal(400)
    return NormalEquations(X @ X.T, X @ r, float(r @ r), 6e4, np.full(len(NAMES), 6e4), 0.0, 400)


def _terms(low: float, held: bool = True) -> list[Term]:
    plain = Term("", "", "p", "1", 0.005, lambda s: None)
    return [replace(plain, cause=n, low=low if n == "b" else -np.inf, held=held) for n in NAMES]


@pytest.mark.parametrize("low", [-np.inf, 0.0, 0.1])  # 0.1: b is below what it may be, however it is told
def test_log_z_is_the_same_from_everywhere(equations: NormalEquations, low: float) -> None:
    names = [(n, "") for n in "abc"]
    width = dict(zip(names, (0.01, 0.03, 0.1), strict=True))
    for leant in ([], names[:1], names[1:2], names[::2]):
        plain, leaning = (Evidence(equations, _terms(low)) for _ in range(2))
        leaning.lean(leant, width)
        for causes in (names[:1], names[:2], names[1:], names):
            slabs = [width[c] for c in causes]
            told = leaning.log_Z(tuple(causes), slabs)
            assert told == pytest.approx(plain.log_Z(tuple(causes), slabs), abs=1e-8)
            free = Evidence(equations, _terms(-np.inf)).log_Z(tuple(causes), slabs)
            assert (told < free - 1) == (low == 0.1 and names[1] in causes)
            bare = Evidence(equations, _terms(low, held=False)).log_Z(tuple(causes), slabs)
            assert bare == (-np.inf if told < free - 1 else pytest.approx(told))


def test_what_a_term_costs_that_would_be_below_what_it_may_be(equations: NormalEquations) -> None:
    """Half of what χ², the priors' included, is larger by where the term stands at its least: solved for directly."""
    low, width = 0.1, (0.01, 0.03)
    causes = (("a", ""), ("b", ""))
    bounded, free = Evidence(equations, _terms(low)), Evidence(equations, _terms(-np.inf))
    cost = free.log_Z(causes, width) - bounded.log_Z(causes, width)
    wide, ratio = free._wide(causes, width)
    sd = free.spike.copy()
    sd[wide] *= ratio
    A = equations.G + np.diag(sd**-2)
    (b,) = free.members["b", ""]
    sigma = np.sqrt(np.linalg.inv(A)[b, b])
    others = np.delete(np.arange(len(NAMES)), b)
    rest = np.linalg.solve(A[np.ix_(others, others)], equations.b[others] - A[others, b] * low)
    held = np.insert(rest, b, low)
    best = np.linalg.solve(A, equations.b)
    assert best[b] < low - REACH * max(free.spike[b], sigma)  # further than errors reach
    assert cost == pytest.approx(0.5 * (held - best) @ A @ (held - best))


def test_an_evidence_goes_when_it_is_no_longer_held(equations: NormalEquations) -> None:
    """Its matrices are large: none waits for the collector of cycles."""
    gc.disable()
    try:
        evidence = Evidence(equations, _terms(0.0))
        best_first(evidence)
        gone = weakref.ref(evidence)
        del evidence
        assert gone() is None
    finally:
        gc.enable()


def test_terms_of_which_one_falls_as_the_other_rises_cannot_both_be_raised() -> None:
    theta, covariance = np.array([-1.0, -1.0]), np.array([[0.01, -0.01], [-0.01, 0.01]])
    assert raised(theta, covariance, np.zeros(2), np.zeros(2), np.ones(2, bool)) == np.inf


def test_terms_that_are_one_stand_together() -> None:
    theta, covariance = np.array([-1.0, -1.0]), np.full((2, 2), 0.01)
    assert raised(theta, covariance, np.zeros(2), np.full(2, -0.01), np.ones(2, bool)) == pytest.approx(
        0.5 * (1 / 0.1) ** 2
    )

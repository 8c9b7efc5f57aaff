"""What stays of a fit without one of its causes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.judgement.attribution import refitted
from analysis.gap.search.model import Model
from analysis.gap.terms.base import NUISANCE, Term
from analysis.gap.terms.normal_equations import NormalEquations

LENS, GLARE = ("lens", ""), ("glare", "")


def test_what_undoes_a_cause_goes_with_it() -> None:
    """A glare that a lamp looks like by nine tenths, beside a lens: without the glare lamp and lens are what least
    squares without its column gives, not what they were beside it."""
    G = 4e4 * np.array([[1.0, 0.3, 0.2], [0.3, 1.0, 0.9], [0.2, 0.9, 1.0]])
    truth = np.array([0.05, 0.03, -0.02])
    spikes = np.array([1e-5, 1e-5, 0.01])  # of the causes: calibration leaves next to nothing of them
    terms = [
        Term(*LENS, "k", "1", spikes[0], lambda s: None, True),
        Term(*GLARE, "g", "1", spikes[1], lambda s: None, True),
        Term(NUISANCE, "", "lamp", "1", spikes[2], lambda s: None),
    ]
    signal = np.full(3, 4e4)
    e = NormalEquations(G, G @ truth, float(truth @ G @ truth), 4e4, signal, 0.0, 1000)
    evidence = Evidence(e, terms, spikes=spikes)
    best = evidence.at((LENS, GLARE), (0.1, 0.1))
    zero = np.zeros(3)
    fit: Any = SimpleNamespace(
        best=best,
        weighed=evidence,
        terms=terms,
        probability={LENS: 0.99, GLARE: 0.99},
        before=Model(tuple(terms), zero, zero),
        after=Model(tuple(terms), evidence.theta(best), zero),
    )
    found = refitted(fit, [GLARE]).theta
    ratio = evidence._wide((LENS,), (0.1,))[1]
    A = G[np.ix_([0, 2], [0, 2])] + np.diag([(spikes[0] * ratio[0]) ** -2, spikes[2] ** -2])
    assert found[[0, 2]] == pytest.approx(np.linalg.solve(A, e.b[[0, 2]]), rel=1e-3)
    assert found[1] == 0
    assert found[2] * evidence.theta(best)[2] < 0  # the lamp does now what the glare did
    np.testing.assert_array_equal(refitted(fit, []).theta, evidence.theta(best))

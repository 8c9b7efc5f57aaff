"""The smallest severity that shows is where the evidence says so, and no smaller one is found."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.caution import tail
from analysis.gap.detectable import SURE, detectable
from analysis.gap.evidence import SLABS, SLIGHT, Evidence
from analysis.gap.normal_equations import NormalEquations
from analysis.gap.terms import Term


def evidence(n: int = 900) -> Evidence:
    """A signal of 1 seen with σ 0.05; two effects unlike each other, and one that is nowhere in the image."""
    rng = np.random.default_rng(1)
    X = np.stack([np.linspace(-1, 1, n), rng.standard_normal(n), np.zeros(n)]) / 0.05
    terms = [
        Term(name, "", "p", "1", 0.002, lambda s: None) for name in ("vignetting", "texture", "anisotropy")
    ]
    return Evidence(
        NormalEquations(X @ X.T, np.zeros(3), 0.0, n / 0.05**2, np.full(3, n / 0.05**2), 0.0, n), terms
    )


def seen(e: Evidence, b: np.ndarray) -> Evidence:
    """The same terms where the captures say ``b`` = X' W r."""
    return Evidence(replace(e.e, b=b), e.terms)


def probability(e: Evidence, cause: str) -> float:
    h = e.best(((cause, ""),), {})
    return 1 - tail(e, e.spike, h, (cause, ""))


@pytest.mark.parametrize("name", ["vignetting", "texture"])
def test_what_is_told_is_where_the_probability_is_reached(name: str) -> None:
    e = evidence()
    k = [t.cause for t in e.terms].index(name)
    told = next(d for d in detectable(e, e.spike) if d.cause[0] == name)
    for factor, sure in ((0.99, False), (1.01, True)):
        size = factor * told.easiest / e.share[k]
        assert bool(probability(seen(e, e.e.G[:, k] * size), name) > SURE) == sure


def test_what_is_not_in_the_image_is_not_told() -> None:
    assert {d.cause[0] for d in detectable(evidence(), np.full(3, 0.002))} == {"vignetting", "texture"}


def test_a_wider_tolerance_hides_more() -> None:
    e = evidence()
    wide = Evidence(e.e, [replace(t, spike=5 * t.spike) for t in e.terms])
    assert detectable(wide, wide.spike)[0].easiest > 2 * detectable(e, e.spike)[0].easiest


def test_a_way_drawn_by_lot_is_harder_than_the_best_and_the_worst_target_the_hardest() -> None:
    """Two numbers of one effect, of which a wide tolerance hides one; and a second lamp, hidden altogether."""
    rng = np.random.default_rng(2)
    X = rng.standard_normal((3, 900)) / 0.05
    spikes = {("a", "p"): 0.002, ("a", "q"): 0.05, ("b", "p"): 0.05}
    terms = [Term("light_position", t, n, "1", s, lambda s: None) for (t, n), s in spikes.items()]
    e = NormalEquations(X @ X.T, np.zeros(3), 0.0, 900 / 0.05**2, np.full(3, 900 / 0.05**2), 0.0, 900)
    own = np.array(list(spikes.values()))
    (both,) = detectable(Evidence(e, terms), own)
    (first,) = detectable(Evidence(e.of(np.array([0, 1])), terms[:2]), own[:2])
    assert both.cause == first.cause == ("light_position", "a")
    assert first.easiest < first.hardest < both.hardest
    assert both.easiest == pytest.approx(first.easiest, rel=0.2)  # one more lamp to choose among


def test_shares_and_ways_are_counted_as_the_evidence_counts_them() -> None:
    """The quadratic form is what the evidence itself says of captures with that error."""
    e = evidence()
    theta = 0.03
    for slab in (SLIGHT, *SLABS):
        Q, cost = e.alone(("texture", ""), slab)
        there = seen(e, e.e.G[:, 1] * theta)
        want = there.at((("texture", ""),), (slab,)).log_Z - there.at((), ()).log_Z
        want += there.chosen((("texture", ""),)) - there.averaged((("texture", ""),))
        assert theta**2 * Q[0, 0] - cost == pytest.approx(want, rel=1e-6)

"""The smallest severity that shows is where the evidence says so, and no smaller one is found."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from analysis.gap.evidence.caution import tail
from analysis.gap.evidence.likelihood import SLABS, SLIGHT, Evidence
from analysis.gap.judgement.detectable import LEAST, MOST, SURE, _least, detectable
from analysis.gap.terms.base import Cause, Term
from analysis.gap.terms.normal_equations import NormalEquations
from analysis.gap.terms.sensitivities import Sensitivities
from analysis.gap.terms.severity import severities


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


def strength(e: Evidence) -> dict[Cause, np.ndarray]:
    """Where all pixels weigh alike, what the evidence weighs is what severities are."""
    return {c: e.e.G[np.ix_(i, i)] / e.e.signal for c, i in e.members.items()}


def seen(e: Evidence, b: np.ndarray) -> Evidence:
    """The same terms where the captures say ``b`` = X' W r."""
    return Evidence(replace(e.e, b=b), e.terms)


def probability(e: Evidence, cause: str) -> float:
    h = e.best(((cause, ""),), {})
    larger = tail(e, e.spike, h, (cause, ""))
    return float(1 / (1 + larger / (1 - larger) + np.exp(e.at((), ()).score - h.score)))


@pytest.mark.parametrize("name", ["vignetting", "texture"])
def test_what_is_told_is_where_the_probability_is_reached(name: str) -> None:
    e = evidence()
    k = [t.cause for t in e.terms].index(name)
    told = next(d for d in detectable(e, e.spike, strength(e)) if d.cause[0] == name)
    for factor, sure in ((0.99, False), (1.01, True)):
        size = factor * told.easiest / e.share[k]
        assert bool(probability(seen(e, e.e.G[:, k] * size), name) > SURE) == sure


def test_what_is_not_in_the_image_is_not_told() -> None:
    assert {d.cause[0] for d in detectable(evidence(), np.full(3, 0.002), strength(evidence()))} == {
        "vignetting",
        "texture",
    }


def test_a_wider_tolerance_hides_more() -> None:
    e = evidence()
    wide = Evidence(e.e, [replace(t, spike=5 * t.spike) for t in e.terms])
    assert (
        detectable(wide, wide.spike, strength(wide))[0].easiest
        > 2 * detectable(e, e.spike, strength(e))[0].easiest
    )


def test_a_way_drawn_by_lot_is_harder_than_the_best_and_the_worst_target_the_hardest() -> None:
    """Two numbers of one effect, of which a wide tolerance hides one; and a second lamp, hidden altogether."""
    rng = np.random.default_rng(2)
    X = rng.standard_normal((3, 900)) / 0.05
    spikes = {("a", "p"): 0.002, ("a", "q"): 0.05, ("b", "p"): 0.05}
    terms = [Term("light_position", t, n, "1", s, lambda s: None) for (t, n), s in spikes.items()]
    e = NormalEquations(X @ X.T, np.zeros(3), 0.0, 900 / 0.05**2, np.full(3, 900 / 0.05**2), 0.0, 900)
    own = np.array(list(spikes.values()))
    whole, part = Evidence(e, terms), Evidence(e.of(np.array([0, 1])), terms[:2])
    (both,) = detectable(whole, own, strength(whole))
    (first,) = detectable(part, own[:2], strength(part))
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


def test_pixels_that_weigh_little_make_an_effect_no_weaker() -> None:
    """An effect of half of the pixels, which weigh a hundredth: its severity is told of all alike."""
    n, signal = 800, 100.0
    column = np.where(np.arange(n) < n // 2, 3.0, 0.0)
    one = Sensitivities(
        (np.ones(n, np.float32), column.astype(np.float32)),
        n,
        sparse.csr_array(np.eye(2, n, dtype=np.float32)),
        np.array([0, 2]),
        np.array([1, 3]),
        np.full((n, 1, 1), signal),
        None,
    )
    members = {("defocus", ""): np.array([2]), ("texture", ""): np.array([1, 3])}
    found = severities(members, [one, one])
    assert found["defocus", ""][0, 0] == pytest.approx(np.mean(column**2) / signal**2)
    assert found["texture", ""] == pytest.approx(np.eye(2) / n / signal**2)
    w = np.where(column > 0, 1e-2, 1.0)
    G = np.array([[np.sum(w * column**2)]])
    e = NormalEquations(G, np.zeros(1), 0.0, np.sum(w) * signal**2, np.zeros(1), 0.0, n)
    told = Evidence(e, [Term("defocus", "", "p", "px", 1e-3, lambda s: None)])
    (by_pixels,) = detectable(told, told.spike, found)
    (by_weights,) = detectable(told, told.spike, strength(told))
    assert by_pixels.easiest / by_weights.easiest == pytest.approx(np.sqrt(0.5 / (0.01 / 1.01)), rel=1e-3)


@pytest.mark.parametrize("hiding", [0, 1, 30])
def test_severities_are_where_whole_sums_reach_the_odds(hiding: int) -> None:
    """However many explanations add up: at what is told they do, and nowhere on a ladder of a hundred below it."""
    rng = np.random.default_rng(hiding)
    ways = rng.standard_normal((50, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]

    def forms(count: int, size: float) -> list[tuple[np.ndarray, float]]:
        halves = rng.standard_normal((count, 3, 3)) * np.sqrt(size)
        return [(A @ A.T, cost) for A, cost in zip(halves, rng.uniform(0, 9, count), strict=True)]

    effect, larger = forms(3, 3e4), forms(hiding, 1e4)

    def odds(s: np.ndarray) -> np.ndarray:
        signs = ((effect, []), (larger, [np.zeros(len(ways))]))
        sums = [
            np.logaddexp.reduce([*nothing, *(s**2 * np.sum(ways @ Q * ways, axis=1) - c for Q, c in by)])
            for by, nothing in signs
        ]
        return sums[0] - sums[1]

    found = _least(ways, effect, larger)
    there = np.isfinite(found)
    assert there.any()
    sure = np.log(SURE / (1 - SURE))
    assert (odds(np.where(there, found, MOST)) >= sure - 1e-6)[there].all()
    for share in np.geomspace(LEAST, 0.99, 100):
        assert (odds(np.where(there, share * found, share * MOST)) < sure).all()

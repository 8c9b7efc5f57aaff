"""The diagnosis's arithmetic against closed forms."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from analysis.gap.compared.regions import ZONES, zones
from analysis.gap.evidence.belief import believed, gained, posterior
from analysis.gap.evidence.hypotheses import best_first
from analysis.gap.evidence.likelihood import SLABS, Evidence
from analysis.gap.measures.ledger import bands, fixed_to
from analysis.gap.search.numbers import straightened
from analysis.gap.terms.base import Term
from analysis.gap.terms.normal_equations import Bends, NormalEquations
from analysis.gap.terms.subpixel import PRODUCT


def _terms(causes: list[str], spike: float, low: float = -np.inf) -> list[Term]:
    field: Callable[..., None] = lambda state: None  # noqa: E731
    return [Term(c, "", f"p{i}", "1", spike, field, low=low) for i, c in enumerate(causes)]


def _equations(X: np.ndarray, y: np.ndarray) -> NormalEquations:
    return NormalEquations(X.T @ X, X.T @ y, float(y @ y), float(len(y)), np.full(X.shape[1], float(len(y))))


def test_evidence_is_the_marginal_likelihood(rng: np.random.Generator) -> None:
    """Differences of log Z equal those of N(y; 0, 1 + X P⁻¹ X'), computed densely: the Woodbury form is exact."""
    X, y = rng.standard_normal((40, 5)), rng.standard_normal(40)
    terms = _terms(["a", "a", "b", "c", "d"], 0.01)
    terms[1] = replace(terms[1], part=0.4)
    evidence = Evidence(_equations(X, y), terms)

    def dense(wide: dict[int, float]) -> float:
        sd = np.full(5, 0.01)
        for i, s in wide.items():
            sd[i] = s
        return float(multivariate_normal(np.zeros(40), np.eye(40) + (X * sd**2) @ X.T).logpdf(y))

    none, slab = evidence.at((), ()), SLABS[1]
    share = evidence.e.share
    part = [0.4 if i == 1 else 1.0 for i in range(3)]
    wide = {i: max(part[i] * slab / share[i] / (np.hypot(1, 0.4) if i < 2 else 1), 0.02) for i in range(3)}
    both = evidence.at((("a", ""), ("b", "")), (slab, slab))
    expected = dense(wide) - dense({}) - 2 * np.log(len(SLABS) + 1)  # and the slight one
    expected += evidence.averaged(both.causes)  # over widths: tests/analysis/gap/test_gap_prior.py
    assert both.log_Z - none.log_Z == pytest.approx(expected, abs=1e-8)
    A = X.T @ X + np.diag([1 / wide.get(i, 0.01) ** 2 for i in range(5)])
    assert evidence.theta(both) == pytest.approx(np.linalg.solve(A, X.T @ y), abs=1e-10)
    assert evidence.sigma(both) == pytest.approx(np.sqrt(np.diag(np.linalg.inv(A))), rel=1e-8)


def test_other_spikes_are_an_evidence_of_their_own(rng: np.random.Generator) -> None:
    X, y, terms = rng.standard_normal((40, 4)), rng.standard_normal(40), _terms(["a", "a", "b", "c"], 0.01)
    evidence = Evidence(_equations(X, y), terms)
    spikes = evidence.spike * rng.uniform(1, 3, len(terms))
    first = [h.score for h in best_first(evidence)]
    there, anew = evidence.with_spikes(spikes), Evidence(evidence.e, terms, spikes=spikes)
    assert [h.score for h in best_first(there)] == [h.score for h in best_first(anew)]
    np.testing.assert_array_equal(there.C, anew.C)
    assert [h.score for h in best_first(evidence)] == first


def test_what_a_cause_bends_is_charged_to_hypotheses_without_it(rng: np.random.Generator) -> None:
    """They have it in their residual, as if the captures were so; those with the cause have not. Spikes that are known
    stay."""
    X, y, bend = rng.standard_normal((40, 3)), rng.standard_normal(40), rng.standard_normal(40)
    terms = _terms(["a", "b", "c"], 0.01)
    bends = Bends((X.T @ bend)[None], np.array([bend @ y]), np.array([[bend @ bend]]))
    there = Evidence(replace(_equations(X, y), bends=bends), terms, (("b", ""),), np.array([0.03, 0.01]))
    for captured, causes in ((y + bend, [(), (("a", ""),)]), (y, [(("b", ""),), (("b", ""), ("c", ""))])):
        plain = Evidence(_equations(X, captured), terms, spikes=np.array([0.03, 0.01]))
        assert plain.spike == pytest.approx([0.03, 0.01, 0.01])
        for h in causes:
            slabs = (0.03,) * len(h)
            one, other = there.at(h, slabs), plain.at(h, slabs)
            assert one.log_Z == pytest.approx(other.log_Z, abs=1e-9)
            assert there.theta(one) == pytest.approx(plain.theta(other), abs=1e-9)


def test_the_search_finds_two_causes_among_many(rng: np.random.Generator) -> None:
    X = rng.standard_normal((4000, 8))
    y = X @ [0, 0.2, 0, 0, 0.15, 0, 0, 0] + rng.standard_normal(4000)
    evidence = Evidence(_equations(X, y), _terms(list("abcdefgh"), 0.002))
    best = best_first(evidence)
    assert best[0].causes == (("b", ""), ("e", ""))
    p = posterior(best)
    assert p["b", ""] > 0.99
    assert p["e", ""] > 0.99
    assert max(v for k, v in p.items() if k[0] not in "be") < 0.2


def test_causes_that_undo_each_other_are_in_doubt_and_no_other(rng: np.random.Generator) -> None:
    """Columns a and b are alike, c stands apart. With a = 1 and b = -0.9, |Δ_a + Δ_b|² / |Δ_a|² = 0.01, of which p is
    twice as much; a b of -0.1 undoes a fifth of that, and puts nothing in doubt."""
    a, c = rng.standard_normal(4000), rng.standard_normal(4000)
    c -= a * (a @ c) / (a @ a)
    X = np.stack([a, a, c], axis=1)
    evidence = Evidence(_equations(X, X @ [1, -0.9, 0.3]), _terms(list("abc"), 0.002))
    causes = (("a", ""), ("b", ""), ("c", ""))
    sure = dict.fromkeys(causes, 1.0)
    p = believed(sure, causes, evidence, np.array([1.0, -0.9, 0.3]))
    assert list(p.values()) == pytest.approx([0.02, 0.02, 1.0])
    weak = believed(sure, causes, evidence, np.array([1.0, -0.1, 0.3]))
    assert list(weak.values()) == pytest.approx([1.0, 1.0, 1.0])
    alike = believed(sure, causes, evidence, np.array([1.0, 0.9, 0.3]))
    assert list(alike.values()) == pytest.approx([1.0, 1.0, 1.0])


def test_what_an_effects_formula_may_miss_is_no_unknown(rng: np.random.Generator) -> None:
    """Something without a name of a tenth of an effect is as probable as not to be its formula's; of the effect's own
    size it is itself, and alone it is what it is."""
    X = np.linalg.qr(rng.standard_normal((4000, 2)))[0] * np.sqrt(4000)
    named, unnamed = _terms(["a", "b"], 0.002)
    evidence = Evidence(_equations(X, X @ [1, 0.1]), [named, replace(unnamed, generic=True)])
    causes = (("a", ""), ("b", ""))
    sure = dict.fromkeys(causes, 1.0)
    for size, said in ((0.1, 0.5), (1.0, 1 / 1.01)):
        assert believed(sure, causes, evidence, np.array([1.0, size]))["b", ""] == pytest.approx(said)
    assert believed(sure, causes[1:], evidence, np.array([1.0, 0.1]))["b", ""] == 1


def test_what_gains_no_more_than_strong_effects_may_leave_is_in_doubt(rng: np.random.Generator) -> None:
    """An eightieth of a is 0.63 of χ²; c gains half of that in log Z, and is as probable as not; b 128 times that."""
    X = np.linalg.qr(rng.standard_normal((4000, 3)))[0] * np.sqrt(4000)
    evidence = Evidence(_equations(X, X @ [1, 0.1, 0.1]), _terms(list("abc"), 0.002))
    a, b, c = causes = (("a", ""), ("b", ""), ("c", ""))
    gains = {a: 2000.0, b: 40.0, c: 0.3125}
    p = believed(dict.fromkeys(causes, 1.0), causes, evidence, np.array([1.0, 0.1, 0.1]), gains)
    missed = 0.0125**2 * 4040
    assert p == pytest.approx(
        {a: 4000 / (4000 + 0.0125**2 * 80), b: 80 / (80 + missed), c: 0.625 / (0.625 + missed)}
    )
    assert p[c] == pytest.approx(0.5, abs=0.01)


def test_a_path_is_found_beside_a_blur_and_the_blur_is_in_no_doubt(rng: np.random.Generator) -> None:
    """A blur widens along and across: a path that is a third as wide as long is none, and has no log Z by itself, of
    whatever width, so that the blur gains without bound beside it."""
    along, across, product, apart = np.linalg.qr(rng.standard_normal((4000, 4)))[0].T * np.sqrt(4000)
    X = np.stack([along, across, product, along + across + 0.05 * apart], axis=1)
    terms = _terms(["motion_blur"] * 3 + ["defocus"], 0.002)
    terms = [replace(t, parameter=p) for t, p in zip(terms, ("u", "v", PRODUCT, "blur"), strict=True)]
    evidence = Evidence(_equations(X, X @ [0.1, 0.1, -0.1, 0.3]), terms)
    h = best_first(evidence)[0]
    assert h.causes == (("defocus", ""), ("motion_blur", ""))
    assert evidence.best((("motion_blur", ""),), {}).log_Z == -np.inf
    gains, theta = gained(evidence, h), evidence.theta(h)
    assert theta[2] == pytest.approx(-0.1, rel=0.1)  # the slab draws it towards none
    assert gains["defocus", ""] == np.inf
    p = believed(dict.fromkeys(h.causes, 1.0), h.causes, evidence, theta, gains)
    assert p["defocus", ""] == 1
    assert 0.9 < p["motion_blur", ""] <= 1


def test_numbers_of_a_path_are_a_straight_ones_and_a_blurs_are_what_is_left(rng: np.random.Generator) -> None:
    """A blur of 0.05 and a path of (0.3, -0.2) px whose squares are told from the blur by next to nothing: the mean
    halves what is alike in both, the straight path does not, and lies where the one that was drawn lies."""
    along, across, product, apart = np.linalg.qr(rng.standard_normal((100_000, 4)))[0].T * np.sqrt(100_000)
    X = np.stack([along, across, product, along + across + 0.003 * apart], axis=1)
    terms = _terms(["motion_blur"] * 3 + ["defocus"], 0.002)
    terms = [replace(t, parameter=p) for t, p in zip(terms, ("u", "v", PRODUCT, "blur"), strict=True)]
    drawn = np.array([0.09, 0.04, -0.06, 0.05])
    evidence = Evidence(_equations(X, X @ drawn), terms)
    h = evidence.best((("defocus", ""), ("motion_blur", "")), {})
    mean = evidence.theta(h)
    assert np.abs(mean - drawn).max() > 0.01
    found = straightened(evidence, h, mean)
    assert found == pytest.approx(drawn, abs=2e-3)  # slabs draw both towards none by 2 %
    assert found[0] * found[1] == pytest.approx(found[2] ** 2, rel=1e-9)
    assert straightened(evidence, evidence.best((("defocus", ""),), {}), mean) is mean


def test_noise_alone_has_no_cause() -> None:
    """Ten draws; one cause called in a hundred thousand hypotheses would be chance."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        X = rng.standard_normal((1000, 8))
        y = X @ (0.002 * rng.standard_normal(8)) + rng.standard_normal(1000)
        assert best_first(Evidence(_equations(X, y), _terms(list("abcdefgh"), 0.002)))[0].causes == ()


def test_a_term_below_what_it_may_be_does_not_count(rng: np.random.Generator) -> None:
    X = rng.standard_normal((1000, 2))
    y = X @ [-0.3, 0.0] + rng.standard_normal(1000)
    evidence = Evidence(_equations(X, y), _terms(["a", "b"], 0.002, low=0.0))
    assert evidence.at((("a", ""),), (SLABS[1],)).log_Z == -np.inf


def test_bands_are_orthonormal(rng: np.random.Generator) -> None:
    z = rng.standard_normal((45, 70, 3))
    energy = bands(z)
    assert sum(energy) == pytest.approx((z**2).sum(), rel=1e-12)  # Parseval
    assert bands(np.ones((64, 64, 1)))[:-1] == [0.0] * 5
    checker = np.indices((64, 64)).sum(0)[..., None] % 2 - 0.5
    assert bands(checker)[0] == pytest.approx((checker**2).sum())


def test_shares_of_families_add_up_to_what_they_explain_together(rng: np.random.Generator) -> None:
    X = rng.standard_normal((300, 6))
    X[:, 3] = X[:, 0] + 0.1 * X[:, 3]  # confusable
    y = X[:, 0] + 0.5 * X[:, 5] + rng.standard_normal(300)
    families = {"u": np.array([0, 1]), "v": np.array([2, 3]), "w": np.array([4, 5])}
    found = fixed_to(families, X.T @ X, X.T @ y, float(y @ y), np.full(6, 1e3))
    fitted = X @ np.linalg.lstsq(X, y, rcond=None)[0]
    assert sum(found.values()) == pytest.approx(fitted @ fitted / (y @ y), rel=1e-6)
    assert found["u"] == pytest.approx(found["v"], rel=0.05)  # they can stand for each other


@pytest.mark.parametrize("shape", [(9, 9), (37, 50), (3, 4)])
def test_every_pixel_lies_in_one_zone(shape: tuple[int, int]) -> None:
    found = zones(shape)
    assert set(found) == set(ZONES)
    assert (sum(m.astype(int) for m in found.values()) == 1).all()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def test_what_the_first_stand_does_not_show_stays_nothing(rng: np.random.Generator) -> None:
    """A place that no capture showed, of which a stand further on shows next to nothing, has no width of its own."""
    X = rng.standard_normal((200, 2))
    terms = [replace(t, relative=True, spike=5e-4) for t in _terms(["a", "b"], 0.01)]
    nothing = X * [1.0, 0.0]
    first = Evidence(_equations(nothing, nothing @ [0.1, 0.0]), terms)
    there = X * [1.0, 1e-13]
    later = Evidence(_equations(there, X @ [0.1, 0.5]), terms, spikes=first.spike)
    assert abs(later.theta(later.at((), ()))[1]) < 1e-3

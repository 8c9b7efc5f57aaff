"""What makes a cause less probable than its log Z: tails of tolerances, and conditions that differ."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit, logsumexp
from scipy.stats import norm, t

from analysis.gap.evidence.caution import (
    TAILS,
    Caution,
    LeftOut,
    agreement,
    cautions,
    left_over,
    log_prior_of_kappa,
    spread,
    tail,
    without_each,
)
from analysis.gap.evidence.hypotheses import best_first
from analysis.gap.evidence.likelihood import Evidence, Hypothesis
from analysis.gap.judgement.calling import beside_left_over
from analysis.gap.judgement.findings import cautious, what_is_unknown
from analysis.gap.noise.finding import NoiseFinding
from analysis.gap.search.fit import Fit
from analysis.gap.search.model import Model
from analysis.gap.terms.base import NUISANCE, Family, Term
from analysis.gap.terms.normal_equations import NormalEquations, total_of

SPIKE, PIXELS, NOISE = 0.005, 2000, 0.05
A, LAMP = ("a", ""), ("light_spectrum", "/World/Left")


def _term(cause: str, **more: object) -> Term:
    return replace(Term(cause, "", "p", "1", SPIKE, lambda s: None), **more)


def _part(X: np.ndarray, r: np.ndarray) -> NormalEquations:
    signal = PIXELS / NOISE**2
    own = np.where((X != 0).any(axis=1), signal, 0.0)
    return NormalEquations(X @ X.T, X @ r, float(r @ r), signal, own, 0.0, PIXELS)


def _conditions(amounts: list[float]) -> list[NormalEquations]:
    """Two columns of noise; each condition has its own amount of the first."""
    rng = np.random.default_rng(3)
    out = []
    for amount in amounts:
        X = rng.standard_normal((2, PIXELS)) / NOISE
        out.append(_part(X, amount * X[0] + rng.standard_normal(PIXELS)))
    return out


def _found(parts: list[NormalEquations]) -> tuple[Evidence, Hypothesis]:
    evidence = Evidence(total_of(parts), [_term("a"), _term("b")])
    return evidence, evidence.best((A,), {})


def test_errors_have_the_tails_of_students_t() -> None:
    """Far out a mixture of normal distributions over κ is Student's; near by most of it is κ below 1.26, which the grid
    leaves to the width that is declared."""
    kappa, log_share = log_prior_of_kappa()
    for x in (6.0, 8.0, 10.0):
        mixed = float((np.exp(log_share) * norm.pdf(x, scale=kappa)).sum())
        assert mixed == pytest.approx(t.pdf(x, TAILS), rel=0.02)  # a grid of steps of 26 %
    assert np.exp(log_share).sum() < 1


def test_an_effect_is_held_against_a_tolerance_that_is_larger() -> None:
    """The share of the tolerances in all that explains one number that is seen nearly without noise: a normal
    distribution in closed form each."""
    parts = _conditions([8 * SPIKE])
    evidence, h = _found(parts)
    index = evidence.members[A]
    e, sigma = evidence.e, 1 / np.sqrt(evidence.e.G[0, 0])
    seen = e.b[0] / e.G[0, 0]

    def score(width: float) -> float:
        return float(norm.logpdf(seen, scale=np.hypot(width, sigma)))

    kappa, log_share = log_prior_of_kappa()
    none = [score(k * SPIKE) + s for k, s in zip(kappa, log_share, strict=True)]
    slabs = [score(s / evidence.together[index[0]]) for s in evidence.slabs[A]]
    there = logsumexp(slabs) - np.log(len(slabs)) + evidence.prior((A,))
    against = logsumexp(none) + evidence.prior(()) - there
    assert tail(evidence, evidence.spike, h, A) == pytest.approx(expit(against), abs=1e-3)


def test_what_no_tolerance_speaks_of_has_no_tails() -> None:
    """A beam that is off by a few of the shares that are taken for it is a beam that is off."""
    parts = _conditions([3 * SPIKE])
    terms = [_term("a", relative=True), _term("b")]
    evidence = Evidence(total_of(parts), terms)
    h = evidence.best((A,), {})
    assert tail(evidence, evidence.spike, h, A) == 0
    declared, again = _found(parts)
    assert tail(declared, declared.spike, again, A) > 0.01


def test_the_further_off_the_less_it_is_a_tolerance() -> None:
    found = []
    for times in (3, 4, 8, 16, 60):
        evidence, h = _found(_conditions([times * SPIKE]))
        found.append(tail(evidence, evidence.spike, h, A))
    assert found == sorted(found, reverse=True)
    assert found[0] > 0.25  # three tolerances: it may well be
    assert 0.1 < found[1] < 0.2  # four: one in seven
    assert found[-1] < 1e-3


def test_what_is_far_beyond_every_slab_is_no_tolerance_either() -> None:
    """Three quarters of the signal, 136 tolerances, as a pin that is a third larger: the widest slab is a tenth."""
    tight = [_term("a", parameter=p, spike=0.75 / 136) for p in ("scale", "height")]
    evidence = Evidence(total_of(_conditions([0.75])), tight)
    assert tail(evidence, evidence.spike, evidence.best((A,), {}), A) < 1e-6


def test_what_has_no_name_is_no_tolerance() -> None:
    parts = _conditions([4 * SPIKE])
    evidence = Evidence(total_of(parts), [_term("a", generic=True), _term("b")])
    assert tail(evidence, evidence.spike, evidence.best((A,), {}), A) == 0


def test_a_tolerance_that_looks_larger_already_is_not_taken_twice() -> None:
    parts = _conditions([8 * SPIKE])
    declared, _ = _found(parts)
    wide = Evidence(declared.e, declared.terms, spikes=np.array([20 * SPIKE, SPIKE]))  # beyond all κ
    again = wide.best((A,), {})
    assert tail(wide, declared.spike, again, A) == 0
    narrower = Evidence(declared.e, declared.terms, spikes=np.array([3 * SPIKE, SPIKE]))
    once = tail(declared, declared.spike, declared.best((A,), {}), A)
    assert 0 < tail(narrower, declared.spike, narrower.best((A,), {}), A) < once


def test_how_much_conditions_differ_is_the_jackknifes() -> None:
    """Of a mean of conditions that tell alike, one standard deviation is that of their mean; all tell nearly alike
    here."""
    amounts = [0.02, 0.03, 0.05, 0.02, 0.04, 0.03]
    parts = _conditions(amounts)
    evidence, h = _found(parts)
    s, _, n = spread(evidence, h, A, parts, without_each(evidence, h, parts))
    assert n == 6
    assert s == pytest.approx(np.std(amounts, ddof=1) / np.sqrt(6) / np.mean(amounts), rel=0.1)


def test_how_much_they_differ_by_chance_is_what_noise_makes_them_differ() -> None:
    """σ / √6 of conditions that have noise alone, in closed form and over draws; what is seen has the same χ²."""
    rng = np.random.default_rng(8)
    X = rng.standard_normal((2, PIXELS)) / NOISE
    theta, sigma = 0.02, NOISE / np.sqrt(PIXELS)
    squares, told = [], []
    for _ in range(200):
        parts = [_part(X, theta * X[0] + rng.standard_normal(PIXELS)) for _ in range(6)]
        evidence, h = _found(parts)
        s, by_chance, _ = spread(evidence, h, A, parts, without_each(evidence, h, parts))
        squares.append(s**2)
        told.append(by_chance)
    assert np.mean(told) == pytest.approx(sigma / np.sqrt(6) / theta, rel=0.05)
    assert np.mean(squares) == pytest.approx(np.mean(np.square(told)), rel=0.15)  # 1000 squares: 4 %


def test_a_tolerance_that_conditions_share_makes_none_of_them_differ() -> None:
    """Two columns alike, one of them within its tolerance: what is taken from the effect is taken in all conditions."""
    rng = np.random.default_rng(9)
    X = rng.standard_normal((2, PIXELS)) / NOISE
    X[1] = X[0] + 0.01 * X[1]
    parts = [_part(X, 0.05 * X[0] + rng.standard_normal(PIXELS)) for _ in range(6)]
    evidence, h = _found(parts)
    _, by_chance, _ = spread(evidence, h, A, parts, without_each(evidence, h, parts))
    own = evidence.sigma(h)[0] / evidence.theta(h)[0]
    assert by_chance < own / 3


def test_what_one_condition_alone_has_is_not_called() -> None:
    """Both are far beyond noise and tolerances."""
    for amounts, called in (([0.3] * 6, True), ([1.8, 0, 0, 0, 0, 0], False)):
        parts = _conditions(amounts)
        evidence, h = _found(parts)
        assert h.score - evidence.at((), ()).score > 100
        without = without_each(evidence, h, parts)
        caution = cautions(evidence, evidence.spike, h, evidence, parts, without)[A]
        assert (caution.of(1.0) > 0.99) == called
        assert (caution.of(1.0) < 0.5) == (not called)
        assert caution.tail < 1e-6


def test_few_conditions_and_places_do_not_tell() -> None:
    parts = _conditions([0.3, 0.1])
    evidence, h = _found(parts)
    assert without_each(evidence, h, parts).theta.shape == (0, 2)
    caution = cautions(evidence, evidence.spike, h, evidence, parts, LeftOut(np.zeros((0, 2))))[A]
    assert np.isnan(caution.spread)
    assert caution.most == 1
    parts = _conditions([0.3, 0.1, 0.2])
    cells = Evidence(total_of(parts), [_term("a", family=Family(lambda s: None, ("here",))), _term("b")])
    s, _, _ = spread(cells, h, A, parts, without_each(cells, h, parts))
    assert np.isnan(s)


def _fit(probability: float, tail: float, most: float, something: float = 1.0, amount: float = 0.1) -> Fit:
    """A fit of which only one cause and what speaks against it are known; log Z is sure that there is something."""
    h = [Hypothesis((LAMP,), (0.01,), 30.0, 0.0), Hypothesis((), (), 0.0, 0.0)]
    no, theta = np.zeros(0), np.array([0.1, 0.0])
    terms = [_term(LAMP[0], target=LAMP[1]), _term("b")]
    model = Model(tuple(terms), theta, np.zeros(2))
    evidence = Evidence(total_of(_conditions([amount])), terms)
    careful = {LAMP: Caution(tail, 0.31, most, something)}
    return Fit(
        model, model, tuple(h), {LAMP: probability}, (), evidence, evidence, (), no, no, no[None][:0], careful,
        lambda h: model,
    )  # fmt: skip


def test_a_larger_tolerance_is_no_effect_and_nothing_unknown() -> None:
    fitted = _fit(0.1, tail=0.9, most=1.0)
    assert fitted.probability_of_none == pytest.approx(0.9)
    assert what_is_unknown(fitted) == ()
    assert cautious(fitted) == [
        "Light spectrum of Left looks off by more than the calibration's tolerances, but by no more than calibrations "
        "are off now and then (90 % probable): it is not called."
    ]


def test_what_tolerances_explain_though_not_surely_is_nothing_unknown() -> None:
    """More probable than not that there is something, of which the most is a larger tolerance."""
    other = ("b", "")
    h = [Hypothesis((LAMP, other), (0.01, 0.01), 30.0, 0.0), Hypothesis((), (), 0.0, 0.0)]
    fitted = _fit(0.4, tail=0.6, most=1.0)
    both = replace(
        fitted,
        hypotheses=tuple(h),
        probability={LAMP: 0.4, other: 0.4},
        cautions={c: fitted.cautions[LAMP] for c in (LAMP, other)},
    )
    assert both.probability_of_none < 0.5
    assert what_is_unknown(both) == ()
    less = replace(both, cautions={**both.cautions, other: Caution(0.3, 0.31, 1.0)})
    assert "nearest" in what_is_unknown(less)[0][0]


def test_what_conditions_do_not_agree_on_is_unknown() -> None:
    fitted = _fit(0.1, tail=0.0, most=0.1)
    assert fitted.probability_of_none < 1e-9
    ((words, p),) = what_is_unknown(fitted)
    assert "nearest: light spectrum" in words
    assert p > 0.99
    assert cautious(fitted) == [
        "The captures together speak for light spectrum of Left, but how much of it there is changes by 31 % as one or "
        "another is left out: it is not called."
    ]


@pytest.mark.parametrize(("gain", "told"), [(2.5, False), (4.0, True)])
def test_what_is_slight_and_conditions_do_not_agree_on_is_nothing(gain: float, told: bool) -> None:
    """2.5 nats are odds of 12 that it is not nothing."""
    fitted = _fit(0.1, tail=0.0, most=0.1)
    h = [replace(fitted.hypotheses[0], log_Z=gain), fitted.hypotheses[1]]
    slight = replace(fitted, hypotheses=tuple(h))
    assert slight.probability_of_none < 0.1
    assert bool(what_is_unknown(slight)) == told


def test_structure_of_what_is_left_is_unknown_where_nothing_nearer_is_told() -> None:
    calibrated = _fit(0.1, tail=0.9, most=1.0)  # nothing else is unknown
    assert what_is_unknown(calibrated, "in detail of 4 to 8 px", (3.0, 0.1)) == ()
    ((words, p),) = what_is_unknown(calibrated, "in detail of 4 to 8 px", (8.0, 0.9))
    assert "share 8 times as much as a twin that is 0.2 % off leaves, in detail of 4 to 8 px" in words
    assert p == 0.9
    ((words, _),) = what_is_unknown(_fit(0.1, tail=0.0, most=0.1), "anywhere", (8.0, 0.9))
    assert "nearest: light spectrum" in words


@pytest.mark.parametrize(("amount", "told"), [(0.002, False), (0.1, True)])
def test_what_conditions_do_not_agree_on_is_unknown_where_something_is_left(
    amount: float, told: bool
) -> None:
    """0.002 of a column that is 20 times the noise is not seen, 0.1 leaves five times the noise's square."""
    found = what_is_unknown(_fit(0.1, tail=0.0, most=0.1, something=0.3, amount=amount))
    assert bool(found) == told


def test_that_there_is_something_is_no_surer_than_conditions_make_it() -> None:
    parts = _conditions([0.3, -0.2, 0.4, 0.1, -0.3, 0.2])
    evidence, h = _found(parts)
    caution = cautions(evidence, evidence.spike, h, evidence, parts, without_each(evidence, h, parts))[A]
    odds = np.exp(agreement(caution.spread, 6, caution.chance))
    assert caution.something == pytest.approx(odds / (1 + odds))
    assert caution.most < caution.something < 0.1


def test_what_is_called_needs_no_caution() -> None:
    assert cautious(_fit(0.9, tail=0.05, most=0.95)) == []


@pytest.mark.parametrize(("sigma", "told"), [(1.0, False), (1.02, False), (1.08, True), (1.2, True)])
def test_what_is_left_has_a_cause_where_it_is_more_than_expected(sigma: float, told: bool) -> None:
    """Noise σ times as large as expected leaves σ², to sqrt(2 / 40000) = 0.7 %, where 4 % are not known."""
    rng = np.random.default_rng(4)
    parts = []
    for _ in range(20):
        X = rng.standard_normal((2, PIXELS)) / NOISE
        parts.append(_part(X, sigma * rng.standard_normal(PIXELS)))
    evidence = Evidence(total_of(parts), [_term("a"), _term("b")])
    more, p = left_over(evidence, evidence.at((), ()))
    assert more == pytest.approx(sigma**2 - 1, abs=0.03)
    assert (p > 0.9) == told
    assert (p < 0.1) == (not told)


def test_what_the_formula_of_a_strong_cause_leaves_is_not_told() -> None:
    """The second column is a thirtieth of the cause's energy and no part of its formula: 60 % more than noise."""
    parts = []
    rng = np.random.default_rng(6)
    for _ in range(20):
        X = rng.standard_normal((2, PIXELS)) / NOISE
        parts.append(_part(X[:1], 0.2 * X[0] + 0.0365 * X[1] + rng.standard_normal(PIXELS)))
    evidence = Evidence(total_of(parts), [_term("a")])
    h = evidence.best((A,), {})
    assert left_over(evidence, h) == (pytest.approx(0.53, abs=0.03), 0.0)
    assert left_over(evidence, evidence.at((), ()))[1] > 0.99  # without the cause


def _noise(probability: float) -> NoiseFinding:
    return NoiseFinding("sensor_noise", probability, {})


def test_beside_what_is_left_a_cause_is_less_probable_unless_it_is_noise() -> None:
    fitted = replace(_fit(0.9, tail=0.0, most=1.0), left_over=(0.3, 0.98))
    (words, p), *_ = what_is_unknown(replace(fitted, probability={LAMP: 0.9}))
    assert words.startswith("30 % more χ² is left")
    assert p == 0.98
    assert beside_left_over(fitted, [_noise(0.99)]).left_over == (0.3, 0.0)
    e = fitted.evidence.e
    own, left = 0.1**2 * e.G[0, 0], 0.98 * 0.3 * e.count
    found = beside_left_over(fitted, [_noise(0.2)])
    assert found.probability[LAMP] == pytest.approx(0.9 * own / (own + left))


def test_the_lesser_of_both() -> None:
    assert Caution(0.2, 0.1, 1.0).of(0.9) == pytest.approx(0.72)
    assert Caution(0.2, 1.0, 0.3).of(0.9) == pytest.approx(0.3)


def test_the_only_lit_condition_may_be_left_out() -> None:
    """Dark ones have no signal that a width could be a share of: a level that all show stays an effect, and is not
    shared with what calibration leaves of it."""
    rng = np.random.default_rng(3)
    level = np.ones((2, PIXELS)) / NOISE
    parts = [_part(level, 0.2 * level[0] + rng.standard_normal(PIXELS)) for _ in range(5)]
    parts[1:] = [replace(p, signal=0.0) for p in parts[1:]]
    evidence = Evidence(total_of(parts), [_term("a"), _term(NUISANCE)])
    h = evidence.best((A,), {})
    theta = without_each(evidence, h, parts).theta[:, 0]
    assert theta == pytest.approx(
        [evidence.theta(h)[0]] * 5, rel=0.02
    )  # noise of four conditions is 0.3 % of it


def test_a_term_that_shows_nothing_but_rounding_ends_no_search() -> None:
    """A width of 1 % of the signal is more than 1e8 of such a term's own: 1 less the square of that is 1 in float64."""
    rng = np.random.default_rng(5)
    X = np.array([np.ones(PIXELS), 1e-12 * rng.standard_normal(PIXELS)]) / NOISE
    evidence = Evidence(
        _part(X, 0.2 * X[0] + rng.standard_normal(PIXELS)),
        [_term("a"), _term("b", relative=True, spike=1e-12)],
    )
    assert best_first(evidence)[0].causes == (A,)

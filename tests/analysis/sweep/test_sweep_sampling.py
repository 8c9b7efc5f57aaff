import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import norm

from analysis.sweep.laws import Choice, LogUniform, Normal, Uniform
from analysis.sweep.sampling import Axis, Method, points, weights

LAWS = [Uniform(-2, 5), LogUniform(1e-3, 20), Normal(0.5, 2, -1, 7), Normal(9, 1, 0, 5)]


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_the_density_is_the_derivative_of_the_inverse_of_the_quantile(law):
    u = np.linspace(0.01, 0.99, 99)
    x = law.quantile(u)
    step = 1e-6
    slope = (law.quantile(u + step) - law.quantile(u - step)) / (2 * step)
    np.testing.assert_allclose(law.density(x) * slope, 1, rtol=1e-4)  # p(x) dx/du = 1


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_a_density_holds_one_within_its_range_and_nothing_beside(law):
    total = sum(quad(law.density, a, b)[0] for a, b in itertools.pairwise(np.linspace(law.low, law.high, 40)))
    assert total == pytest.approx(1, abs=1e-6)
    assert law.density(np.array([law.low - 1e-3, law.high + 1e-3])) == pytest.approx([0, 0])


@given(st.lists(st.floats(0, 1), min_size=1, max_size=6).filter(lambda s: sum(s) > 0.1))
@settings(max_examples=60, deadline=None)
def test_a_choice_comes_up_by_its_shares(given_shares):
    shares = tuple(s / sum(given_shares) for s in given_shares)
    law = Choice(tuple(float(k) for k in range(len(shares))), shares)
    found = law.quantile((np.arange(4000) + 0.5) / 4000)
    got = [np.mean(found == k) for k in range(len(shares))]
    np.testing.assert_allclose(got, shares, atol=2 / 4000)  # an even grid misses each border by one point
    np.testing.assert_allclose(law.density(found), np.array(shares)[found.astype(int)])


def test_a_latin_hypercube_has_one_point_in_every_share_of_every_axis():
    axes = [Axis("a", Uniform(0, 1)), Axis("b", LogUniform(1, 100)), Axis("c", Normal(0, 1, -3, 3))]
    rows = np.array(list(points(axes, Method.LATIN_HYPERCUBE, 40, 3)))
    lows = np.arange(41) / 40
    for axis, x in zip(axes, rows.T, strict=True):
        counts, _ = np.histogram(x, axis.law.quantile(lows))
        assert (counts == 1).all()


def test_sobol_points_fill_every_dyadic_box_once():
    axes = [Axis("a", Uniform(0, 1)), Axis("b", Uniform(0, 1))]
    rows = np.array(list(itertools.islice(points(axes, Method.SOBOL, 64, 5), 64)))
    for i in range(7):  # a (0, 6, 2)-net in base 2 (Niederreiter 1987)
        counts, _, _ = np.histogram2d(*rows.T, bins=[2**i, 2 ** (6 - i)], range=[[0, 1], [0, 1]])
        assert (counts == 1).all()


def test_a_grid_has_every_combination_and_a_list_its_rows():
    axes = [Axis("a", Uniform(0, 1), steps=3), Axis("b", Choice((5.0, 7.0), (0.5, 0.5)))]
    rows = [tuple(r) for r in points(axes, Method.GRID, 0, 0)]
    assert rows == [(a, b) for a in (0, 0.5, 1) for b in (5, 7)]
    lists = [Axis("a", Choice((1.0, 2, 3), (1 / 3,) * 3)), Axis("b", Choice((4.0, 4, 9), (1 / 3,) * 3))]
    assert [tuple(r) for r in points(lists, Method.LIST, 0, 0)] == [(1, 4), (2, 4), (3, 9)]


def test_weighted_means_of_what_was_sampled_are_means_of_nature():
    axes = [
        Axis("a", Uniform(-3, 3), nature=Normal(0, 0.5, -3, 3)),
        Axis("b", Choice((0.0, 1.0), (0.5, 0.5)), nature=Choice((0.0, 1.0), (0.99, 0.01))),
    ]
    rows = np.array(list(itertools.islice(points(axes, Method.SOBOL, 0, 1), 2**14)))
    w = weights(axes, rows)
    assert w.mean() == pytest.approx(1, abs=1e-3)  # quasi-random: far below 1 / sqrt(N) = 8e-3
    assert np.mean(w * rows[:, 0] ** 2) == pytest.approx(0.25, abs=1e-3)  # σ² of the normal law
    assert np.mean(w * rows[:, 1]) == pytest.approx(0.01, abs=1e-4)
    assert rows[:, 1].mean() == pytest.approx(0.5, abs=1e-3)  # and rare ones come up often
    assert norm.cdf(3, 0, 0.5) == pytest.approx(1, abs=1e-8)  # the range cuts nothing off that counts


@pytest.mark.parametrize("method", [Method.SOBOL, Method.RANDOM, Method.LATIN_HYPERCUBE])
def test_a_seed_gives_the_same_points_again_and_another_seed_others(method):
    axes = [Axis("a", Uniform(0, 1))]
    first, again, other = (list(itertools.islice(points(axes, method, 8, seed), 8)) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first, other)

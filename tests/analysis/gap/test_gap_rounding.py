"""Sums in float32, and steps at the end of what a parameter may be: rounding makes no diagnosis fail."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.gap.diagnose import is_noise_of
from analysis.gap.evidence.widened import inverse
from analysis.gap.terms.normal_equations import gram
from analysis.gap.terms.stepped import _rounded
from interchange.effects.light_size import LightSize


def test_products_are_summed_more_exactly_than_in_float32() -> None:
    X = np.random.default_rng(0).standard_normal((50, 15000)).astype(np.float32) + 5
    exact = X.astype(np.float64) @ X.T.astype(np.float64)
    assert np.abs(gram(X) - exact).max() < 2e-7 * exact.max()
    assert gram(X[:, :0]) == pytest.approx(0)


def test_what_rounding_takes_off_small_eigenvalues_is_put_back() -> None:
    """I and one direction that is known 1e6 times better; rounding leaves another -1.2 of what it had."""
    rng = np.random.default_rng(1)
    Q = np.linalg.qr(rng.standard_normal((6, 6)))[0]
    values = np.array([1e6, 30.0, 1.0, 1.0, 1.0, -0.2])
    found, half_log_det = inverse(Q * values @ Q.T)
    right = np.maximum(values, 1.0)
    assert found == pytest.approx(Q / right @ Q.T, abs=1e-9)
    assert half_log_det == pytest.approx(0.5 * np.log(right).sum())
    with pytest.raises(np.linalg.LinAlgError):
        inverse(Q * np.array([1e6, 1, 1, 1, 1, -100.0]) @ Q.T)


def test_whole_steps_end_where_a_parameter_does() -> None:
    step = {"spread": 7.0}
    assert _rounded(LightSize(spread=99999.0), step).spread == pytest.approx(99995.0)  # the next is 100002
    assert _rounded(LightSize(spread=-99999.0), step).spread == pytest.approx(-99995.0)
    assert _rounded(LightSize(spread=20.0), step).spread == pytest.approx(21.0)


@pytest.mark.parametrize(
    ("before", "after", "it_is"), [(0.5, 0.01, True), (-0.4, 0.02, True), (-0.03, 2.2, False)]
)
def test_a_noise_that_captures_do_not_leave_is_none(before: float, after: float, it_is: bool) -> None:
    fits: list[Any] = [SimpleNamespace(left_over=(x, 0.0)) for x in (after, before)]
    assert is_noise_of(*fits) == it_is

"""A fall-off falls: what rises again is none."""

import numpy as np
import pytest

from analysis.gap.terms.base import Term
from analysis.gap.terms.fall_off import RISES, fall_offs, falls, without_rises


@pytest.mark.parametrize(
    ("a2", "a4", "is_one"),
    [
        (-0.281, 0.079, True),  # the bench sample's
        (-0.3, 0.0, True),
        (0.0, -0.1, True),
        (0.03, -0.114, True),  # an aperture's, flat and then steep: rises by 0.02 of it
        (-0.2, 0.1, True),  # level at the corner
        (-0.016, 0.017, False),  # a ring: as bright in the corner as in the middle
        (0.05, 0.0, False),
        (0.0, 0.0, True),
    ],
)
def test_a_fall_off_falls(a2: float, a4: float, is_one: bool) -> None:
    assert falls(np.array([a2, a4]), np.zeros((2, 2))) is is_one


def test_a_rise_is_told_by_the_curve_itself() -> None:
    """Against a fine look-up of 1 + a2 u + a4 u²."""
    u = np.linspace(0, 1, 2001)
    for a2, a4 in np.random.default_rng(1).uniform(-0.3, 0.3, (200, 2)):
        change = np.diff(a2 * u + a4 * u * u)
        rise, fall = change[change > 0].sum(), -change[change < 0].sum()
        if abs(rise - RISES * fall) > 1e-5:
            assert falls(np.array([a2, a4]), np.zeros((2, 2))) == (rise < RISES * fall)


def test_a_rise_that_noise_may_have_is_none() -> None:
    numbers = np.array([-0.01, 0.012])
    assert not falls(numbers, 1e-8 * np.eye(2))
    assert falls(numbers, 1e-2 * np.eye(2))


def test_what_rises_is_not_probable() -> None:
    def term(cause: str, parameter: str, target: str = "") -> Term:
        return Term(cause, target, parameter, "1", 0.01, lambda s: None)

    terms = [
        term("vignetting", "a2"), term("vignetting", "a4"), term("exposure", "scale"),
        term("vignetting", "a2", "Camera1"), term("vignetting", "a4", "Camera1"),
    ]  # fmt: skip
    assert set(fall_offs(terms)) == {("vignetting", ""), ("vignetting", "Camera1")}
    before = {("vignetting", ""): 0.9, ("exposure", ""): 0.8, ("vignetting", "Camera1"): 0.7}
    theta = np.array([-0.02, 0.02, 0.1, -0.2, 0.05])
    said = without_rises(before, terms, theta, lambda index: np.zeros((len(index), len(index))))
    assert said == {**before, ("vignetting", ""): 0.0}

"""Of a defocus that may be a pixel's aperture."""

import numpy as np
import pytest

from analysis.gap.terms.aperture import P0, V0, kept, may_be_one, without_apertures
from analysis.gap.terms.base import Term


def test_small_blurs_are_in_doubt_and_large_ones_are_not() -> None:
    """A Gaussian pixel of 0.45 px in place of a square adds 0.45² - 1/12 = 0.119 px²; a disc of 1.2 px has 0.36 px²."""
    assert kept(0.45**2 - 1 / 12) == pytest.approx(1 - P0)
    assert kept(1.2**2 / 4) > 0.98
    assert kept(2 * V0) == pytest.approx(1 / (1 + P0 / (1 - P0) * np.exp(0.5 - 2)))


def test_nothing_else_is_in_doubt() -> None:
    blur = Term("defocus", "", "blur", "px", 1e-3, lambda s: None, power=2)
    other = Term("motion_blur", "", "u", "px", 1e-3, lambda s: None, power=2)
    sure = {("defocus", ""): 1.0, ("motion_blur", ""): 1.0}
    p = without_apertures(sure, (blur, other), np.array([0.1, 0.1]))
    assert p == {("defocus", ""): pytest.approx(1 - P0), ("motion_blur", ""): 1.0}
    assert without_apertures(sure, (blur, other), np.array([0.0, 0.1])) == sure


def test_it_is_told_of_a_small_defocus_alone() -> None:
    assert may_be_one([("defocus", "")], 0.1)
    assert not may_be_one([("defocus", "")], 0.4)
    assert not may_be_one([("defocus", "")], 0.0)
    assert not may_be_one([("motion_blur", "")], 0.1)

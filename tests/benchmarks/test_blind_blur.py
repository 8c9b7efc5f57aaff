"""The blind captures' blurs are as wide as they say, by their second moments."""

import numpy as np
import pytest

from benchmarks.blind import chain
from benchmarks.blind.chain import Cause


def test_two_gaussians_have_the_rms_that_they_say():
    point = np.zeros((81, 81, 3), np.float32)
    point[40, 40] = 1.0
    blurred = chain.fine([Cause("defocus", "two Gaussians", 1.0, {"share": 0.2})], point, 3)[..., 0]
    r = np.arange(81) - 40.0
    assert float((blurred.sum(axis=1) * r**2).sum()) == pytest.approx(9.0, rel=0.05)  # cut off at four sigma


@pytest.mark.parametrize("length", [0.05, 0.2, 0.66, 1.64])
def test_a_smear_is_as_wide_as_its_path_and_no_wider(length: float):
    """At constant speed L² / 12 along, of 25 points that reach the ends 26 / 24 of it; across, a bend of 0.15 L has
    (0.15 L)² / 180."""
    point = np.zeros((41, 41, 3), np.float32)
    point[20, 20] = 1.0
    smeared = chain.fine([Cause("motion_blur", "smear", length, {"angle": 0.0, "speed": 0.0})], point, 3)[
        ..., 0
    ]
    r = (np.arange(41) - 20.0) / 3
    along, across = smeared.sum(axis=0), smeared.sum(axis=1)
    variance = [float((k * r**2).sum() - (k * r).sum() ** 2) for k in (along, across)]
    assert variance[0] == pytest.approx(length**2 / 12 * 26 / 24, rel=0.01)
    assert variance[1] == pytest.approx((0.15 * length) ** 2 / 180, abs=5e-4 * length**2)

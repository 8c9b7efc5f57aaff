"""What is left and has structure, against what was put in."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.measures.structure import AT, STEPS, Structure, structure, twin_off
from analysis.gap.noise.fixed_pattern import flat
from analysis.gap.terms.normal_equations import SIGNAL
from interchange.captures import Tolerances
from tests.analysis.gap.bench import Rig, of_their_own

Shown = tuple[list[Condition], list[np.ndarray], list[np.ndarray]]


@pytest.fixture(scope="module")
def shown(rig: Rig) -> Shown:
    return of_their_own(rig, 5)


def told(whole: list[Condition], expected: list[np.ndarray]) -> Structure:
    found = structure(whole, expected)
    assert found is not None
    return found


def _values(shown: Shown) -> int:
    return sum(int((flat(c, dn)[1] > 0).sum()) for c, dn in zip(*shown[:2], strict=True))


def test_noise_has_none(shown: Shown) -> None:
    left = told(*shown[:2])
    n = _values(shown)
    assert abs(left.white) < 5 * np.sqrt(2 / n)  # of n squares of unit normals
    assert max(abs(x) for x in left.near) < 5 / np.sqrt(
        n
    )  # each pair of values once along either axis: n of them or more


def test_white_noise_of_another_kind_is_white(shown: Shown) -> None:
    """Of 0.2 of the sensor's variance, alike in all channels, as a path tracer's."""
    whole, expected, sigmas = shown
    rng = np.random.default_rng(6)
    more = [
        replace(c, mean=c.mean + np.sqrt(0.2) * s * rng.standard_normal((*s.shape[:2], 1)))
        for c, s in zip(whole, sigmas, strict=True)
    ]
    left, n = told(more, expected), _values(shown)
    assert left.white == pytest.approx(
        0.2, abs=5 * 1.2 * np.sqrt(2 * 1.7 / n)
    )  # channels are not independent
    assert max(abs(x) for x in left.near) < 5 * 1.2 * np.sqrt(1.7 / n)


def test_a_wave_is_told_by_what_pixels_share_of_it(shown: Shown) -> None:
    """sin over 40 columns, 0.3 σ: 0.045 (1 + cos(2 π d / 40)) / 2, the mean of both axes."""
    whole, expected, sigmas = shown
    wave = 0.3 * np.sin(2 * np.pi * np.arange(expected[0].shape[1]) / 40)[None, :, None]
    more = [replace(c, mean=c.mean + s * wave) for c, s in zip(whole, sigmas, strict=True)]
    plain, left = told(whole, expected), told(more, expected)
    for k, d in enumerate(STEPS):
        wanted = 0.045 * (1 + np.cos(2 * np.pi * d / 40)) / 2
        assert left.near[k] - plain.near[k] == pytest.approx(
            wanted, rel=0.25
        )  # pixels away from edges are no whole waves


def test_too_little_away_from_edges_tells_nothing(shown: Shown) -> None:
    """A photographed chessboard, reduced by eight, has edges everywhere."""
    whole, expected, _ = shown
    few = []
    for c in whole:
        mask = c.mask.copy()
        mask[6:], mask[:, 12:] = False, False
        few.append(replace(c, mask=mask))
    assert structure(few, expected) is None


def test_what_is_expected_is_the_square_of_what_a_twin_is_off_by(shown: Shown) -> None:
    """Three times ``SIGNAL``, alike everywhere in every condition: S = 9 E; noise times it has 0.04 of that, 1 σ."""
    whole, expected, _ = shown
    off = [
        replace(c, mean=c.mean + 3 * SIGNAL * (dn - c.simulated().black))
        for c, dn in zip(whole, expected, strict=True)
    ]
    left, plain = told(off, expected), told(whole, expected)
    assert left.near[AT] - plain.near[AT] == pytest.approx(9 * left.expected, rel=0.15)
    assert left.unexplained(0.0)[1] > 0.5
    assert plain.unexplained(0.0)[1] < 0.1


def test_a_flat_field_that_is_declared_more_coarsely_leaves_more(shown: Shown) -> None:
    whole, expected, _ = shown
    coarse = structure(whole, expected, twin_off(Tolerances(flat_field=0.012)))
    assert coarse is not None
    assert coarse.expected == pytest.approx(16 * told(whole, expected).expected)
    assert twin_off(Tolerances(flat_field=0.001)) == SIGNAL


def _left(times: float) -> Structure:
    return Structure(0.0, (times * 0.01,) * len(STEPS), 0.01)


def test_more_of_it_has_a_cause_and_strong_effects_leave_some() -> None:
    chances = [_left(x).unexplained(0.0)[1] for x in (0.0, 0.5, 2.4, 7.0, 20.0, 70.0)]
    assert chances[:2] == [0.0, 0.0]
    assert chances == sorted(chances)
    assert chances[2] < 0.15  # the most that a right answer of the rehearsal set had
    assert chances[3] > 0.5
    assert chances[5] > 0.99
    assert _left(20.0).unexplained(3.2)[1] < 0.5  # 0.05 of 3.2 is 16 times 0.01

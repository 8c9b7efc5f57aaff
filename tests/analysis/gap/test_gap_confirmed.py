"""Held-out captures keep an effect by how much of what it claims there they show."""

from collections.abc import Iterable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.gap import notes
from analysis.gap.evidence.likelihood import Hypothesis
from analysis.gap.judgement import calling
from analysis.gap.judgement.calling import KEPT, as_written_if_better, confirmed, taken_off, upheld
from analysis.gap.measures.shrinkage import Yardstick
from analysis.gap.search.fit import Fit

SIGMA, SHAPE, EFFECT = 5.0, (96, 128, 3), ("camera_pose", "/eye")
UNNAMED = ("fixed to places of the surface", "")


def measured(capture: np.ndarray) -> Yardstick:
    condition = SimpleNamespace(captures=(SimpleNamespace(pixels=capture),), mean=capture)
    condition.simulated = lambda: SimpleNamespace(dn=capture + 20 * SIGMA)  # as written: far off
    variance, ok = np.full(SHAPE, SIGMA**2), np.ones(SHAPE, bool)
    return Yardstick((condition,), (ok,), (variance,), (np.ones(SHAPE),))


def claimed(share: float, seed: int = 1) -> tuple[Yardstick, np.ndarray, np.ndarray]:
    """Captures that show ``share`` of what an effect says that it changes, 4 DN rms, and noise."""
    rng = np.random.default_rng(seed)
    before = np.full(SHAPE, 500.0)
    change = 4.0 * rng.standard_normal(SHAPE)
    return measured(before + share * change + SIGMA * rng.standard_normal(SHAPE)), before, before + change


@pytest.mark.parametrize("share", [1.0, 0.7, 0.5, 0.0, -0.5])
def test_what_is_taken_off_is_told_by_the_slope(share: float) -> None:
    """2 β - 1, to 2 / sqrt(Σ δ²/σ²) = 0.013 of noise."""
    by, before, after = claimed(share)
    assert taken_off(by, [before], [after]) == pytest.approx(2 * share - 1, abs=0.04)


def test_what_noise_hides_is_not_judged() -> None:
    by, before, after = claimed(0.0)
    weak = before + 0.003 * (after - before)
    assert taken_off(by, [before], [weak]) == 1.0


class Standing:
    """A model that simulates one image."""

    def __init__(self, dn: np.ndarray) -> None:
        self.dn = dn

    def simulated(self, condition: object) -> np.ndarray:
        return self.dn

    def simulations(self, conditions: Iterable[object]) -> list[np.ndarray]:
        return [self.dn for _ in conditions]


@pytest.fixture(autouse=True)
def nothing_is_open(monkeypatch: pytest.MonkeyPatch) -> None:
    """What captures that were fitted to leave open of the calibration is told by real ones (test_gap)."""
    monkeypatch.setattr(
        calling, "within_tolerances", lambda fitted, held, causes: fitted.after if causes else fitted.before
    )


def standing(first: Standing, second: Standing, *causes: tuple[str, str]) -> Fit:
    """``first`` without causes and ``second`` with them, all called; 30 % more than is expected is left."""
    none = np.zeros(0)
    return Fit(
        first,
        second,
        (Hypothesis(causes, (0.01,) * len(causes), 0.0, 0.0),),
        dict.fromkeys(causes, 0.99),
        (),
        SimpleNamespace(members={}),
        SimpleNamespace(members={}, left=lambda h: 1.3, theta=lambda h: none, e=SimpleNamespace(count=1)),
        (),
        none,
        none,
        np.zeros((0, 0)),
        {},
        lambda h: second,
    )


@pytest.mark.parametrize("cause", [EFFECT, UNNAMED])
@pytest.mark.parametrize(("share", "kept"), [(0.9, True), (0.5 + 0.5 * KEPT - 0.05, False), (0.2, False)])
def test_a_lone_cause_is_judged_against_the_file_at_its_best(
    cause: tuple[str, str], share: float, kept: bool
) -> None:
    """One that is refuted leaves 30 % more than is expected, which is told anew."""
    by, before, after = claimed(share)
    first, second = Standing(before), Standing(after)
    fitted = standing(first, second, cause)
    found = confirmed(fitted, by.conditions, by)
    assert found.best.causes == ((cause,) if kept else ())
    assert found.refuted == (() if kept else (cause,))
    assert found.after is (second if kept else first)
    assert found.left_over == ((0.0, 0.0) if kept else pytest.approx((0.3, 1.0), abs=0.01))


@pytest.mark.parametrize(("share", "kept"), [(0.9, True), (0.51, True), (0.45, False)])
def test_causes_that_make_it_worse_together_are_none(share: float, kept: bool) -> None:
    """Of a change of which less than half is true more comes in than goes: 2 β - 1, to 0.013 of noise."""
    by, before, after = claimed(share)
    fitted = standing(Standing(before), Standing(after), EFFECT, UNNAMED)
    found = upheld(fitted, by.conditions, by)
    if kept:
        assert found is fitted
        return
    assert found.best.causes == ()
    assert found.after is fitted.before
    assert found.refuted == (EFFECT, UNNAMED)
    assert found.probability == {EFFECT: 0.0, UNNAMED: 0.0}
    assert found.left_over == pytest.approx((0.3, 1.0), abs=0.01)


def test_causes_that_are_worse_than_the_file_as_written_are_none() -> None:
    """What was fitted beside them makes the file at its best worse still; as written it is 4 DN off, they 6."""
    by, _, _ = claimed(1.0)
    capture = by.conditions[0].captures[0].pixels
    by.conditions[0].simulated = lambda: SimpleNamespace(dn=capture + 4)
    fitted = standing(Standing(capture + 8), Standing(capture + 6), EFFECT)
    found = upheld(fitted, by.conditions, by)
    assert found.best.causes == ()
    assert found.refuted == (EFFECT,)
    by.conditions[0].simulated = lambda: SimpleNamespace(dn=capture + 7)
    assert upheld(fitted, by.conditions, by) is fitted


def test_a_cause_is_not_to_blame_for_what_fitted_captures_leave_open(monkeypatch: pytest.MonkeyPatch) -> None:
    """As fitted they are 8 and 6 DN off, as held-out captures show the calibration too, 1 DN: χ² is 1 + (1 / 5)²."""
    by, _, _ = claimed(1.0)
    capture = by.conditions[0].captures[0].pixels
    by.conditions[0].simulated = lambda: SimpleNamespace(dn=capture + 4)
    fitted = standing(Standing(capture + 8), Standing(capture + 6), EFFECT)
    told = Standing(capture + 1), Standing(capture + 1)
    monkeypatch.setattr(calling, "within_tolerances", lambda fitted, held, causes: told[bool(causes)])
    found = upheld(fitted, by.conditions, by)
    assert found.best.causes == (EFFECT,)
    assert (found.before, found.after) == (fitted.before, fitted.after)
    assert found.tolerated == pytest.approx(1 / SIGMA)
    assert "a chi of 0.2 there" in notes._tolerated(found)[0]
    assert not notes._tolerated(replace(found, probability={EFFECT: 0.1}))  # nothing is called in the end


def test_captures_that_show_nothing_of_a_cause_do_not_refute_it() -> None:
    """A lamp that is off in all that were held out: what calibration's errors do to those is not its doing."""
    by, _, _ = claimed(1.0)
    capture = by.conditions[0].captures[0].pixels
    by.conditions[0].simulated = lambda: SimpleNamespace(dn=capture + 4)
    fitted = standing(Standing(capture + 6), Standing(capture + 6), EFFECT)
    assert upheld(fitted, by.conditions, by) is fitted


@pytest.mark.parametrize(("share", "kept"), [(0.9, True), (0.51, True), (0.3, False)])
def test_what_the_captures_say_of_a_calibration_is_held_against_the_file_as_written(
    share: float, kept: bool
) -> None:
    """Where nothing is called; of a change of which ``share`` is true, to 0.013 of noise."""
    by, written, changed = claimed(share)
    condition = by.conditions[0]
    condition.simulated = lambda: SimpleNamespace(dn=written)
    best = Standing(changed)
    best.knots = None
    fitted = standing(best, best)
    found = as_written_if_better(fitted, by.conditions, by)
    if kept:
        assert found is fitted
        return
    assert found.before is found.after
    assert not found.before.theta.any()


def test_how_bright_a_capture_is_beside_the_others_refutes_nothing() -> None:
    """Two captures show all of an effect that makes the second brighter by 1 %, and the second is darker by that: where
    captures drift by 0.2 % the rest tells the slope, which is one; where they do not the gain does."""
    rng = np.random.default_rng(2)
    signal = rng.uniform(400, 600, SHAPE)
    shape = 4.0 * rng.standard_normal(SHAPE)
    drifts = [(0.0, shape), (-0.01, 0.25 * shape + 0.01 * signal)]  # the second changes mostly the brightness
    conditions, before, after = [], [], []
    for off, change in drifts:
        by = measured((1 + off) * signal + change + SIGMA * rng.standard_normal(SHAPE))
        by.conditions[0].simulated = lambda: SimpleNamespace(black=0.0)
        conditions.append(by.conditions[0])
        before.append(signal)
        after.append(signal + change)
    both = Yardstick(tuple(conditions), by.ok * 2, by.variance * 2, by.noise * 2)
    assert taken_off(both, before, after) < KEPT
    assert taken_off(both, before, after, 0.002) == pytest.approx(1, abs=0.05)

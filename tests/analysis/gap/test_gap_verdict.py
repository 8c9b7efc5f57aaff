"""What is called beside what has structure: looked at again until it stays, and doubted once."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.gap.judgement import verdict as module
from analysis.gap.judgement.attribution import called
from analysis.gap.judgement.verdict import Verdict, verdict
from analysis.gap.measures.structure import FORMS
from analysis.gap.search.fit import Fit
from tests.analysis.gap.test_gap_called import A, B, _fit

PROBABLE = 0.9


def _own(fitted: Fit, k: int) -> float:
    """What a cause changes, σ² of a value."""
    e = fitted.evidence.e
    return float(fitted.after.theta[k] ** 2 * e.G[k, k] / e.count)


@pytest.fixture
def left(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """σ² of structure that is left, one look after the other; what is looked at is simulated by nobody."""
    amounts: list[float] = []

    def told(conditions, judged, scale, off, fitted: Fit, corrected) -> Verdict:
        amount = amounts.pop(0)
        seen = SimpleNamespace(unnamed=lambda removed: amount)
        gap = SimpleNamespace(before=1.2, after=1.0)
        return Verdict(fitted, corrected, [], None, None, None, gap, seen, 1.0, PROBABLE)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "_told", told)
    monkeypatch.setattr(module, "borne_out", lambda fitted, *rest: fitted)
    monkeypatch.setattr(module, "upheld", lambda fitted, *rest: fitted)
    monkeypatch.setattr(module, "no_worse", lambda conditions, fitted: fitted)
    return amounts


def test_what_stays_is_doubted_once_however_often_it_is_looked_at(left: list[float]) -> None:
    """The second cause no longer outweighs structure enough and leaves; the first is held against what is left
    then alone."""
    fitted = _fit(0.95, 0.6)
    amount = 0.4 * _own(fitted, 1)
    left += [amount, amount]
    found = verdict(fitted, [], [], [], 1.0)
    assert called(found.fitted) == [A]
    assert found.fitted.probability[B] < 0.5
    alone = _own(found.fitted, 0)
    assert found.fitted.probability[A] == pytest.approx(0.95 * alone / (alone + PROBABLE * amount))
    assert not left


def test_what_stays_is_held_against_the_captures_where_it_stands_alone(
    left: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the second cause the first makes them worse, and is not called either."""

    def refuted(fitted: Fit, *rest: object) -> Fit:
        return replace(fitted, hypotheses=(fitted.best.of(()),), probability={A: 0.0, B: 0.0})

    monkeypatch.setattr(module, "upheld", refuted)
    monkeypatch.setattr(module, "as_written_if_better", lambda fitted, *rest: fitted)
    fitted = _fit(0.95, 0.6)
    left += [0.4 * _own(fitted, 1)] * 2
    assert called(verdict(fitted, [], [], [], 1.0).fitted) == []


def test_all_that_is_called_and_outweighs_it_is_looked_at_once(left: list[float]) -> None:
    fitted = _fit(0.95, 0.9)
    left.append(0.05 * min(_own(fitted, 0), _own(fitted, 1)))
    found = verdict(fitted, [], [], [], 1.0)
    assert called(found.fitted) == [A, B]
    assert found.fitted.after is fitted.after
    assert np.all([0.85 < p < 0.95 for p in found.fitted.probability.values()])


def test_formulas_of_lobes_may_leave_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of half of what is changed, 0.16 for 0.05, and no more than 0.05 of what no lobes are."""
    fitted = _fit(0.95, 0.9)
    seen = Verdict(fitted, [], [], None, None, None, SimpleNamespace(before=1.2, after=1.0), None, 1.0, 0.0)  # type: ignore[arg-type]
    assert module._removed(seen) == pytest.approx(0.44)
    monkeypatch.setattr(module, "LOBES", (A[0],))
    share = _own(fitted, 0) / (_own(fitted, 0) + _own(fitted, 1))
    assert FORMS * module._removed(seen) == pytest.approx(0.44 * (0.16 * share + FORMS * (1 - share)))

"""Stripes over the image, where captures are looked at in one pixel of many."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.terms import stripe
from analysis.gap.terms.base import Term

CAMERA, STRIDE, SLOWEST = "/World/Camera0", 3, 7


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory, small_bench) -> Condition:
    return small_bench(tmp_path_factory.mktemp("stripes"), {0: "Camera0", 2: "Camera0", 6: "Camera0"}, 1)[0]


def _striped(c: Condition, period: float, stride: int, monkeypatch: pytest.MonkeyPatch) -> list[Term]:
    """Stripes that lie across the image, neither their crests nor what lies between on every third row."""
    row = np.arange(c.mean.shape[0])[:, None, None]
    own = replace(
        c, mean=(c.simulated().dn * (1 + 0.05 * np.sin(2 * np.pi * row / period + 0.8))).astype(np.float32)
    )
    monkeypatch.setattr(stripe, "stride_for", lambda conditions: stride)
    return stripe.stripe_terms(CAMERA, [own], 0.01, SLOWEST)


def test_where_every_pixel_is_looked_at_both_phases_are_told(found, monkeypatch) -> None:
    terms = [t for t in _striped(found, 6, 1, monkeypatch) if "period 6.0 px at 90" in t.target]
    assert {t.parameter.split()[0] for t in terms} == {"cos", "sin"}


@pytest.mark.parametrize("period", [2, 3, 6, 16])
def test_what_hardly_shows_where_pixels_are_looked_at_is_not_told_of(found, monkeypatch, period) -> None:
    """A number that only rounding tells was 18 times the signal in a blind case, and took a true lamp with it. 6 px: no
    sine; 3 px and 16: what looks as even as a gain, or as slow as a flat field's waves, is no stripes."""
    terms = _striped(found, period, STRIDE, monkeypatch)
    looked_at = State(found, stride=STRIDE)
    signal = np.sqrt(np.mean(looked_at.signal**2))
    for t in terms:
        column = t.column(looked_at)
        assert column is not None
        assert np.sqrt(np.mean(np.square(column))) > 0.5 * stripe.SHOWN * signal / np.sqrt(3)
    told = {t.parameter.split()[0] for t in terms if f"period {period}.0 px at 90" in t.target}
    assert told == {2: {"cos"}, 3: set(), 6: {"cos"}, 16: set()}[period]

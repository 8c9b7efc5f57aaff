"""What the report says of rivals."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from analysis.gap.report_words import why_not


def _fit(instead: float) -> Any:
    of = SimpleNamespace
    best = of(score=10.0, causes=(("defocus", ""),))
    return of(best=best, hypotheses=[best, of(score=instead, causes=(("motion_blur", ""),))])


@pytest.mark.parametrize(
    ("instead", "said"),
    [
        (10 - math.log(400), "is 400 times less probable"),
        (-math.inf, "no numbers that could stand in its place"),
    ],
)
def test_a_rival_is_told_by_how_much_less_probable_it_is(instead: float, said: str) -> None:
    finding: Any = SimpleNamespace(name="defocus", rivals=())
    words = why_not(_fit(instead), finding)
    assert said in next(w for w in words if w.startswith("motion blur"))
    assert "not tried" in next(w for w in words if w.startswith("light size"))

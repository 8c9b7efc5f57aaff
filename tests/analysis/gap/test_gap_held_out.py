"""Which conditions nothing is fitted to."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition, conditions
from interchange.captures import Capture, Captures
from interchange.formats.document import open_scene
from interchange.problems import BrightfieldError

BENCH = Path(__file__).parents[3] / "assets/bench_sample/scene.usda"
DARK, ALL = 7, 6  # times: no lamp, all six; before them each by itself


def _conditions(seen: Sequence[tuple[int, int, float]], holdout: tuple[str, ...] = ()) -> list[Condition]:
    """Of camera, time and exposure (s)."""
    blank = np.zeros((360, 480, 3), np.float32)
    captures = tuple(
        Capture(f"{k}.png", f"/World/Camera{c}", t, t_exp, blank) for k, (c, t, t_exp) in enumerate(seen)
    )
    document = open_scene(BENCH)
    return conditions(Captures(document.path, document.path, captures, holdout=holdout), document)


def _held(found: Sequence[Condition]) -> list[int]:
    return [k for k, c in enumerate(found) if c.held_out]


BENCH_SEEN = [
    *[(0, lamp, 1.0) for lamp in range(6)], (0, ALL, 0.5), (0, ALL, 0.25), (0, ALL, 1.0), (0, DARK, 1.0),
    (1, ALL, 0.5), *[(1, lamp, 1.0) for lamp in (0, 2, 5)],
]  # fmt: skip


def test_one_in_four_whole_and_every_lamp_and_camera_is_left_to_fit_to() -> None:
    found = _conditions(BENCH_SEEN)
    held = _held(found)
    assert len(held) == round(len(found) / 4)
    rest = [c for k, c in enumerate(found) if k not in held]
    assert {c.camera.name for c in rest} == {"/World/Camera0", "/World/Camera1"}
    assert {x for c in rest for x in c.lamps} == {f"/World/LED{k}" for k in range(6)}


def test_what_is_named_is_held_out() -> None:
    assert _held(_conditions(BENCH_SEEN, holdout=("7.png", "2.png"))) == [2, 7]
    with pytest.raises(BrightfieldError, match="must leave one condition"):
        _conditions(BENCH_SEEN[:3], holdout=("0.png", "1.png", "2.png"))

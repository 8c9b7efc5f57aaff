"""What is left is told by where it lies."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.regions import light_regions
from analysis.gap.measures.shape_left import shape_left
from tests.analysis.gap.bench import Rig, of_their_own


@pytest.fixture(scope="module")
def shown(rig: Rig) -> tuple[list[Condition], list[np.ndarray]]:
    return of_their_own(rig, 3)[:2]


def test_what_is_on_one_material_is_told_by_it(shown: tuple[list[Condition], list[np.ndarray]]) -> None:
    whole, expected = shown
    names = whole[0].shown.scene.material_names
    counts = [int((whole[0].shown.passes["material_id"] == k).sum()) for k in range(len(names))]
    chosen = next(k for k in np.argsort(counts) if counts[k] > 300)  # a small one
    off = [
        dn - 30.0 * (c.shown.passes["material_id"] == chosen)[..., None]
        for c, dn in zip(whole, expected, strict=True)
    ]
    said = shape_left(whole, off)
    assert f"100 % of it on {names[chosen].rsplit('/', 1)[-1]}, " in said


def test_what_is_at_edges_of_one_cameras_images_is_told_so(
    shown: tuple[list[Condition], list[np.ndarray]],
) -> None:
    whole, expected = shown
    off = [
        dn - 40.0 * light_regions(c)["edge"][..., None] * (c.camera.name == "/World/Camera0")
        for c, dn in zip(whole, expected, strict=True)
    ]
    said = shape_left(whole, off)
    assert "100 % of it at edges, " in said
    assert "in Camera0" in said


def test_what_is_everywhere_is_spread_evenly(shown: tuple[list[Condition], list[np.ndarray]]) -> None:
    """Noise twice as large."""
    whole, expected = shown
    twice = [replace(c, mean=2 * c.mean - dn) for c, dn in zip(whole, expected, strict=True)]
    assert shape_left(twice, expected) == "spread evenly over all that was looked at"

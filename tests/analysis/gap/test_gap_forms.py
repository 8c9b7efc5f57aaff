"""How effects may differ from their formulas, and what no image tells."""

import numpy as np
import pytest

from analysis.gap.terms.form import displaced
from analysis.gap.terms.roundness import is_round
from interchange.mesh import Mesh


def _edge(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-x / 8))


def test_a_skewed_blur_is_an_even_one_a_little_aside() -> None:
    """On an edge much wider than the kernels, which have one mean and variance: the difference is -m3 / 6 of its third
    derivative, m3 / (3 m2) px of what the even one changes, to the right."""
    at, weight = np.array([-2.0, 0.0, 1.0]), np.array([0.1, 0.7, 0.2])
    assert at @ weight == pytest.approx(0)
    m2, m3 = (float(weight @ at**k) for k in (2, 3))
    x = np.arange(-90.0, 90)
    skewed = sum(w * _edge(x - a) for a, w in zip(at, weight, strict=True))
    even = (_edge(x - np.sqrt(m2)) + _edge(x + np.sqrt(m2))) / 2
    change = np.broadcast_to((even - _edge(x))[None, :, None], (3, len(x), 1))
    said = displaced(change)["to the right of it"][1, :, 0] * m3 / (3 * m2)
    assert said == pytest.approx(skewed - even, abs=0.1 * np.abs(skewed - even).max())


def _prism(sides: int, radius: float, height: float) -> Mesh:
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    low, high = (np.column_stack([ring, np.full(sides, z)]) for z in (0.0, height))
    faces = []
    for i in range(sides):
        j = (i + 1) % sides
        faces += [[i, j, sides + j], [i, sides + j, sides + i]]
        faces += [[2 * sides, j, i], [2 * sides + 1, sides + i, sides + j]]
    vertices = np.concatenate([low, high, [[0, 0, 0], [0, 0, height]]])
    return Mesh(vertices, np.array(faces), np.zeros_like(vertices))


@pytest.mark.parametrize(("sides", "round_"), [(48, True), (24, True), (6, False), (4, False)])
def test_no_image_tells_the_turn_of_a_rod(sides: int, round_: bool) -> None:
    assert is_round(_prism(sides, 0.01, 0.03)) is round_

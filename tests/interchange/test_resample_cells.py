"""Means over cells, moved by fractions of a cell, against integrals over what they are means of."""

from collections.abc import Callable

import numpy as np
import pytest

from interchange.filtering import edges, resample, resample_cells

N = 48  # cells a side
FINE = 60  # parts of a cell that the image is drawn on, which whole parts of a cell move
SHIFTS = [(0.5, 0.0), (0.25, 0.4), (-0.35, 0.6), (0.3, -0.6)]


def means(image: np.ndarray, by: tuple[float, float]) -> np.ndarray:
    """(N, N, 1) over cells of ``image`` (h, w), moved ``by`` cells to the right and down; the rim is left over."""
    right, down = (round(x * FINE) for x in by)
    part = image[FINE - down : FINE - down + N * FINE, FINE - right : FINE - right + N * FINE]
    return part.reshape(N, FINE, N, FINE).mean(axis=(1, 3))[..., None].astype(np.float32)


def places(by: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    column, row = np.meshgrid(np.arange(N, dtype=np.float32), np.arange(N, dtype=np.float32))
    return column - np.float32(by[0]), row - np.float32(by[1])


def drawn(f: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    at = (np.arange((N + 2) * FINE) + 0.5) / FINE
    x, y = np.meshgrid(at, at)
    return np.asarray(f(x, y), np.float64)


def errors(image: np.ndarray, by: tuple[float, float]) -> tuple[float, float]:
    """rms of `resample_cells` and of `resample`, away from the rim."""
    cells, expected = means(image, (0, 0)), means(image, by)
    inside = np.s_[4:-4, 4:-4]
    return tuple(  # type: ignore[return-value]
        float(np.sqrt(np.mean((f(cells, *places(by)) - expected)[inside] ** 2)))
        for f in (resample_cells, resample)
    )


@pytest.mark.parametrize("by", SHIFTS)
@pytest.mark.parametrize("at", [20.0, 20.3, 20.5, 20.85])
def test_one_straight_edge_is_exact_wherever_it_lies(at: float, by: tuple[float, float]) -> None:
    for image in (drawn(lambda x, y: 1.0 + 9.0 * (x > at)), drawn(lambda x, y: 1.0 + 9.0 * (y < at))):
        assert errors(image, by)[0] < 1e-5  # float32


@pytest.mark.parametrize("by", SHIFTS)
def test_a_slope_of_light_is_exact_too(by: tuple[float, float]) -> None:
    assert errors(drawn(lambda x, y: 1.0 + 0.4 * x + 0.1 * y), by)[0] < 1e-5  # of 25


@pytest.mark.parametrize("slant", [0.03, 0.12, 0.5, 1.0])
def test_slanted_edges_are_nearer_than_by_what_is_exact_for_parabolas(slant: float) -> None:
    image = drawn(lambda x, y: 1.0 + 9.0 * (x > 15.0 + slant * y))
    for by in SHIFTS:
        ours, theirs = errors(image, by)
        assert ours < 0.7 * theirs  # the nearest, at 45 degrees, where a cell's edge is no column's


def test_a_round_spot_keeps_its_light_and_is_nearer() -> None:
    image = drawn(lambda x, y: 1.0 + 9.0 * (np.hypot(x - 24.3, y - 25.1) < 11.2))
    for by in SHIFTS:
        ours, theirs = errors(image, by)
        assert ours < 0.6 * theirs
        cells = means(image, (0, 0))
        assert resample_cells(cells, *places(by)).sum() == pytest.approx(cells.sum(), rel=1e-4)


def test_channels_are_moved_apart_and_places_without_an_edge_are_resampled_as_ever() -> None:
    edge = means(drawn(lambda x, y: 1.0 + 9.0 * (x > 20.5)), (0, 0))
    flat = means(drawn(lambda x, y: 1.0 + 0.001 * x), (0, 0))
    both, by = np.concatenate([edge, flat], axis=2), SHIFTS[1]
    out = resample_cells(both, *places(by))
    np.testing.assert_allclose(out[..., :1], resample_cells(edge, *places(by)), rtol=1e-6)
    np.testing.assert_allclose(out[..., 1:], resample(flat, *places(by)), rtol=1e-5)
    assert not edges(flat).found.size
    near = edges(edge)
    np.testing.assert_array_equal((near.place >= 0).any(axis=0).nonzero()[0], [17, 18, 19, 20, 21])
    np.testing.assert_array_equal(
        near.found[near.place[24, 17:22], 0, 0], [0, -1, 1, -1, 0]
    )  # cell 19 alone has it


def test_near_the_cells_places_are_resampled_as_ever() -> None:
    edge = means(drawn(lambda x, y: 1.0 + 9.0 * (x > 20.5)), (0, 0))
    by = (0.2, -0.8)
    np.testing.assert_array_equal(resample_cells(edge, *places(by)), resample(edge, *places(by)))

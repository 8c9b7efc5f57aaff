"""Reflected light on a finer grid: what is smooth on surfaces is told at their edges too."""

import numpy as np
import pytest

from analysis.gap.light.radiance import means
from analysis.gap.light.reflected import finely

N, H, W = 3, 24, 32


@pytest.fixture(scope="module")
def edge() -> tuple[np.ndarray, np.ndarray]:
    """A slanted edge between surfaces 0 and 1, and a fold in surface 1: (surface, normal)."""
    v, u = np.meshgrid(np.arange(N * H), np.arange(N * W), indexing="ij")
    surface = (u > 30 + 0.37 * v).astype(np.int64)
    normal = np.zeros((N * H, N * W, 3), np.float32)
    normal[..., 2] = 1
    normal[(surface == 1) & (v > 41)] = (0, 1, 0)
    return surface, normal


def _light(surface: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Linear on each surface and side of the fold, with steps of 0.9 and 0.4 between."""
    v, u = np.meshgrid(np.arange(N * H), np.arange(N * W), indexing="ij")
    step = 0.4 + 0.9 * (surface == 1) + 0.4 * (normal[..., 1] > 0)
    slope = np.where(surface == 1, 2e-3 * u, -1e-3 * v)
    return np.stack([step + slope, 0.5 * step + slope], axis=-1).astype(np.float32)


def test_edges_between_surfaces_stay_sharp(edge: tuple[np.ndarray, np.ndarray]) -> None:
    """Within 0.01 everywhere, of steps of 0.4 and 0.9: a slope of 0.002 a fine pixel over the 1.7 px that the points
    of a mixed pixel are away from what a mean takes. Copies of the pixels are off by up to half a step."""
    surface, normal = edge
    light = _light(surface, normal)
    found = finely(means(light, N), surface, normal)
    error = np.abs(found - light).max(axis=2)
    assert error[N:-N, N:-N].max() < 0.01
    plain = np.repeat(np.repeat(means(light, N), N, axis=0), N, axis=1)
    assert np.abs(plain - light).max() > 0.3


def test_means_of_pixels_are_what_was_drawn(edge: tuple[np.ndarray, np.ndarray]) -> None:
    surface, normal = edge
    drawn = means(_light(surface, normal), N)
    assert means(finely(drawn, surface, normal), N) == pytest.approx(drawn, rel=1e-5)


def test_surfaces_smaller_than_a_pixel_take_the_mean_there(edge: tuple[np.ndarray, np.ndarray]) -> None:
    surface, normal = edge
    surface = surface.copy()
    surface[30:32, 12:80] = 2  # never alone in a pixel
    drawn = np.full((H, W, 1), 0.7, np.float32)
    assert finely(drawn, surface, normal) == pytest.approx(0.7, rel=1e-5)


def test_where_nothing_is_there_is_no_light() -> None:
    surface = np.full((N * 4, N * 4), -1)
    normal = np.full((N * 4, N * 4, 3), np.nan, np.float32)
    assert not finely(np.zeros((4, 4, 3), np.float32), surface, normal).any()

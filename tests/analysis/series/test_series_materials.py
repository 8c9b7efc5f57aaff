"""Materials by their reflectance: features of one lobe, and clusters."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from analysis.series.clusters import adjusted_rand, k_means
from analysis.series.lafortune_features import lafortune_features
from analysis.series.lightings import hemisphere, unit
from interchange.brdf.lafortune import Lafortune
from interchange.image import Quantity
from interchange.problems import BrightfieldError
from interchange.series import Series

WI = unit(hemisphere(np.radians([12, 24, 36, 48, 60, 72]), 24))
UP = np.array([0.0, 0, 1])


def lobe(k_d, c_z, n):
    return Lafortune(diffuse=(k_d,) * 3, weight=((1.0,) * 3,), C=((-1.0, -1.0, c_z),), n=(n,))


def drawn(parameters, quantity=Quantity.RADIANCE):
    """A row of pixels, one a set of parameters, under 144 lamps of π W/m²."""
    f = np.stack([lobe(*p).evaluate(WI, UP)[:, 0] for p in parameters], axis=-1)
    L = np.pi * f * WI[:, 2:]
    return Series(L[:, None, :, None], WI, np.full(len(WI), np.pi), quantity=quantity)


PARAMETERS = [(0.2, 0.98, 12.0), (0.05, 1.01, 40.0), (0.6, 0.7, 4.0)]


def test_the_features_are_the_parameters_drawn():
    found = lafortune_features(drawn(PARAMETERS))
    expected = [[c_z, k_d, n] for k_d, c_z, n in PARAMETERS]
    np.testing.assert_allclose(found.features[0], expected, rtol=2e-3)  # images are single precision


def test_the_additive_features_are_reflectances():
    """Albedo and height of the lobe, the former by adding it up over the hemisphere."""
    found = lafortune_features(drawn(PARAMETERS)).additive[0]
    theta = np.linspace(0, np.pi / 2, 20001)
    for row, (k_d, c_z, n) in zip(found, PARAMETERS, strict=True):
        lobe_f = (c_z * np.cos(theta)) ** n
        albedo = 2 * np.pi * trapezoid(lobe_f * np.cos(theta) * np.sin(theta), theta)
        np.testing.assert_allclose(row, [k_d, k_d + albedo, c_z**n], rtol=2e-3)


def test_images_of_no_unit_give_the_same_lobe():
    a = lafortune_features(drawn(PARAMETERS))
    series = drawn(PARAMETERS, Quantity.DN)
    b = lafortune_features(Series(1e4 * series.images, WI, series.irradiance, quantity=Quantity.DN))
    np.testing.assert_allclose(b.n, a.n, rtol=1e-2)
    ratio = b.k_d / a.k_d
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-2)


def test_a_turned_surface_has_the_same_features_with_its_normal():
    """Directions of light and camera in the pixel's frame: a pixel that is tilted by 20 degrees."""
    n = np.array([np.sin(0.35), 0.0, np.cos(0.35)])
    frame = np.stack([np.cross([0, 1.0, 0], n), [0, 1.0, 0], n])
    model = lobe(0.2, 0.98, 12.0)
    f = model.evaluate(WI @ frame.T, frame @ UP)[:, 0]
    L = np.pi * f * np.maximum(WI @ n, 0)
    series = Series(L[:, None, None, None], WI, np.full(len(WI), np.pi))
    found = lafortune_features(series, n[None, None])
    np.testing.assert_allclose(found.features[0, 0], [0.98, 0.2, 12.0], rtol=5e-3)
    blind = lafortune_features(series).features[0, 0]
    assert abs(blind[2] / 12 - 1) > 0.1  # without the normal it is another


def test_a_grazing_lamp_and_saturated_samples_are_left_out():
    series = drawn(PARAMETERS)
    wi = np.concatenate([WI, unit(np.array([[0.3, np.radians(89.9)]]))])
    images = np.concatenate([series.images, np.full_like(series.images[:1], 1e3)])
    valid = np.ones(images.shape[:3], bool)
    images[:2], valid[:2] = 77.0, False
    found = lafortune_features(Series(images, wi, np.full(len(wi), np.pi), valid=valid))
    np.testing.assert_allclose(found.n[0], [p[2] for p in PARAMETERS], rtol=5e-3)


def test_three_lamps_are_too_few():
    series = drawn(PARAMETERS)
    with pytest.raises(BrightfieldError, match="four lamps or more"):
        lafortune_features(series.choose([0, 50, 100]))


def test_clusters_find_what_is_apart():
    rng = np.random.default_rng(0)
    truth = rng.choice(3, (20, 30), p=[0.6, 0.3, 0.1])
    x = np.array([[0, 0], [3, 1000], [6, 0]])[truth] + rng.normal(size=(20, 30, 2)) * [0.3, 100]
    found = k_means(x, 3)
    assert adjusted_rand(found.labels, truth) == 1.0
    np.testing.assert_array_equal(found.labels, truth)  # in the order of size
    np.testing.assert_allclose(found.centers, [[0, 0], [3, 1000], [6, 0]], atol=30)
    x[0, 0] = np.nan
    assert k_means(x, 3).labels[0, 0] == -1


def test_the_rand_index_of_a_published_example():
    """Hubert and Arabie's correction: Steinley, Properties of the Hubert-Arabie adjusted Rand index. 2004, by hand:
    a = 0 0 1 1, b = 0 0 1 2: pairs together in both 1, in a 2, in b 1, of 6: (1 - 2/6) / (1.5 - 2/6) = 4/7."""
    assert adjusted_rand(np.array([0, 0, 1, 1]), np.array([0, 0, 1, 2])) == pytest.approx(4 / 7)
    assert adjusted_rand(np.array([0, 0, 1, 1, -1]), np.array([5, 5, 3, 3, 3])) == 1.0

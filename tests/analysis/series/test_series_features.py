"""Features, chosen lamps and fusion: each against a closed form, a law or what was planted."""

import numpy as np
import pytest

from analysis.series.azimuth_features import azimuth_features, rings_of, waves
from analysis.series.choice import choose_by_forest, choose_unsupervised
from analysis.series.clusters import adjusted_rand, k_means
from analysis.series.fusion import energy, fuse, local_contrast
from analysis.series.hemispherical_harmonics import basis, classify, harmonic_features
from analysis.series.invariants import half_angle_profile, rotation_invariants
from analysis.series.lightings import hemisphere, unit
from analysis.series.local_frame import frames_of
from analysis.series.reflectance_functions import on_grid, reflectance_function
from interchange.brdf.blinn_phong import BlinnPhong
from interchange.brdf.ward import Ward
from interchange.problems import BrightfieldError
from interchange.series import Series

ANGLES = hemisphere(np.radians([15, 30, 45, 60]), 24)
WI = unit(ANGLES)
UP = np.array([0.0, 0, 1])


def tilted(beta, azimuth):
    return unit(np.stack([np.asarray(azimuth), np.asarray(beta)], axis=-1))


def lit(brdf, n, wi=WI, E=2.0):
    """(L, H, W) radiance of isotropic surfaces with normals ``n`` (H, W, 3), seen from z."""
    frames = frames_of(n)
    i = np.einsum("hwij,lj->lhwi", frames, wi)
    o = np.einsum("hwij,j->hwi", frames, UP)
    return E * brdf.evaluate(i, o)[..., 0] * np.maximum(i[..., 2], 0)


def series_of(images, wi=WI, **more):
    return Series(images[..., None], wi, np.full(len(wi), 2.0), **more)


FLAT = np.broadcast_to(UP, (3, 4, 3))


def test_the_harmonics_are_orthonormal_over_the_hemisphere():
    """Gauss-Legendre in cos θ and equal steps in φ integrate products of degree 3 exactly."""
    x, weight = np.polynomial.legendre.leggauss(8)
    cos = (x + 1) / 2
    phi = 2 * np.pi * np.arange(16) / 16
    w = unit(np.stack(np.meshgrid(phi, np.arccos(cos), indexing="ij"), axis=-1))
    H = basis(w, 3)
    gram = np.einsum("abi,abj,b->ij", H, H, weight / 2 * 2 * np.pi / 16)
    np.testing.assert_allclose(gram, np.eye(16), atol=1e-12)


def test_a_cosine_has_the_coefficients_of_its_integral():
    """r = cos θ: c_00 = ∫ cos / sqrt(2π) dω = π / sqrt(2π); c_10 by H_10 = sqrt(3 / 2π)(2 cos - 1): π/3 sqrt(3/2π)."""
    found = harmonic_features(series_of(np.broadcast_to(2 * WI[:, 2, None, None], (96, 3, 4))), degree=2)
    expected = np.zeros(9)
    expected[0], expected[2] = np.pi / np.sqrt(2 * np.pi), np.sqrt(3 / (2 * np.pi)) * np.pi / 3
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=2e-5)


def test_harmonics_in_the_own_frame_do_not_depend_on_the_normal():
    n = tilted(np.full((1, 6), 0.25), np.linspace(0, 5, 6)[None])
    brdf = Ward(diffuse=(0.3,) * 3, specular=(0.1,) * 3, alpha=0.4)
    series = series_of(lit(brdf, n))
    own = harmonic_features(series, n, degree=2)
    blind = harmonic_features(series, degree=2)
    spread = lambda x: np.linalg.norm(x - x.mean(axis=1, keepdims=True)) / np.linalg.norm(x)  # noqa: E731
    assert spread(blind) > 3 * spread(own)


def test_a_support_vector_machine_tells_materials_apart_whatever_their_tilt():
    rng = np.random.default_rng(0)
    n = tilted(rng.uniform(0, 0.35, (24, 24)), rng.uniform(0, 6.28, (24, 24)))
    truth = np.repeat([[0, 1, 2]], 24, axis=0).repeat(8, axis=1)
    brdfs = [
        Ward(diffuse=(d,) * 3, specular=(s,) * 3, alpha=a)
        for d, s, a in ((0.3, 0.02, 0.3), (0.22, 0.15, 0.3), (0.3, 0.1, 0.5))
    ]
    images = np.choose(truth, [lit(b, n) for b in brdfs])
    images = images * (1 + 0.01 * rng.normal(size=images.shape))
    x = harmonic_features(series_of(images), n)
    labels = np.where(rng.random(truth.shape) < 0.3, truth, -1)
    found = classify(x, labels)
    unseen = labels < 0
    assert (found.labels == truth)[unseen].mean() > 0.9
    assert abs(found.accuracy[0] - (found.labels == truth)[unseen].mean()) < 0.08
    with pytest.raises(BrightfieldError, match="two classes"):
        classify(x, np.where(truth == 0, 0, -1))


def test_a_tilted_matte_facet_has_its_wave():
    """a_1 / a_0 of one circle = tan θ tan β, towards the tilt; a_2 = 0."""
    n = tilted(np.array([[0.1, 0.3]]), np.array([[0.5, 4.0]]))
    one = ANGLES[:, 1] == ANGLES[24, 1]
    brdf = BlinnPhong(diffuse=(0.5,) * 3, specular=(0.0,) * 3)
    series = series_of(lit(brdf, n, WI[one]), WI[one])
    level, first, second, rest = waves(series)
    ratio = np.linalg.norm(first, axis=-1) / level
    np.testing.assert_allclose(ratio[0], np.tan(ANGLES[24, 1]) * np.tan([0.1, 0.3]), rtol=1e-5)
    np.testing.assert_allclose(
        np.mod(np.arctan2(first[..., 1], first[..., 0]), 2 * np.pi)[0], [0.5, 4.0], atol=1e-5
    )
    assert np.abs(second).max() < 1e-6 * level.max()
    assert np.abs(rest).max() < 1e-6 * level.max()


def test_features_of_the_azimuth_stay_when_the_object_is_turned_on_the_spot():
    brdf = Ward(diffuse=(0.3,) * 3, specular=(0.1,) * 3, alpha=0.2)
    angle = 0.4 + np.arange(4) * 2 * np.pi / 24 * 5
    n = tilted(np.full((1, 4), 0.2), angle[None])
    series = series_of(lit(brdf, n))
    for x in (azimuth_features(series), rotation_invariants(series)):
        np.testing.assert_allclose(x[0], np.broadcast_to(x[0, :1], x[0].shape), rtol=2e-3, atol=1e-6)
    assert len(np.unique(rings_of(series))) == 4
    with pytest.raises(BrightfieldError, match="do not tell a first and a second wave"):
        azimuth_features(series.choose([0, 12, 24, 36, 48, 60]))
    with pytest.raises(BrightfieldError, match="equidistant; circle 0 has 23"):
        rotation_invariants(series.choose(np.arange(1, 96)))


def test_a_profile_over_the_half_angle_does_not_depend_on_the_normal():
    """f = 0.3 / π + 0.5 (n . h)^20 is told by the half angle alone: in the middle of a bin, within how lamps fill its
    width."""
    n = tilted(np.array([[0.0, 0.15, 0.25]]), np.array([[0.0, 1.0, 3.0]]))
    edges = np.radians([5, 10, 15, 20, 25])
    wi = unit(hemisphere(np.radians(np.arange(4, 72, 4)), 36))
    h = (wi + UP) / np.linalg.norm(wi + UP, axis=1, keepdims=True)
    f = 0.3 / np.pi + 0.5 * np.maximum(np.einsum("lk,hwk->lhw", h, n), 0) ** 20
    series = series_of(2 * f * np.maximum(np.einsum("lk,hwk->lhw", wi, n), 0), wi)
    found = half_angle_profile(series, n, edges)
    expected = 0.3 / np.pi + 0.5 * np.cos((edges[1:] + edges[:-1]) / 2) ** 20
    assert np.abs(found / expected - 1).max() < 0.05
    wrong = half_angle_profile(series, np.broadcast_to(UP, n.shape), edges)
    assert np.abs(wrong / expected - 1).max() > 0.3


def test_segments_of_brushed_and_plain_metal():
    """Two textures of equal mean brightness; only the second wave tells them apart."""
    rng = np.random.default_rng(1)
    truth = np.zeros((20, 20), int)
    truth[:, 10:] = 1
    phi = ANGLES[:, 0]
    along = np.where(truth == 0, 0.3, 0.02)
    images = 1 + along * np.cos(2 * phi)[:, None, None] + 0.05 * rng.normal(size=(96, 20, 20))
    series = series_of(images)
    assert adjusted_rand(k_means(azimuth_features(series), 2).labels, truth) > 0.95
    level = series.grey.mean(axis=0)[..., None]
    assert adjusted_rand(k_means(level, 2).labels, truth) < 0.1


def planted(rng, pixels=400):
    """12 images of 3 hidden sources: 0, 5, 9 are the sources, the rest mixtures with noise."""
    sources = rng.normal(size=(3, pixels))
    mix = rng.normal(size=(12, 3))
    mix[[0, 5, 9]] = np.eye(3)
    x = mix @ sources + 0.2 * rng.normal(size=(12, pixels))
    x[[0, 5, 9]] = sources
    return x + 10


def residual_of(d, s):
    """What regression on ``s`` leaves of ``d``."""
    return d - (d @ s.T) @ np.linalg.solve(s @ s.T, s)


def test_unsupervised_choice_explains_what_regression_does():
    x = planted(np.random.default_rng(2))
    series = Series(x.reshape(12, 20, 20, 1), WI[:12])
    found = choose_unsupervised(series, 5, standardise=False)
    d = x - x.mean(axis=1, keepdims=True)
    for k in range(1, 6):
        s = d[found.lamps[:k]]
        np.testing.assert_allclose(
            found.score[k - 1], 1 - (residual_of(d, s) ** 2).sum() / (d**2).sum(), atol=1e-5
        )
    one = [1 - (residual_of(d, d[[k]]) ** 2).sum() / (d**2).sum() for k in range(12)]
    np.testing.assert_allclose(found.score[0], max(one), atol=1e-5)
    assert (np.diff(found.score) > 0).all()


def test_a_repeated_image_is_not_chosen_twice():
    x = planted(np.random.default_rng(3))
    x[7] = x[1]
    found = choose_unsupervised(Series(x.reshape(12, 20, 20, 1), WI[:12]), 8)
    assert not {1, 7} <= set(found.lamps)
    with pytest.raises(BrightfieldError, match="Between 1 and 12"):
        choose_unsupervised(Series(x.reshape(12, 20, 20, 1), WI[:12]), 13)


def test_the_forest_finds_the_lamps_that_matter():
    rng = np.random.default_rng(4)
    truth = rng.integers(0, 3, (24, 24))
    images = rng.normal(size=(20, 24, 24)) + 5
    images[3] += 3 * (truth == 1)
    images[11] += 3 * (truth == 2)
    series = Series(images[..., None], WI[:20])
    found = choose_by_forest(series, truth, 2, trees=60)
    assert set(found.lamps) == {3, 11}
    assert found.score[1] > found.score[0] + 0.1
    with pytest.raises(BrightfieldError, match="two classes or more; got 1"):
        choose_by_forest(series, np.zeros((24, 24), int), 2)


def patches():
    """Each quarter of the image has structure under one lamp alone."""
    rng = np.random.default_rng(5)
    images = np.full((4, 32, 32), 0.5)
    noise = 0.2 * rng.normal(size=(32, 32))
    quarter = [(slice(0, 16), slice(0, 16)), (slice(0, 16), slice(16, 32)), (slice(16, 32), slice(0, 16))]
    quarter.append((slice(16, 32), slice(16, 32)))
    for k, at in enumerate(quarter):
        images[k][at] += noise[at] * (1.3 if k == 2 else 1.0)
    wi = unit(hemisphere([0.8], 4))
    return Series(images[..., None], wi), quarter


def test_fusion_takes_each_place_from_the_lamp_that_shows_it():
    series, quarter = patches()
    found = fuse(series, 0.05, window=1.5)
    for k, at in enumerate(quarter):
        inside = found.lamp[at][3:-3, 3:-3]
        assert (inside == k).mean() > 0.95
    assert found.best_single == 2
    single = local_contrast(series)[found.best_single].mean()
    assert found.contrast.mean() > 1.8 * single


def test_without_smoothness_every_pixel_has_its_best_lamp_and_with_much_all_have_one():
    series, _ = patches()
    K = local_contrast(series, 1.5)
    free = fuse(series, 0.0, 1.5)
    assert np.array_equal(free.lamp, np.argmax(K, axis=0))
    tied = fuse(series, 50.0, 1.5)
    assert (tied.lamp == 2).all()
    np.testing.assert_allclose(tied.image, series.grey[2], atol=1e-4)


def test_the_cooled_map_has_less_energy_than_its_rivals():
    series, _ = patches()
    smoothness = 0.05
    K = local_contrast(series, 1.5)
    found = energy(K, fuse(series, smoothness, 1.5).lamp, series.wi, smoothness)
    assert found < energy(K, np.argmax(K, axis=0), series.wi, smoothness)
    assert found < min(energy(K, np.full((32, 32), k), series.wi, smoothness) for k in range(4))


def test_the_reflectance_function_of_a_matte_facet():
    """r = rho / pi (n . w), sample by sample, on the grid of the lamps."""
    n = tilted(np.array([[0.2]]), np.array([[1.0]]))
    series = series_of(lit(BlinnPhong(diffuse=(0.5,) * 3, specular=(0.0,) * 3), n))
    r = reflectance_function(series, 0, 0)
    np.testing.assert_allclose(r.values, 0.5 / np.pi * (WI @ n[0, 0]), rtol=1e-5)
    theta, phi, lamps = on_grid(series)
    np.testing.assert_allclose(theta, np.radians([15, 30, 45, 60]), atol=1e-6)
    np.testing.assert_allclose(r.theta[lamps], np.broadcast_to(theta[:, None], lamps.shape), atol=1e-6)
    np.testing.assert_allclose(r.phi[lamps], np.broadcast_to(phi, lamps.shape), atol=1e-6)
    with pytest.raises(BrightfieldError, match="got row 1"):
        reflectance_function(series, 1, 0)

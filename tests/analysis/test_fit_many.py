"""Fits at every pixel at once: against SciPy's solver, against the truth, and where samples are missing."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from analysis.fit.lafortune_pixels import fit_lafortune_pixels
from analysis.fit.many import Free, fit_many
from interchange.brdf.lafortune import Lafortune
from interchange.brdf.ward import Ward
from interchange.problems import BrightfieldError

POLAR, AZIMUTH = np.radians([12, 24, 36, 48, 60, 72]), np.arange(24) * 2 * np.pi / 24
WI = np.array([[np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)] for t in POLAR for a in AZIMUTH])
WO = np.array([0.0, 0.0, 1.0])


def lobes(rng, count):
    """(C_z, k_d, n) of lobes that at least two rings of lamps can see."""
    n = np.exp(rng.uniform(np.log(1.5), np.log(40), count))
    return np.stack(
        [np.exp(rng.uniform(np.log(0.2), np.log(3), count)) ** (1 / n), rng.uniform(0.1, 0.8, count), n], -1
    )


def series(x, wi=WI, wo=WO):
    """(L, 1, M) reflectance of lobes by the catalogue's own evaluation."""
    return np.stack(
        [
            Lafortune(diffuse=k_d, weight=[1.0], C=[(-1, -1, c_z)], n=[n]).evaluate(wi, wo)[..., 0]
            for c_z, k_d, n in x
        ],
        axis=-1,
    )[:, None]


def test_truth_comes_back_exactly_without_noise():
    x = lobes(np.random.default_rng(1), 60)
    fits = fit_lafortune_pixels(series(x), WI, WO)
    assert fits.converged.all()
    assert fits.x == pytest.approx(x, rel=1e-5)


def test_the_minimum_is_scipys():
    """From SciPy's own start, at tight tolerances; a lower cost would be a better minimum."""
    rng = np.random.default_rng(2)
    x = lobes(rng, 30)
    y = series(x)
    y = y * (1 + 0.03 * rng.normal(size=y.shape))
    fits = fit_lafortune_pixels(y, WI, WO)
    for i in range(len(x)):
        other = least_squares(
            lambda p, i=i: p[1] / np.pi + np.maximum(p[0] * WI[:, 2], 0) ** p[2] - y[:, 0, i],
            [1.0, 0.3, 5.0],
            bounds=([0, 0, 0.05], [2, np.pi, 1e4]),
            x_scale="jac",
            ftol=1e-13,
            xtol=1e-13,
            gtol=1e-13,
        )
        assert fits.cost[i] <= 2 * other.cost * (1 + 1e-6)


def test_sigma_is_the_scatter_of_repeated_fits():
    """400 repeats of one pixel: a standard deviation of them is known to 1 / sqrt(800) = 3.5 %; four of that."""
    rng = np.random.default_rng(3)
    y = np.repeat(series(np.array([[0.98, 0.4, 12.0]])), 400, axis=2)
    fits = fit_lafortune_pixels(y + 0.003 * rng.normal(size=y.shape), WI, WO)
    assert fits.x.std(axis=0) == pytest.approx(np.median(fits.sigma, axis=0), rel=0.15)


def test_turned_surfaces_are_fitted_in_their_own_frames():
    rng = np.random.default_rng(4)
    x = lobes(rng, 20)
    tilt = rng.uniform(-0.5, 0.5, (20, 2))
    normal = np.concatenate([tilt, np.ones((20, 1))], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    tangent = np.cross([0.0, 1.0, 0.0], normal)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    frames = np.stack([tangent, np.cross(normal, tangent), normal], axis=1)
    y = np.concatenate([series(x[i : i + 1], WI @ frames[i].T, frames[i] @ WO) for i in range(20)], axis=2)
    fits = fit_lafortune_pixels(y, WI, WO, frames[None])
    assert fits.samples.min() < 144  # some lamps stand below some of the surfaces
    assert fits.x == pytest.approx(x, rel=1e-4)


def test_what_is_missing_is_left_out_and_too_little_is_no_number():
    x = lobes(np.random.default_rng(5), 4)
    y = series(x)
    y[10:100, 0, 1] = np.nan
    y[2:, 0, 2] = np.nan
    weight = np.ones_like(y)
    y[:24, 0, 3], weight[:24, 0, 3] = 7.0, 0.0  # a ring of saturated pixels
    fits = fit_lafortune_pixels(y, WI, WO, weight=weight)
    assert fits.samples.tolist() == [144, 54, 2, 120]
    assert fits.x[[0, 1, 3]] == pytest.approx(x[[0, 1, 3]], rel=1e-5)
    assert np.isnan(fits.x[2]).all()


def test_a_parameter_that_nothing_tells_has_no_sigma():
    """Without a lobe its exponent is anything."""
    flat = np.full((144, 1, 1), 0.2)
    fits = fit_lafortune_pixels(flat + 1e-4 * np.random.default_rng(6).normal(size=flat.shape), WI, WO)
    assert fits.sigma[0, 2] > fits.x[0, 2]


def test_any_model_of_the_catalogue_can_be_fitted():
    model = Ward()
    slots = model.slots()

    def formula(x, wi, wo):
        numbers = list(model.flat())
        numbers[slots["diffuse"][0]], numbers[slots["specular"][0]], numbers[slots["alpha"][0]] = x
        return model.bind(numbers, 0).f(wi, wo)

    truth = np.array([0.3, 0.1, 0.15])
    numbers = list(model.flat())
    for name, value in zip(("diffuse", "specular", "alpha"), truth, strict=True):
        for i in slots[name]:
            numbers[i] = value
    wo = np.array([np.sin(0.3), 0, np.cos(0.3)])
    y = model.with_flat(numbers).evaluate(WI, wo)[None, :, 0]
    free = (
        Free("diffuse", 0, 1, linear=True),
        Free("specular", 0, 1, (0.05, 0.3)),
        Free("alpha", 0.02, 1, (0.1, 0.3)),
    )
    assert fit_many(formula, free, y, WI, wo).x[0] == pytest.approx(truth, rel=1e-5)


def test_shapes_that_disagree_are_one_error():
    with pytest.raises(BrightfieldError, match="one direction a light"):
        fit_lafortune_pixels(np.zeros((3, 2, 2)), WI, WO)

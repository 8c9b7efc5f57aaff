"""RX follows the laws of Mahalanobis' distance."""

import numpy as np
import pytest
from scipy.stats import chi2

from analysis.series.anomalies import Law, find_anomalies, threshold
from analysis.series.covariance import Estimator, distances, estimate
from analysis.series.lightings import unit
from analysis.series.scores import detection
from interchange.problems import BrightfieldError
from interchange.series import Series

rng = np.random.default_rng(7)
L = 12
MIX = np.eye(L) + 0.3 * rng.normal(size=(L, L))
MEAN = 10 + rng.normal(size=L)


def series_of(x, height):
    """(L, N) samples as a series of ``height`` rows."""
    angles = np.stack([np.linspace(0, 6, len(x)), np.full(len(x), 0.5)], axis=-1)
    return Series(x.reshape(len(x), height, -1, 1), unit(angles))


def gaussian(count, seed):
    z = np.random.default_rng(seed).normal(size=(L, count))
    return MEAN[:, None] + MIX @ z


def test_the_distance_is_equation_6():
    x = gaussian(400, 0)
    found = find_anomalies(series_of(x, 20))
    x = x.astype(np.float32).astype(float)
    d = x - x.mean(axis=1, keepdims=True)
    delta = np.einsum("ln,lk,kn->n", d, np.linalg.inv(np.cov(x)), d)
    np.testing.assert_allclose(found.delta.ravel(), delta, rtol=2e-4)  # single precision, condition of C
    np.testing.assert_allclose(delta.sum(), (400 - 1) * L)  # trace of the hat matrix


@pytest.mark.parametrize("gamma", [0.5, 0.9, 0.95, 0.99])
def test_the_share_below_the_threshold_is_gamma(gamma):
    """χ² for many pixels; 4 standard deviations of a share of 40,000."""
    found = find_anomalies(series_of(gaussian(40000, 1), 200), gamma)
    assert abs((~found.mask).mean() - gamma) < 4 * np.sqrt(gamma * (1 - gamma) / 40000)


def test_the_beta_law_is_exact_for_few_pixels():
    """N = 30 pixels of 12 images: χ²'s threshold is never reached by 1 in 20, the Beta law's is."""
    shares = {law: [] for law in (Law.CHI2, Law.BETA)}
    for seed in range(300):
        delta = find_anomalies(series_of(gaussian(30, 100 + seed), 3)).delta
        for law in shares:
            shares[law].append((delta < threshold(0.95, L, 30, law)).mean())
    assert abs(np.mean(shares[Law.BETA]) - 0.95) < 0.01  # sd 0.0023 of 9000 nearly independent
    assert np.mean(shares[Law.CHI2]) > 0.99


def test_no_linear_change_of_the_images_matters():
    x = gaussian(500, 2)
    a = find_anomalies(series_of(x, 20)).delta
    turn = np.linalg.qr(rng.normal(size=(L, L)))[0] * np.linspace(1, 3, L)
    b = find_anomalies(series_of(turn @ (x - MEAN[:, None]) + 3, 20)).delta
    np.testing.assert_allclose(a, b, rtol=2e-3)  # single precision, condition of C


@pytest.mark.parametrize("estimator", [Estimator.TRIMMED, Estimator.MCD])
def test_robust_covariances_do_not_see_outliers(estimator):
    """15 % of outliers mask themselves from the sample covariance, not from the robust ones."""
    x = gaussian(4000, 3)
    x[:, :600] += (
        6 * np.sqrt(np.diag(MIX @ MIX.T))[:, None] * np.random.default_rng(4).choice([-1, 1], (L, 1))
    )
    truth = np.arange(4000) < 600
    robust = find_anomalies(series_of(x, 40), 0.99, estimator)
    plain = find_anomalies(series_of(x, 40), 0.99)
    assert detection(truth.reshape(40, -1), robust.delta, robust.mask).recall > 0.999
    assert detection(truth.reshape(40, -1), plain.delta, plain.mask).recall < 0.5
    assert abs(robust.mask.ravel()[600:].mean() - 0.01) < 0.02
    ratio = robust.background.covariance / (MIX @ MIX.T)
    assert abs(np.median(np.diag(ratio)) - 1) < 0.1


def test_few_pixels_are_refused_or_regularised():
    x = gaussian(10, 5)
    with pytest.raises(
        BrightfieldError, match=r"12 images need 14 pixels or more .* got 10. Take the estimator shrunk"
    ):
        find_anomalies(series_of(x, 2))
    x[:, 3] += 40 * np.random.default_rng(5).normal(size=L)
    found = find_anomalies(series_of(x, 2), estimator=Estimator.SHRUNK)
    assert 0 < found.background.shrinkage < 1
    assert np.argmax(found.delta) == 3


def test_images_that_repeat_each_other_are_named():
    x = gaussian(300, 6)
    with pytest.raises(BrightfieldError, match="images repeat each other"):
        estimate(np.concatenate([x, x[:1]])).whitening()
    with pytest.raises(BrightfieldError, match="1 do not"):
        find_anomalies(series_of(np.concatenate([x, np.ones((1, 300))]), 10))


def test_a_pixel_that_lacks_samples_is_judged_by_the_others():
    """Its δ has the probability that the marginal distribution gives it."""
    x = gaussian(2000, 8)
    whole = find_anomalies(series_of(x, 40))
    series = series_of(x, 40)
    valid = np.ones(series.images.shape[:3], bool)
    valid[:4, 3, 5] = False
    found = find_anomalies(Series(series.images, series.wi, valid=valid))
    C, mean = found.background.covariance[4:, 4:], found.background.mean[4:]
    d = series.grey[4:, 3, 5] - mean
    expected = chi2.ppf(chi2.cdf(d @ np.linalg.solve(C, d), L - 4), L)
    np.testing.assert_allclose(found.delta[3, 5], expected, rtol=1e-5)
    others = np.ones((40, 50), bool)
    others[3, 5] = False
    np.testing.assert_allclose(found.delta[others], whole.delta[others], rtol=0.05)


def test_small_groups_are_dropped():
    x = np.random.default_rng(9).normal(size=(3, 900))
    x[:, 5] = 30
    block = np.zeros((30, 30), bool)
    block[10:13, 10:13] = True
    x[:, block.ravel()] = -25
    found = find_anomalies(series_of(x, 30), 0.9999, Estimator.TRIMMED, least_area=4)
    assert np.array_equal(found.mask, block)


def test_distances_in_blocks_are_those_of_all_at_once(monkeypatch):
    x = gaussian(1000, 10)
    background = estimate(x)
    whole = distances(x, background)
    monkeypatch.setattr("analysis.series.covariance.BLOCK", 77)
    np.testing.assert_allclose(distances(x, background), whole)
    np.testing.assert_allclose(estimate(x).covariance, background.covariance)


def test_a_score_is_its_definition():
    truth = np.array([[True, True, False, False, False]])
    score = np.array([[3.0, 1.0, 2.0, 1.0, 0.0]])
    found = detection(truth, score, score > 1.5)
    assert (found.precision, found.recall, found.false_alarms) == (0.5, 0.5, 1 / 3)
    assert found.auc == (3 + 1.5) / 6  # pairs won: 3 of 3; 1 and a half of 3

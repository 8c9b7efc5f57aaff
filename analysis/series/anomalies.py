"""Anomalies of a surface: pixels whose reflectance function is unlike the others'.

    δ(x) = (r_x - µ)ᵀ C⁻¹ (r_x - µ)        anomalous where δ > α with P(δ < α) = γ

Reed, Yu: Adaptive multiple-band CFAR detection of an optical pattern with unknown spectral distribution. IEEE Trans.
ASSP 1990; on illumination series Gruna, Irgenfried 2012, Eq. 6. Of a Gaussian background δ follows χ² with as many
degrees of freedom as there are images; where mean and covariance are estimated of the same N pixels, exactly
N δ / (N-1)² follows a Beta law with parameters L/2 and (N-L-1)/2 (Gnanadesikan, Kettenring: Robust estimates,
residuals, and outlier detection with multiresponse data. Biometrics 1972).
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.stats import beta, chi2

from analysis.series.covariance import Background, Estimator, distances, estimate
from interchange.blas import on_all_cores
from interchange.problems import BrightfieldError
from interchange.series import Series


class Law(StrEnum):
    """How the threshold follows from γ."""

    CHI2 = "chi2"
    BETA = "beta"  # of the sample covariance, exact for few pixels
    EMPIRICAL = "empirical"  # the γ quantile of δ itself: always the share 1 - γ of all pixels


@dataclass(frozen=True, eq=False)
class Anomalies:
    """``delta`` (H, W), NaN where a pixel has no sample; ``mask`` (H, W) bool, δ > ``threshold``."""

    delta: np.ndarray
    threshold: float
    mask: np.ndarray
    gamma: float
    background: Background


def find_anomalies(
    series: Series,
    gamma: float = 0.95,
    estimator: Estimator = Estimator.SAMPLE,
    law: Law = Law.CHI2,
    least_area: int = 1,
    region: np.ndarray | None = None,
    rng: np.random.Generator | None = None,
) -> Anomalies:
    """The RX detector on the grey images of ``series``.

    ``least_area``: px; smaller groups of anomalous pixels (8-neighbours) are dropped. ``region`` (H, W): False leaves
    pixels out of background and result. A pixel with samples that are not usable is judged by the others: its δ is
    that of the full number of images with the same probability. Raises BrightfieldError.
    """
    if not 0 < gamma < 1:
        raise BrightfieldError(f"The confidence γ must lie between 0 and 1; got {gamma:g}.")
    law = Law(law)
    height, width = series.shape
    x = series.grey.reshape(len(series), -1)
    usable = series.usable.reshape(len(series), -1)
    inside = np.ones(height * width, bool) if region is None else np.asarray(region, bool).ravel()
    if inside.shape != (height * width,):
        raise BrightfieldError(f"A region must have the images' size, {width} x {height} px.")
    whole = usable.all(axis=0) & inside
    everything = bool(whole.all())
    samples = x if everything else x[:, whole]
    delta = np.full(height * width, np.nan)
    with on_all_cores():
        background = estimate(samples, estimator, rng)
        delta[whole] = distances(samples, background)
    if not everything:
        _partial(delta, x, usable & (inside & ~whole), background)
    alpha = threshold(gamma, len(series), background.used, law, delta)
    mask = np.nan_to_num(delta.reshape(height, width), nan=-1.0) > alpha
    if least_area > 1:
        mask = without_small(mask, least_area)
    return Anomalies(delta.reshape(height, width), alpha, mask, gamma, background)


def threshold(gamma: float, length: int, count: int, law: Law, delta: np.ndarray | None = None) -> float:
    """α with P(δ < α) = γ for ``length`` images and a background of ``count`` pixels."""
    match law:
        case Law.CHI2:
            return float(chi2.ppf(gamma, length))
        case Law.BETA:
            share = beta.ppf(gamma, length / 2, (count - length - 1) / 2)
            return float(share * (count - 1) ** 2 / count)
        case Law.EMPIRICAL:
            if delta is None:
                raise BrightfieldError("The empirical law needs the distances themselves.")
            return float(np.nanquantile(delta, gamma))


def _partial(delta: np.ndarray, x: np.ndarray, usable: np.ndarray, background: Background) -> None:
    """δ of pixels that lack samples, by those they have; pixels that lack the same ones together."""
    some = np.flatnonzero(usable.any(axis=0))
    if not some.size:
        return
    patterns, which = np.unique(usable[:, some], axis=1, return_inverse=True)
    which = np.ravel(which)
    for k in range(patterns.shape[1]):
        rows, columns = np.flatnonzero(patterns[:, k]), some[which == k]
        part = Background(background.mean[rows], background.covariance[np.ix_(rows, rows)], background.used)
        found = distances(np.ascontiguousarray(x[np.ix_(rows, columns)], np.float64), part)
        delta[columns] = chi2.isf(np.maximum(chi2.sf(found, len(rows)), 1e-300), len(x))


def without_small(mask: np.ndarray, least_area: int) -> np.ndarray:
    """(H, W) bool without groups of fewer than ``least_area`` px."""
    import cv2

    _, labels, about, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    large = about[:, cv2.CC_STAT_AREA] >= least_area
    large[0] = False
    return np.asarray(large[labels])

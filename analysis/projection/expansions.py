"""Least squares onto spherical harmonics and Zernike polynomials.

    min_c  sum_n w_n² (f_n - sum_k c_k term_k(wi_n, wo_n))² + smoothness mean_k |w term_k|² sum_k ((n_k + n'_k)² c_k)²

The second sum keeps high orders quiet where nothing was measured (grazing angles, gaps of an instrument); the
constant is never held back, so that a Lambertian surface is one coefficient. What falls below 0 is cut off by the
models, not by the fit.
"""

import numpy as np

from analysis.projection.residual import Projection, prepared, residual, weights
from interchange.brdf.base import Brdf
from interchange.brdf.spherical_harmonics import SphericalHarmonics
from interchange.brdf.zernike import Zernike
from interchange.reflectance import ReflectanceSamples
from interchange.table import Table

SMOOTHNESS = 1e-8


def spherical_harmonics(
    data: ReflectanceSamples | Brdf, degree: int, anisotropic: bool = False, smoothness: float = SMOOTHNESS
) -> Projection[SphericalHarmonics]:
    """``data`` on harmonics up to ``degree``; ``residual`` over the same samples."""
    rows = Table(np.zeros(SphericalHarmonics.count(degree, anisotropic)))
    model = SphericalHarmonics(degree, int(anisotropic), rows)
    samples = prepared(data)
    fitted = SphericalHarmonics(degree, int(anisotropic), Table(_fit(model, samples, smoothness)))
    return Projection(fitted, residual(fitted, samples), len(rows))


def zernike(
    data: ReflectanceSamples | Brdf, order: int, anisotropic: bool = False, smoothness: float = SMOOTHNESS
) -> Projection[Zernike]:
    """``data`` on Zernike polynomials up to ``order``; ``residual`` over the same samples."""
    rows = Table(np.zeros(Zernike.count(order, anisotropic)))
    model = Zernike(order, int(anisotropic), rows)
    samples = prepared(data)
    fitted = Zernike(order, int(anisotropic), Table(_fit(model, samples, smoothness)))
    return Projection(fitted, residual(fitted, samples), len(rows))


def _fit(model: SphericalHarmonics | Zernike, samples: ReflectanceSamples, smoothness: float) -> np.ndarray:
    """(M, 3) coefficients."""
    terms = model.terms(tuple(samples.wi.T), tuple(samples.wo.T))
    design = np.stack([np.broadcast_to(t, len(samples)) for t in terms], axis=1)
    order = np.array([float(a[0] + b[0]) for a, b in model.pairs])
    found = np.empty((len(terms), 3))
    for channel, weight in enumerate(weights(samples).T):
        weighed = design * weight[:, None]
        hold = np.sqrt(smoothness * np.sum(weighed**2, axis=0).mean()) * np.diag(order**2)
        left = np.concatenate([weighed, hold])
        right = np.concatenate([samples.f[:, channel] * weight, np.zeros(len(terms))])
        found[:, channel] = np.linalg.lstsq(left, right, rcond=None)[0]
    return found

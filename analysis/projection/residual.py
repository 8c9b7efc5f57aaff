"""What a representation of reflectance leaves over, and samples to represent.

residual = sqrt(mean (f_model - f)²) / sqrt(mean f²)        a channel, over the usable samples
"""

from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from scipy.stats import qmc

from interchange.brdf.base import Brdf
from interchange.problems import BrightfieldError
from interchange.reflectance import ReflectanceSamples

Model = TypeVar("Model", bound=Brdf)


@dataclass(frozen=True)
class Projection(Generic[Model]):
    """``brdf``: the representation; ``residual`` (3,): its rms error relative to the data's rms; ``numbers``: how many
    numbers a channel it stores."""

    brdf: Model
    residual: np.ndarray
    numbers: int


def residual(brdf: Brdf, samples: ReflectanceSamples, cosine: bool = False) -> np.ndarray:
    """(3,) rms of model less data over rms of data, both times wi.z if ``cosine``. BrightfieldError for black data."""
    samples = prepared(samples)
    scale = samples.wi[:, 2:] if cosine else np.ones((len(samples), 1))
    size = np.sqrt(np.mean((scale * samples.f) ** 2, axis=0))
    if not (size > 0).all():
        raise BrightfieldError(f"A relative residual needs data other than 0 in every channel; got {size}.")
    error = scale * (brdf.evaluate(samples.wi, samples.wo) - samples.f)
    return np.asarray(np.sqrt(np.mean(error**2, axis=0)) / size)


def by_cosine(samples: ReflectanceSamples) -> ReflectanceSamples:
    """The usable samples with ``sigma`` (or 1) over cosine, so that every projection weighs f cos."""
    samples = samples.masked()
    sigma = np.ones_like(samples.f) if samples.sigma is None else samples.sigma
    return replace(samples, sigma=sigma / samples.wi[:, 2:])


def prepared(data: ReflectanceSamples | Brdf, count: int = 4096) -> ReflectanceSamples:
    """The usable samples in three channels; of a model ``count`` of them. Raises BrightfieldError for none, or for
    a number of channels that is neither 1 nor 3 (``ReflectanceSamples.bands`` makes three of a spectrum)."""
    if isinstance(data, Brdf):
        return quadrature(data, count)
    samples = data.masked()
    if not len(samples):
        raise BrightfieldError(f"At least one sample must be usable; got none of {len(data)}. ({data.file})")
    return samples if samples.f.shape[1] == 3 else samples.bands()


def quadrature(brdf: Brdf, count: int = 4096) -> ReflectanceSamples:
    """``brdf`` at ``count`` pairs of directions, even in solid angle over both hemispheres (Sobol points)."""
    u = qmc.Sobol(4, scramble=True, seed=0).random_base2(int(np.ceil(np.log2(max(count, 2)))))[:count]
    wi, wo = (_direction(u[:, k], 2 * np.pi * u[:, k + 1]) for k in (0, 2))
    return ReflectanceSamples(wi, wo, brdf.evaluate(wi, wo), channels=("R", "G", "B"))


def _direction(z: np.ndarray, phi: np.ndarray) -> np.ndarray:
    z = np.maximum(z, 1e-4)
    s = np.sqrt(1 - z * z)
    return np.stack([s * np.cos(phi), s * np.sin(phi), z], axis=-1)


def weights(samples: ReflectanceSamples) -> np.ndarray:
    """(N, 3) 1 / sigma relative to its mean; 1 where sigma is not known."""
    if samples.sigma is None:
        return np.ones_like(samples.f)
    if not (samples.sigma > 0).all():
        raise BrightfieldError(f"Every sigma must be positive to weigh samples by. ({samples.file})")
    inverse = 1.0 / samples.sigma
    return inverse / inverse.mean(axis=0)

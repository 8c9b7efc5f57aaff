"""Principal components of the logarithms of measured materials.

    ln (f + floor) = mean + sum_d c_d component_d

A material is one point: its reflectance at N pairs of directions in three channels. Logarithms keep the highlight
from drowning the rest, and f positive whatever the coefficients. Matusik, Pfister, Brand, McMillan: A data-driven
reflectance model. SIGGRAPH 2003 (there some 45 components span 104 materials).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from interchange.brdf.base import Brdf
from interchange.problems import BrightfieldError
from interchange.reflectance import ReflectanceSamples


@dataclass(frozen=True, eq=False)
class LogBasis:
    """``mean`` (N, 3); ``components`` (D, N, 3), orthonormal over all N x 3; ``variance`` (D,) of the materials along
    each; ``floor`` 1/sr. Directions ``wi``, ``wo`` (N, 3)."""

    wi: np.ndarray
    wo: np.ndarray
    mean: np.ndarray
    components: np.ndarray
    variance: np.ndarray
    floor: float

    def coefficients(self, material: Brdf) -> np.ndarray:
        """(D,) place of a material among the others."""
        value = np.log(material.evaluate(self.wi, self.wo) + self.floor) - self.mean
        return np.einsum("dnc,nc->d", self.components, value)

    def samples(self, coefficients: np.ndarray) -> ReflectanceSamples:
        """The material at a place (D,), for any representation to take on."""
        value = np.exp(self.mean + np.einsum("dnc,d->nc", self.components, coefficients)) - self.floor
        return ReflectanceSamples(self.wi, self.wo, value, channels=("R", "G", "B"))


def log_basis(
    materials: Sequence[Brdf], wi: np.ndarray, wo: np.ndarray, dimensions: int, floor: float = 1e-4
) -> LogBasis:
    """The ``dimensions`` components along which the logarithms of ``materials`` vary most."""
    if not 1 <= dimensions < len(materials):
        raise BrightfieldError(
            f"{len(materials)} materials span 1 to {len(materials) - 1} dimensions; got {dimensions}."
        )
    logs = np.log(np.stack([m.evaluate(wi, wo) for m in materials]) + floor)
    mean = logs.mean(axis=0)
    _, s, vt = np.linalg.svd((logs - mean).reshape(len(materials), -1), full_matrices=False)
    components = vt[:dimensions].reshape(dimensions, *mean.shape)
    return LogBasis(wi, wo, mean, components, s[:dimensions] ** 2 / (len(materials) - 1), floor)

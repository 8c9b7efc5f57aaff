"""An evidence from which hypotheses are told, with some of its causes as wide as effects are: what all hypotheses that
have them have in common is solved for once (Woodbury 1950; the formulas stand in analysis.gap.evidence.likelihood).
"""

import weakref
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from analysis.gap.terms.base import Cause

if TYPE_CHECKING:
    from analysis.gap.evidence.likelihood import Evidence

ROUNDED = 1e-5  # of the largest eigenvalue, that sums of float32 may be off by


class Widened:
    """An evidence whose causes are as wide as ``slabs`` {cause: slab}: ``wide`` (n,), their terms, ``ratio`` times as
    wide as their spikes."""

    def __init__(
        self, evidence: "Evidence", slabs: dict[Cause, float], wide: np.ndarray, ratio: np.ndarray
    ) -> None:
        self.evidence: Evidence = weakref.proxy(evidence)  # which has this one: both go with it
        self.slabs, self.wide = slabs, wide
        self.constant = evidence.constant
        self.gone = np.zeros((0, len(evidence.terms)))  # (Δ⁻¹ + U'CU)⁻¹ U'C
        if len(wide):
            inner = evidence.C[np.ix_(wide, wide)]
            self.gone = np.linalg.solve(np.diag(1 / (ratio**-2 - 1.0)) + inner, evidence.C[wide])
            log_det = np.linalg.slogdet(np.eye(len(wide)) + (ratio**-2 - 1.0)[:, None] * inner)[1]
            self.constant += -0.5 * float(log_det) - float(np.log(ratio).sum())
        self._standing: dict[frozenset[Cause], tuple[np.ndarray, float]] = {}

    def C(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """A part of the covariance in units of spikes."""
        whole = self.evidence.C
        part: np.ndarray = whole[rows[:, None], columns]
        return part - whole[rows[:, None], self.wide] @ self.gone[:, columns] if len(self.wide) else part

    def standing(self, absent: frozenset[Cause]) -> tuple[np.ndarray, float]:
        """C b (q,) and log Z of a hypothesis that lacks ``absent`` of the causes in force."""
        if absent not in self._standing:
            b, z, rr = self.evidence.residual(absent)
            z = z - self.gone.T @ z[self.wide]
            self._standing[absent] = z, self.constant + 0.5 * (float(b @ z) - rr)
        return self._standing[absent]


def woodbury(C: np.ndarray, z: np.ndarray, ratio: np.ndarray) -> tuple[np.ndarray, float]:
    """(I + Δ C)⁻¹ Δ z of terms that are ``ratio`` times as wide as their spikes, and log |I + Δ C|."""
    if not len(z):
        return z, 0.0
    delta = ratio**-2 - 1.0
    inner = delta[:, None] * C
    inner[np.diag_indices(len(z))] += 1.0
    # of many small ones SciPy's wrappers would take more than LAPACK does
    lu, _, solved, wrong = lapack.dgesv(inner, delta * z)
    if wrong:
        raise np.linalg.LinAlgError(f"A matrix of {len(z)} terms must not be singular.")
    return np.asarray(solved), float(np.log(np.abs(lu.diagonal())).sum())


def inverse(A: np.ndarray) -> tuple[np.ndarray, float]:
    """Of I and a matrix whose eigenvalues are 0 or more, and half the logarithm of its determinant; a third of the work
    of solving for every column. What rounding of large eigenvalues takes off small ones is put back."""
    factor, wrong = lapack.dpotrf(A.T, lower=1, clean=1)  # A, as LAPACK lays it out
    if wrong:
        values, vectors = np.linalg.eigh(A)
        if values[0] < -ROUNDED * values[-1]:
            raise np.linalg.LinAlgError(f"A matrix of {len(A)} terms must be positive definite.")
        values = np.maximum(values, 1.0)
        return (vectors / values) @ vectors.T, 0.5 * float(np.log(values).sum())
    half_log_det = float(np.log(factor.diagonal()).sum())
    lower = lapack.dpotri(factor, lower=1, overwrite_c=1)[0]
    whole: np.ndarray = lower + lower.T
    whole[np.diag_indices(len(A))] /= 2
    return whole, half_log_det

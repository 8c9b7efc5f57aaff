"""Mean and covariance of a background that holds outliers, or has few samples.

sample    C = 1/(N-1) sum (x - µ)(x - µ)ᵀ
trimmed   the same over the samples with δ < χ²_L(q), again and again, times the factor that makes it right for
          Gaussian samples: χ²_L's P(χ²_L < q) / P(χ²_{L+2} < q)
mcd       minimum covariance determinant. Rousseeuw, van Driessen: A fast algorithm for the minimum covariance
          determinant estimator. Technometrics 1999
shrunk    (1 - a) S + a tr(S)/L 1, a as it errs least. Ledoit, Wolf: A well-conditioned estimator for
          large-dimensional covariance matrices. J. Multivariate Analysis 2004
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.stats import chi2

from interchange.problems import BrightfieldError

BLOCK = 1 << 14  # samples at a time: a block of 144 of them stays in the cache
MCD_SAMPLES = 4000  # as many as its many subsets are drawn from


class Estimator(StrEnum):
    SAMPLE = "sample"
    TRIMMED = "trimmed"
    MCD = "mcd"
    SHRUNK = "shrunk"


@dataclass(frozen=True, eq=False)
class Background:
    """``mean`` (L,), ``covariance`` (L, L); ``used``: samples that they come from; ``shrinkage`` a of ``shrunk``."""

    mean: np.ndarray
    covariance: np.ndarray
    used: int
    shrinkage: float = 0.0

    def whitening(self) -> np.ndarray:
        """(L, L) lower triangular W with δ = |W (x - µ)|². Raises BrightfieldError where C has no inverse."""
        scale = np.sqrt(np.diag(self.covariance))
        if not (scale > 0).all():
            raise BrightfieldError(
                f"Every image must vary over its pixels; {int((~(scale > 0)).sum())} do not."
            )
        correlation = self.covariance / np.outer(scale, scale)
        least = float(np.linalg.eigvalsh(correlation)[0])
        if least < 1e-8 * len(scale):  # products of single precision leave less than that of what is 0
            raise BrightfieldError(
                f"The covariance of {len(scale)} images must have an inverse; its least eigenvalue is {least:.1e} of a "
                "unit variance: images repeat each other, or pixels are too few. Take the estimator shrunk, or fewer "
                "images."
            )
        from scipy.linalg import solve_triangular

        lower = np.linalg.cholesky(correlation)
        return np.asarray(solve_triangular(lower, np.diag(1 / scale), lower=True))


def estimate(
    x: np.ndarray,
    estimator: Estimator = Estimator.SAMPLE,
    rng: np.random.Generator | None = None,
    quantile: float = 0.9,
    steps: int = 8,
) -> Background:
    """The background of ``x`` (L, N), a sample a column. ``quantile``: of the samples that ``trimmed`` keeps.

    ``rng`` draws the subsets of ``mcd``. Raises BrightfieldError where there are too few samples.
    """
    length, count = x.shape
    estimator = Estimator(estimator)
    if estimator is not Estimator.SHRUNK and count < length + 2:
        raise BrightfieldError(
            f"{length} images need {length + 2} pixels or more for a covariance; got {count}. Take the estimator "
            "shrunk, or fewer images."
        )
    match estimator:
        case Estimator.SAMPLE:
            return moments(x)
        case Estimator.TRIMMED:
            return _trimmed(x, quantile, steps)
        case Estimator.MCD:
            return _mcd(x, rng or np.random.default_rng(0))
        case Estimator.SHRUNK:
            return _shrunk(x)


def moments(x: np.ndarray, keep: np.ndarray | None = None) -> Background:
    """Sample mean and covariance of ``x`` (L, N), of the samples ``keep`` (N,) alone where it is given.

    Block by block in x's own precision, summed up in double; every block is a product of a matrix with its own
    transpose, which takes half of the work.
    """
    length, count = x.shape
    pivot = x[:, :: max(1, count // 1024)].mean(axis=1)  # near the mean: nothing is lost in taking squares
    total, products, used = np.zeros(length), np.zeros((length, length)), 0
    for start in range(0, count, BLOCK):
        block = x[:, start : start + BLOCK]
        if keep is not None:
            block = block[:, keep[start : start + BLOCK]]
        block = block - pivot[:, None]
        total += block.sum(axis=1, dtype=np.float64)
        products += block @ block.T
        used += block.shape[1]
    if used < 2:
        raise BrightfieldError(f"A covariance needs 2 pixels or more; got {used}.")
    mean = total / used
    return Background(pivot + mean, (products - used * np.outer(mean, mean)) / (used - 1), used)


def distances(x: np.ndarray, background: Background) -> np.ndarray:
    """(N,) float32: δ = (x - µ)ᵀ C⁻¹ (x - µ) of every sample of ``x`` (L, N)."""
    from scipy.linalg.blas import dtrmm, strmm

    w = background.whitening()
    single = x.dtype == np.float32
    kind = np.float32 if single else np.float64
    multiply = strmm if single else dtrmm
    w, mean = np.asfortranarray(w, kind), background.mean.astype(kind)
    out = np.empty(x.shape[1], kind)
    for start in range(0, x.shape[1], BLOCK):
        # the block's transpose is in Fortran's order, so that nothing is copied: (x - µ)ᵀ Wᵀ
        block = (x[:, start : start + BLOCK] - mean[:, None]).T
        y = multiply(1.0, w, block, side=1, lower=1, trans_a=1, overwrite_b=1)
        out[start : start + BLOCK] = np.einsum("nl,nl->n", y, y)
    return out


def _trimmed(x: np.ndarray, quantile: float, steps: int) -> Background:
    length = len(x)
    limit = float(chi2.ppf(quantile, length))
    factor = float(quantile / chi2.cdf(limit, length + 2))
    found = moments(x)
    before = np.zeros(x.shape[1], bool)
    for _ in range(steps):
        delta = distances(x, found)
        # a background that is not quite Gaussian keeps its best samples all the same
        keep = delta <= max(limit, float(np.quantile(delta, 0.5)))
        if np.array_equal(keep, before):
            break
        before, inner = keep, moments(x, keep)
        found = Background(inner.mean, inner.covariance * factor, inner.used)
    return found


def _mcd(x: np.ndarray, rng: np.random.Generator) -> Background:
    from sklearn.covariance import MinCovDet

    chosen = x if x.shape[1] <= MCD_SAMPLES else x[:, rng.choice(x.shape[1], MCD_SAMPLES, replace=False)]
    if chosen.shape[1] < 2 * len(x):
        raise BrightfieldError(
            f"The minimum covariance determinant of {len(x)} images needs {2 * len(x)} pixels or more; got "
            f"{chosen.shape[1]}. Take the estimator shrunk."
        )
    seed = int(rng.integers(0, 1 << 31))
    found = MinCovDet(random_state=seed).fit(np.asarray(chosen.T, np.float64))
    return Background(found.location_, found.covariance_, int(found.support_.sum()))


def _shrunk(x: np.ndarray) -> Background:
    from sklearn.covariance import ledoit_wolf

    samples = np.asarray(x.T, np.float64)
    mean = samples.mean(axis=0)
    scale = samples.std(axis=0)
    if not (scale > 0).all():
        raise BrightfieldError(f"Every image must vary over its pixels; {int((scale == 0).sum())} do not.")
    # towards equal variances: images of all brightnesses count alike
    covariance, a = ledoit_wolf((samples - mean) / scale, assume_centered=True)
    return Background(mean, covariance * np.outer(scale, scale), samples.shape[0], float(a))

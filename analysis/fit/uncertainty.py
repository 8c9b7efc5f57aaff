"""How well a fit's parameters are known: covariance, intervals, and what the samples do not tell.

    cov = (JᵀJ)⁻¹ (Σ_n s_n s_nᵀ) (JᵀJ)⁻¹,    s_n = Σ_k J_nk r_nk / (1 - h_nk)

the sandwich of White 1980 in MacKinnon and White's form for small numbers (HC3, 1985), the channels of a sample taken
together; noise may differ from sample to sample. With σ known, the middle is Jᵀ diag((∂r/∂f σ)²) J instead; without it
the interval of unknown k is Student's, with as many degrees of freedom as samples carry its variance,

    ν_k = 3 (Σ_n c_nk²)² / Σ_n c_nk⁴ - 2,    c_n = (JᵀJ)⁻¹ s_n

(Satterthwaite 1946 with fourth moments: ν equal normal shares give ν). Relative differences enter with the weights of
the fit, J and r of (f - y) / sqrt(V(f)): the same gradient, and JᵀJ its mean. Intervals
are taken in the unknowns' scale and carried over, so those of an exponent or a width are not symmetric and stay
positive. A parameter at its bound is held there and has no interval; nor has one along a direction in which the samples
do not change: its σ is infinite.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from analysis.fit.solve import Problem, Solution, predict, residuals
from analysis.fit.unknowns import Unknown
from analysis.fit.weighting import knows_sigma

NEAR = 1e-6  # of the range: at the bound
SINGULAR = 1e-7  # of the largest singular value of the scaled Jacobian
LEVEL = 0.975  # two sides of 95 %


@dataclass(frozen=True)
class Estimate:
    """One parameter: ``sigma`` in its own unit (linearised), the 95 % interval, and ``bound`` "low", "high" or ""."""

    name: str
    value: float
    sigma: float
    low: float
    high: float
    bound: str = ""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """``covariance``, ``correlation`` (P, P) in the unknowns' scale; NaN rows for what has no interval."""

    estimates: tuple[Estimate, ...]
    covariance: np.ndarray
    correlation: np.ndarray
    warnings: tuple[str, ...]


def uncertainty(solution: Solution, problem: Problem) -> Uncertainty:
    chart, x = solution.chart, solution.x
    count = len(x)
    low, high = chart.bounds
    span = np.where(np.isfinite(high - low), high - low, 1.0)
    below, above = x - low < NEAR * span, high - x < NEAR * span
    sides = ["low" if a else "high" if b else "" for a, b in zip(below, above, strict=True)]
    free = np.array([side == "" for side in sides], bool)
    covariance, freedom = np.full((count, count), np.nan), np.full(count, np.inf)
    warnings: list[str] = []
    if free.any():
        covariance[np.ix_(free, free)], freedom[free] = _sandwich(
            frozen(solution, problem), problem, free, chart.unknowns, warnings
        )
    sigma, reach = np.sqrt(np.diag(covariance)), student.ppf(LEVEL, freedom)
    with np.errstate(all="ignore"):
        correlation = covariance / np.outer(sigma, sigma)
    values = chart.values(x)
    estimates, vague = [], []
    for k, u in enumerate(chart.unknowns):
        s, slope = sigma[k], float(u.scale.slope(values[k]))
        if sides[k]:
            estimates.append(Estimate(u.name, values[k], float("nan"), values[k], values[k], sides[k]))
        elif not np.isfinite(s):
            estimates.append(Estimate(u.name, values[k], np.inf, u.low, u.high))
        else:
            ends = np.clip([x[k] - reach[k] * s, x[k] + reach[k] * s], low[k], high[k])
            a, b = (float(u.scale.back(e)) for e in ends)
            estimates.append(Estimate(u.name, values[k], s * slope, a, b))
            if s * slope > abs(values[k]):
                vague.append(u.name)
    for end in ("low", "high"):
        names = [f"{e.name} ({e.value:g})" for e in estimates if e.bound == end]
        if names:
            warnings.append(
                f"At the {'lower' if end == 'low' else 'upper'} bound of the model: {', '.join(names)}."
            )
    if vague:
        warnings.append(f"Not identified, the standard deviation exceeds the value: {', '.join(vague)}.")
    warnings += _pairs(correlation, chart.unknowns)
    return Uncertainty(tuple(estimates), covariance, correlation, tuple(warnings))


def frozen(solution: Solution, problem: Problem) -> Solution:
    """The same solution with the weights of relative differences as they are at it."""
    if not problem.weighting.deviance:
        return solution
    f, _ = predict(solution.chart, solution.x, problem.samples)
    plain = replace(problem, weighting=problem.weighting.frozen(f))
    r, j = residuals(solution.chart, solution.x, plain)
    return replace(solution, residual=r, jacobian=j)


def _sandwich(
    solution: Solution, problem: Problem, free: np.ndarray, unknowns: tuple[Unknown, ...], warnings: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of the free unknowns, NaN for those that the samples do not tell, and degrees of freedom of each."""
    j = np.moveaxis(solution.jacobian[..., free], 0, 1)  # (N, K, P)
    rows = j.reshape(-1, j.shape[-1])
    size = np.linalg.norm(rows, axis=0)
    size = np.where(size > 0, size, 1.0)
    left, values, right = np.linalg.svd(rows / size, full_matrices=False)
    told = values > SINGULAR * max(values[0], 1e-300)
    names = [u.name for u, f in zip(unknowns, free, strict=True) if f]
    lost: set[int] = set()
    for direction in right[~told]:
        share = np.flatnonzero(np.abs(direction) > 0.1)
        lost |= set(map(int, share))
        what = " and ".join(names[i] for i in share)
        warnings.append(f"The samples do not tell {what}{' apart' if len(share) > 1 else ''}.")
    inverse = (right[told].T / values[told]) / size[:, None]  # (P, R)
    if known := knows_sigma(problem.samples):
        f, _ = predict(solution.chart, solution.x, problem.samples)
        noise = problem.weighting.slope(f) * np.asarray(problem.samples.sigma)
        score = left[:, told] * noise.reshape(
            -1, 1
        )  # channels' noise is independent, as σ is given one by one
    else:
        leverage = np.sum(np.square(left[:, told]), axis=1)
        r = solution.residual.T.ravel() / np.clip(1.0 - leverage, 1e-3, None)
        score = (left[:, told] * r[:, None]).reshape(j.shape[0], j.shape[1], -1).sum(axis=1)
    parts = score @ inverse.T  # (N, P)
    covariance = parts.T @ parts
    freedom = np.full(len(names), np.inf) if known else carriers(parts)
    found = np.array(sorted(lost), int)
    covariance[found] = np.nan
    covariance[:, found] = np.nan
    return covariance, freedom


def carriers(parts: np.ndarray) -> np.ndarray:
    """Degrees of freedom (P,) of Σ_n c_nk², ``parts`` c (N, P): as many as readings of one size would have."""
    squares = np.square(parts)
    fourth = np.maximum(np.square(squares).sum(axis=0), 1e-300)
    return np.asarray(np.maximum(3 * np.square(squares.sum(axis=0)) / fourth - 2, 1.0))


def _pairs(
    correlation: np.ndarray, unknowns: tuple[Unknown, ...], limit: float = 0.98, most: int = 3
) -> list[str]:
    """The strongest correlations between parameters; the channels of one colour share their noise and do not count."""
    found = []
    for a, first in enumerate(unknowns):
        for b, second in enumerate(unknowns[:a]):
            same = first.color and second.color and first.name.split(".")[0] == second.name.split(".")[0]
            if not same and abs(correlation[a, b]) > limit:
                found.append(
                    (abs(correlation[a, b]), f"{second.name} with {first.name} ({correlation[a, b]:+.3f})")
                )
    found.sort(reverse=True)
    more = f" and {len(found) - most} more pairs" if len(found) > most else ""
    pairs = ", ".join(text for _, text in found[:most])
    return [f"One makes up for the other (correlation): {pairs}{more}."] if found else []

"""One least-squares problem: unknowns of a model against samples, by SciPy's trust region with bounds.

    minimise  sum r(f(x), f_measured)²,   low <= x <= high

Residuals and Jacobian come from one pass of the model's formula over dual numbers. Branch, Coleman, Li: A subspace,
interior, and conjugate gradient method for large-scale bound-constrained minimization problems. SISC 1999; columns are
scaled as in Moré's Levenberg-Marquardt (1978).
"""

import time
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from analysis.fit.unknowns import Chart
from analysis.fit.weighting import Weighting
from interchange.dual import derivatives
from interchange.parameter import Kind, parameters
from interchange.reflectance import ReflectanceSamples

HUGE = 1e9  # stands for a residual that is not finite, so that the step is refused


class TimeUp(Exception):
    """The deadline passed before any fit was done."""


@dataclass(frozen=True, eq=False)
class Problem:
    """``f`` (N, K) of ``samples`` is fitted in the chart's channels: column k of ``f`` is ``chart.channels[k]``."""

    samples: ReflectanceSamples
    weighting: Weighting
    deadline: float = np.inf  # of time.monotonic()

    def take(self, rows: np.ndarray) -> "Problem":
        return Problem(self.samples.take(rows), self.weighting.take(rows), self.deadline)


@dataclass(frozen=True, eq=False)
class Solution:
    chart: Chart
    x: np.ndarray  # (P,)
    cost: float  # half the sum of squares
    residual: np.ndarray  # (K, N)
    jacobian: np.ndarray  # (K, N, P)
    finished: bool  # within tolerance, not at the deadline or the limit of steps


def predict(chart: Chart, x: np.ndarray, samples: ReflectanceSamples) -> tuple[np.ndarray, np.ndarray]:
    """``f`` (N, K) and its derivatives (K, N, P) by the unknowns."""
    brdf = chart.brdf(x)
    steps = np.array([u.scale.slope(v) for u, v in zip(chart.unknowns, chart.values(x), strict=True)], float)
    count = len(samples)
    f = np.empty((count, len(chart.channels)))
    jacobian = np.zeros((len(chart.channels), count, len(chart.unknowns)))
    for k, channel in enumerate(chart.channels):
        places, owners = chart.active[channel]
        f[:, k], slopes = derivatives(brdf, samples.wi, samples.wo, channel, places)
        for owner, slope in zip(owners, slopes, strict=True):
            jacobian[k, :, owner] += slope
    return f, jacobian * steps


def residuals(chart: Chart, x: np.ndarray, problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Weighted residuals (K, N) and Jacobian (K, N, P)."""
    f, jacobian = predict(chart, x, problem.samples)
    with np.errstate(all="ignore"):
        r, slope = (a.T for a in problem.weighting.residual(f, problem.samples.f))
        jacobian = jacobian * slope[..., None]
    bad = ~(np.abs(r) < HUGE)
    jacobian[bad | ~np.isfinite(jacobian).all(axis=-1)] = 0.0
    return np.where(bad, HUGE, r), jacobian


def solve(
    chart: Chart, x: np.ndarray, problem: Problem, steps: int = 200, tolerance: float = 1e-9
) -> Solution:
    """The minimum reached from ``x``; at the deadline, the best point so far with ``finished`` False."""
    if not len(chart.unknowns):
        r, j = residuals(chart, x, problem)
        return Solution(chart, x, 0.5 * float(np.sum(r * r)), r, j, True)
    best: list[tuple[float, np.ndarray]] = []
    kept: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def both(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        key = at.tobytes()
        if key not in kept:
            if time.monotonic() > problem.deadline and best:
                raise TimeUp
            kept.clear()
            kept[key] = residuals(chart, at, problem)
            cost = 0.5 * float(np.sum(np.square(kept[key][0])))
            if not best or cost < best[0][0]:
                best[:] = [(cost, at.copy())]
        return kept[key]

    low, high = chart.bounds
    x = np.clip(x, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
    try:
        found = least_squares(
            lambda at: both(at)[0].ravel(),
            x,
            jac=lambda at: both(at)[1].reshape(-1, len(x)),
            bounds=(low, high),
            x_scale="jac",
            ftol=tolerance,
            xtol=tolerance,
            gtol=1e-14,
            max_nfev=steps,
        )
        finished = found.status > 0
    except TimeUp:
        finished = False
    x = best[0][1]
    r, j = residuals(chart, x, problem)
    return Solution(chart, x, best[0][0], r, j, finished)


def linear_unknowns(chart: Chart, samples: ReflectanceSamples) -> np.ndarray:
    """(P,) bool: unknowns of colours in which, together, ``f`` is a straight line plus a constant.

    Found from the model's own derivatives: they must not change when those unknowns do.
    """
    about = parameters(chart.template)
    linear = np.zeros(len(chart.unknowns), bool)
    few = samples.take(np.linspace(0, len(samples) - 1, min(len(samples), 60)).astype(int))
    x = chart.start()
    low, high = chart.bounds
    for name, p in about.items():
        trial = linear | np.array([u.name.split("[")[0].split(".")[0] == name for u in chart.unknowns], bool)
        if p.kind is not Kind.COLOR or (trial == linear).all():
            continue
        if any(u.scale.value != "linear" for u, t in zip(chart.unknowns, trial, strict=True) if t):
            continue
        slopes = []
        for share in (0.1, 0.23):
            at = np.where(trial, low + share * (high - low), x)
            slopes.append(predict(chart, at, few)[1][..., trial])
        one, other = slopes
        if np.allclose(one, other, rtol=1e-7, atol=1e-9 * np.abs(one).max()):
            linear = trial
    return linear


def with_best_colors(chart: Chart, x: np.ndarray, linear: np.ndarray, problem: Problem) -> np.ndarray:
    """``x`` with its linear unknowns at the weighted least squares given the others (Golub, Pereyra 1973), in bounds.

    Relative differences and those of logarithms are weighted at the measured values.
    """
    if not linear.any():
        return x
    low, high = chart.bounds
    zero = np.where(linear, np.clip(0.0, low, high), x)
    f, slopes = predict(chart, zero, problem.samples)
    factor = problem.weighting.slope(problem.samples.f)
    a = (slopes[..., linear] * factor.T[..., None]).reshape(-1, int(linear.sum()))
    b = ((problem.samples.f - f) * factor).T.ravel()
    good = np.isfinite(a).all(axis=1) & np.isfinite(b)
    size = np.linalg.norm(a[good], axis=0)
    size = np.where((size > 0) & np.isfinite(size), size, 1.0)
    span = (low[linear] - zero[linear]) * size, (high[linear] - zero[linear]) * size
    found = lsq_linear(a[good] / size, b[good], bounds=span, method="bvls", max_iter=50)
    out = zero.copy()
    out[linear] += found.x / size
    return np.clip(out, low, high)

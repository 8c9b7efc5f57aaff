"""Fit one formula to very many small sets of samples at once: a BRDF's parameters at every pixel.

    minimise  sum_l w_l (f(x; wi_l, wo_l) - y_l)^2   over  low <= x <= high,   for every pixel alone

Levenberg-Marquardt with Marquardt's scaling; a parameter at its bound whose gradient points outward rests. The formula
and its Jacobian are traced from the catalogue's NumPy text (interchange.shader, interchange.dual) and compiled once;
pixels run in parallel. Starts are the best of a list of candidates, one parameter in which the formula is linear being
solved for in closed form.
"""

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numba
import numpy as np

from interchange.dual import Dual
from interchange.problems import BrightfieldError
from interchange.shader import PYTHON, Body, Traced, spell

Formula = Callable[[Sequence[Any], Any, Any], Any]


@dataclass(frozen=True)
class Free:
    """A parameter to be found. ``candidates``: values to start from; a ``linear`` one starts where it fits best."""

    name: str
    low: float
    high: float
    candidates: tuple[float, ...] = ()
    linear: bool = False


@dataclass(frozen=True, eq=False)
class ManyFits:
    """``x`` (M, P) estimates; ``covariance`` (M, P, P) from the residuals, infinite where the samples do not tell;
    ``cost`` (M,) weighted sum of squared residuals; ``samples`` (M,) how many were used; ``converged``
    (M,) whether a minimum was reached. NaN throughout where there are fewer samples than parameters."""

    names: tuple[str, ...]
    x: np.ndarray
    covariance: np.ndarray
    cost: np.ndarray
    samples: np.ndarray
    converged: np.ndarray

    @property
    def sigma(self) -> np.ndarray:
        """(M, P) standard deviations of ``x``."""
        return np.sqrt(np.einsum("mpp->mp", self.covariance))


def fit_many(
    formula: Formula,
    free: Sequence[Free],
    y: np.ndarray,
    wi: np.ndarray,
    wo: np.ndarray,
    frames: np.ndarray | None = None,
    weight: np.ndarray | None = None,
    starts: np.ndarray | None = None,
) -> ManyFits:
    """Fit ``formula(x, wi, wo)`` to ``y`` (M, L), M pixels of L samples.

    ``wi`` (L, 3) to the lights and ``wo`` (L, 3) or (3,) to the camera, unit vectors: in the shading frame, or, with
    ``frames`` (M, 3, 3) whose rows are each pixel's tangent, bitangent and normal, in the frame of these.
    ``weight`` (M, L), 0 leaves a sample out; NaN in ``y`` and directions below the surface are left out as well.
    ``starts`` (K, P) replaces the grid of the candidates. Raises BrightfieldError where shapes disagree.
    """
    y = np.ascontiguousarray(y, np.float64)
    if y.ndim != 2:
        raise BrightfieldError(f"Samples must have shape (pixels, lights); got {y.shape}.")
    m, count = y.shape
    wi, wo = (np.array(np.broadcast_to(w, (count, 3)), np.float64) for w in (wi, wo))
    frames = np.broadcast_to(np.eye(3), (1, 3, 3)) if frames is None else frames
    if frames.shape not in ((1, 3, 3), (m, 3, 3)):
        raise BrightfieldError(f"Frames must have shape ({m}, 3, 3); got {frames.shape}.")
    weight = np.ones((1, 1)) if weight is None else np.asarray(weight, np.float64)
    weight = np.array(np.broadcast_to(weight, (m, count)))
    low, high = (np.array([getattr(p, side) for p in free], np.float64) for side in ("low", "high"))
    linear = next((k for k, p in enumerate(free) if p.linear), -1)
    if starts is None:
        lists = [p.candidates or (0.0,) if p.linear else p.candidates for p in free]
        starts = np.stack(np.meshgrid(*lists, indexing="ij"), axis=-1).reshape(-1, len(free))
    starts = np.clip(np.array(starts, np.float64).reshape(-1, len(free)), low, high)
    model, slope = compiled(formula, len(free))
    frames = np.array(frames, np.float64)
    own = len(frames) == m and m > 1
    grid = np.zeros((1, 1, 2)) if own else _candidates(model, starts, wi, wo, frames[0], linear)
    size = len(free)
    x, covariance, cost = np.full((m, size), np.nan), np.full((m, size, size), np.nan), np.full(m, np.nan)
    used, converged = np.zeros(m, np.int64), np.zeros(m, bool)

    def work(part: slice) -> None:
        _solve(
            model, slope, y[part], wi, wo, frames[part] if own else frames, own, weight[part], starts, grid, low, high,
            linear, x[part], covariance[part], cost[part], used[part], converged[part],
        )  # fmt: skip

    step = max(1, min(4096, -(-m // (os.cpu_count() or 1))))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(work, [slice(k, k + step) for k in range(0, m, step)]))
    return ManyFits(tuple(p.name for p in free), x, covariance, cost, used, converged)


@lru_cache(maxsize=32)
def compiled(formula: Formula, count: int) -> tuple[Any, Any]:
    """``model(x, wi, wo) -> f`` and ``slope(x, wi, wo, gradient) -> f``, compiled from the trace of ``formula``."""
    body = Body(PYTHON)
    x, wi, wo = (
        [Traced(f"{w}[{k}]", body) for k in range(n)] for w, n in (("x", count), ("wi", 3), ("wo", 3))
    )
    value = spell(formula(x, wi, wo))
    model = _function(["def model(x, wi, wo):", *body.lines, f"return {value}"], "model")
    body = Body(PYTHON)
    x, wi, wo = (
        [Traced(f"{w}[{k}]", body) for k in range(n)] for w, n in (("x", count), ("wi", 3), ("wo", 3))
    )
    dual = formula(Dual.variables(x), wi, wo)
    lines = [f"gradient[{k}] = {spell(slope)}" for k, slope in enumerate(dual.partials)]
    text = ["def slope(x, wi, wo, gradient):", *body.lines, *lines, f"return {spell(dual.value)}"]
    return model, _function(text, "slope")


def _function(lines: list[str], name: str) -> Any:
    names: dict[str, Any] = {n: getattr(math, n) for n in dir(math) if not n.startswith("_")}
    names["power"] = _power
    exec("\n    ".join(lines), names)
    return numba.njit(error_model="numpy", nogil=True)(names[name])


@numba.njit(error_model="numpy")
def _power(x: float, n: float) -> float:
    return math.exp(n * math.log(x)) if x > 0.0 else 0.0


@numba.njit(error_model="numpy", nogil=True)
def _solve(
    model: Any,
    slope: Any,
    y: np.ndarray,
    wi: np.ndarray,
    wo: np.ndarray,
    frames: np.ndarray,
    own: bool,
    weight: np.ndarray,
    starts: np.ndarray,
    grid: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    linear: int,
    x_out: np.ndarray,
    covariance_out: np.ndarray,
    cost_out: np.ndarray,
    used_out: np.ndarray,
    converged_out: np.ndarray,
) -> None:
    m, count = y.shape
    size = len(low)
    u, v = np.empty((count, 3)), np.empty((count, 3))
    w, values = np.empty(count), np.empty(count)
    normal = np.empty((size, size))
    for i in range(m):
        frame = frames[i if own else 0]
        used = 0
        for k in range(count):
            _turn(frame, wi[k], u[k])
            _turn(frame, wo[k], v[k])
            w[k], values[k] = weight[i, k], y[i, k]
            if not (values[k] == values[k] and u[k, 2] > 0.0 and v[k, 2] > 0.0 and w[k] > 0.0):
                w[k], values[k] = 0.0, 0.0
            else:
                used += 1
        used_out[i] = used
        if used < size:
            continue
        here = _candidates(model, starts, wi, wo, frame, linear) if own else grid
        x = _start(here, starts, values, w, low, high, linear)
        cost, converged = _descend(slope, x, values, u, v, w, low, high, normal)
        x_out[i], cost_out[i], converged_out[i] = x, cost, converged
        _covariance(normal, cost / max(used - size, 1), covariance_out[i])


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _turn(frame: np.ndarray, w: np.ndarray, out: np.ndarray) -> None:
    for a in range(3):
        out[a] = frame[a, 0] * w[0] + frame[a, 1] * w[1] + frame[a, 2] * w[2]


@numba.njit(error_model="numpy")
def _candidates(
    model: Any, starts: np.ndarray, wi: np.ndarray, wo: np.ndarray, frame: np.ndarray, linear: int
) -> np.ndarray:
    """(K, L, 2): the formula at every candidate, the linear parameter being 0; and what one unit of it adds."""
    out = np.zeros((len(starts), len(wi), 2))
    u, v = np.empty(3), np.empty(3)
    for c in range(len(starts)):
        x = starts[c].copy()
        for k in range(len(wi)):
            _turn(frame, wi[k], u)
            _turn(frame, wo[k], v)
            if u[2] > 0.0 and v[2] > 0.0:
                if linear >= 0:
                    x[linear] = 1.0
                    one = model(x, u, v)
                    x[linear] = 0.0
                    out[c, k, 0] = model(x, u, v)
                    out[c, k, 1] = one - out[c, k, 0]
                else:
                    out[c, k, 0] = model(x, u, v)
    return out


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _start(
    grid: np.ndarray,
    starts: np.ndarray,
    y: np.ndarray,
    w: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    linear: int,
) -> np.ndarray:
    best, chosen, amount = np.inf, 0, 0.0
    for c in range(len(starts)):
        rr, rd, dd = 0.0, 0.0, 0.0
        for k in range(len(y)):
            r, d = y[k] - grid[c, k, 0], grid[c, k, 1]
            rr += w[k] * r * r
            rd += w[k] * r * d
            dd += w[k] * d * d
        a = 0.0
        if linear >= 0 and dd > 0.0:
            a = min(max(rd / dd, low[linear]), high[linear])
        cost = rr - 2.0 * a * rd + a * a * dd
        if cost < best:
            best, chosen, amount = cost, c, a
    x = starts[chosen].copy()
    if linear >= 0:
        x[linear] = amount
    return x


@numba.njit(error_model="numpy")
def _look(
    slope: Any,
    x: np.ndarray,
    y: np.ndarray,
    u: np.ndarray,
    v: np.ndarray,
    w: np.ndarray,
    row: np.ndarray,
    normal: np.ndarray,
    g: np.ndarray,
) -> float:
    """The cost at ``x``, with the lower half of J^T W J and J^T W r."""
    size = len(x)
    total = 0.0
    normal[:] = 0.0
    g[:] = 0.0
    for k in range(len(y)):
        if w[k] > 0.0:
            r = slope(x, u[k], v[k], row) - y[k]
            total += w[k] * r * r
            for a in range(size):
                g[a] += w[k] * row[a] * r
                for b in range(a + 1):
                    normal[a, b] += w[k] * row[a] * row[b]
    return total


@numba.njit(error_model="numpy")
def _descend(
    slope: Any,
    x: np.ndarray,
    y: np.ndarray,
    u: np.ndarray,
    v: np.ndarray,
    w: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    normal: np.ndarray,
) -> tuple[float, bool]:
    """Levenberg-Marquardt from ``x``, which becomes the minimum; ``normal`` becomes J^T W J there."""
    size = len(x)
    g, trial, row, rests = np.empty(size), np.empty(size), np.empty(size), np.zeros(size, np.bool_)
    next_normal, next_g = np.empty((size, size)), np.empty(size)
    cost = _look(slope, x, y, u, v, w, row, normal, g)
    damping, slow = 1e-3, 0
    for _ in range(STEPS):
        gain = 0.0  # what a step in each parameter alone would gain
        for a in range(size):
            outward = (x[a] <= low[a] and g[a] > 0.0) or (x[a] >= high[a] and g[a] < 0.0)
            rests[a] = outward or normal[a, a] <= 0.0
            if not rests[a]:
                gain = max(gain, g[a] * g[a] / normal[a, a])
        if gain <= TOLERANCE * cost:
            return cost, True
        step = _step(normal, g, rests, damping)
        for a in range(size):
            trial[a] = min(max(x[a] + step[a], low[a]), high[a])
        new = _look(slope, trial, y, u, v, w, row, next_normal, next_g)
        if new < cost:
            slow = slow + 1 if cost - new <= SLOW * cost else 0
            x[:], normal[:], g[:] = trial, next_normal, next_g
            cost = new
            damping = max(damping * 0.1, 1e-12)
            if slow == 3:  # a valley so flat that its floor is everywhere as good
                return cost, True
        else:
            damping *= 10.0
            if damping > 1e12:  # no step, however short, leads down: as low as rounding lets see
                return cost, True
    return cost, False


STEPS = 300
TOLERANCE = 1e-12  # of the cost: what is left to gain
SLOW = 1e-8  # of the cost: what a step gained


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _step(normal: np.ndarray, g: np.ndarray, rests: np.ndarray, damping: float) -> np.ndarray:
    """Solve (A + damping diag A) s = -g over the parameters that do not rest, by Cholesky."""
    size = len(g)
    lower, s = np.zeros((size, size)), np.zeros(size)
    for a in range(size):
        if rests[a]:
            lower[a, a] = 1.0
            continue
        for b in range(a + 1):
            if rests[b]:
                continue
            total = normal[a, b] * (1.0 + damping if a == b else 1.0)  # the lower half
            for c in range(b):
                total -= lower[a, c] * lower[b, c]
            if a == b:
                lower[a, a] = math.sqrt(max(total, 1e-30 * normal[a, a]))
            else:
                lower[a, b] = total / lower[b, b]
    for a in range(size):
        total = 0.0 if rests[a] else -g[a]
        for c in range(a):
            total -= lower[a, c] * s[c]
        s[a] = total / lower[a, a]
    for a in range(size - 1, -1, -1):
        total = s[a]
        for c in range(a + 1, size):
            total -= lower[c, a] * s[c]
        s[a] = total / lower[a, a]
    return s


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _covariance(normal: np.ndarray, variance: float, out: np.ndarray) -> None:
    """variance A^-1; infinite for a parameter that nothing depends on, or that others can stand in for (its variance
    grows by more than 1e10 for their sake)."""
    size = len(normal)
    unit, none = np.zeros(size), np.zeros(size, np.bool_)
    for a in range(size):
        none[a] = normal[a, a] <= 0.0
    for a in range(size):
        unit[:] = 0.0
        unit[a] = -1.0
        column = _step(normal, unit, none, 0.0)
        for b in range(size):
            out[a, b] = column[b] * variance
        if none[a] or column[a] * normal[a, a] > 1e10:
            out[a, a] = np.inf

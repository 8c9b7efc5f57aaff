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
from numba import types

from analysis.fit.vector_math import exp, log, power
from interchange.compiled import jit
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
    weight = np.array(np.broadcast_to(weight, (m, count)), order="C")
    low, high = (np.array([getattr(p, side) for p in free], np.float64) for side in ("low", "high"))
    linear = next((k for k, p in enumerate(free) if p.linear), -1)
    if starts is None:
        lists = [p.candidates or (0.0,) if p.linear else p.candidates for p in free]
        starts = np.stack(np.meshgrid(*lists, indexing="ij"), axis=-1).reshape(-1, len(free))
    starts = np.clip(np.array(starts, np.float64).reshape(-1, len(free)), low, high)
    look = compiled(formula, len(free))
    solve, candidates = _kernels()
    frames = np.array(frames, np.float64, order="C")
    own = len(frames) == m and m > 1
    wi, wo = np.ascontiguousarray(wi.T), np.ascontiguousarray(wo.T)
    grid = np.zeros((1, 1, 1))
    if not own:
        u, v = np.empty_like(wi), np.empty_like(wo)
        _turn(frames[0], wi, u)
        _turn(frames[0], wo, v)
        below = (u[2] <= 0) | (v[2] <= 0)
        u[:, below] = v[:, below] = np.array([[0.0], [0.0], [1.0]])
        grid = candidates(look, starts, u, v, linear)
    size = len(free)
    x, covariance, cost = np.full((m, size), np.nan), np.full((m, size, size), np.nan), np.full(m, np.nan)
    used, converged = np.zeros(m, np.int64), np.zeros(m, bool)

    def work(part: slice) -> None:
        solve(
            look, y[part], wi, wo, frames[part] if own else frames, own, weight[part], starts, grid, low, high, linear,
            x[part], covariance[part], cost[part], used[part], converged[part],
        )  # fmt: skip

    step = max(1, min(4096, -(-m // (os.cpu_count() or 1))))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(work, [slice(k, k + step) for k in range(0, m, step)]))
    return ManyFits(tuple(p.name for p in free), x, covariance, cost, used, converged)


SIGNATURE = types.void(
    types.float64[::1], types.float64[:, ::1], types.float64[:, ::1], types.float64[:, ::1]
)
# of every formula, so that what follows is compiled once for all of them
FORMULA = types.FunctionType(SIGNATURE)


@lru_cache(maxsize=32)
def compiled(formula: Formula, count: int) -> Any:
    """``look(x, wi, wo, out)``: the formula at x for all samples, wi and wo (3, L), into out[0], and its derivatives by
    x into out[1:], compiled from the trace of ``formula``."""
    body = Body(PYTHON)
    x = Dual.variables([Traced(f"x{k}", body) for k in range(count)])
    wi, wo = ([Traced(f"{w}[{k}, l]", body) for k in range(3)] for w in ("wi", "wo"))
    dual = formula(x, wi, wo)
    lines = ["def look(x, wi, wo, out):", *(f"    x{k} = x[{k}]" for k in range(count))]
    lines.append("    for l in range(wi.shape[1]):")
    lines += [f"        {line}" for line in body.lines]
    results = [dual.value, *dual.partials]
    lines += [f"        out[{k}, l] = {spell(result)}" for k, result in enumerate(results)]
    names: dict[str, Any] = {n: getattr(math, n) for n in dir(math) if not n.startswith("_")}
    names |= {"log": log, "exp": exp, "power": power}
    exec("\n".join(lines), names)
    return numba.njit(SIGNATURE, error_model="numpy", nogil=True)(names["look"])


_BLOCK = types.float64[:, ::1]
_KERNEL = types.void(
    FORMULA, _BLOCK, _BLOCK, _BLOCK, types.float64[:, :, ::1], types.boolean, _BLOCK, _BLOCK,
    types.float64[:, :, ::1], types.float64[::1], types.float64[::1], types.int64, _BLOCK,
    types.float64[:, :, ::1], types.float64[::1], types.int64[::1], types.boolean[::1],
)  # fmt: skip


def _solve(
    look: Any,
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
    u, v = np.empty((3, count)), np.empty((3, count))
    w, values = np.empty(count), np.empty(count)
    normal, out = np.empty((size, size)), np.empty((size + 1, count))
    for i in range(m):
        _turn(frames[i if own else 0], wi, u)
        _turn(frames[i if own else 0], wo, v)
        used = 0
        for k in range(count):
            w[k], values[k] = weight[i, k], y[i, k]
            if values[k] == values[k] and u[2, k] > 0.0 and v[2, k] > 0.0 and w[k] > 0.0:
                used += 1
            else:  # any direction does, with no weight
                w[k], values[k] = 0.0, 0.0
                u[0, k], u[1, k], u[2, k], v[0, k], v[1, k], v[2, k] = 0.0, 0.0, 1.0, 0.0, 0.0, 1.0
        used_out[i] = used
        if used < size:
            continue
        here = _candidates(look, starts, u, v, linear) if own else grid
        x = _start(here, starts, values, w, low, high, linear)
        cost, converged = _descend(look, x, values, u, v, w, low, high, normal, out)
        x_out[i], cost_out[i], converged_out[i] = x, cost, converged
        _covariance(normal, cost / max(used - size, 1), covariance_out[i])


@jit(error_model="numpy", nogil=True)
def _turn(frame: np.ndarray, w: np.ndarray, out: np.ndarray) -> None:
    """(3, L) directions of the world in a frame."""
    for k in range(w.shape[1]):
        for a in range(3):
            out[a, k] = frame[a, 0] * w[0, k] + frame[a, 1] * w[1, k] + frame[a, 2] * w[2, k]


@numba.njit(error_model="numpy", nogil=True)
def _candidates(look: Any, starts: np.ndarray, u: np.ndarray, v: np.ndarray, linear: int) -> np.ndarray:
    """(K, 2, L): the formula at every candidate, the linear parameter being 0; and what one unit of it adds."""
    found = np.zeros((len(starts), 2, u.shape[1]))
    out = np.empty((starts.shape[1] + 1, u.shape[1]))
    for c in range(len(starts)):
        x = starts[c].copy()
        if linear >= 0:
            x[linear] = 0.0
        look(x, u, v, out)
        found[c, 0] = out[0]
        if linear >= 0:
            found[c, 1] = out[1 + linear]
    return found


@jit(error_model="numpy", nogil=True, fastmath={"reassoc", "contract", "nsz"})
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
            r, d = y[k] - grid[c, 0, k], grid[c, 1, k]
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


@jit(error_model="numpy", nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _sums(y: np.ndarray, w: np.ndarray, out: np.ndarray, normal: np.ndarray, g: np.ndarray) -> float:
    """The cost, with the lower half of J^T W J and J^T W r, of a formula's values and derivatives."""
    total = 0.0
    for k in range(len(y)):
        r = out[0, k] - y[k]
        out[0, k] = w[k] * r
        total += w[k] * r * r
    for a in range(len(g)):
        s = 0.0
        for k in range(len(y)):
            s += out[0, k] * out[a + 1, k]
        g[a] = s
        for b in range(a + 1):
            s = 0.0
            for k in range(len(y)):
                s += w[k] * out[a + 1, k] * out[b + 1, k]
            normal[a, b] = s
    return total


@numba.njit(error_model="numpy", nogil=True)
def _descend(
    look: Any,
    x: np.ndarray,
    y: np.ndarray,
    u: np.ndarray,
    v: np.ndarray,
    w: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    normal: np.ndarray,
    out: np.ndarray,
) -> tuple[float, bool]:
    """Levenberg-Marquardt from ``x``, which becomes the minimum; ``normal`` becomes J^T W J there."""
    size = len(x)
    g, trial, rests = np.empty(size), np.empty(size), np.zeros(size, np.bool_)
    next_normal, next_g = np.empty((size, size)), np.empty(size)
    look(x, u, v, out)
    cost = _sums(y, w, out, normal, g)
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
        look(trial, u, v, out)
        new = _sums(y, w, out, next_normal, next_g)
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
TOLERANCE = 1e-13  # of the cost: what is left to gain
SLOW = 1e-9  # of the cost: what a step gained


@jit(error_model="numpy", nogil=True)
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


@jit(error_model="numpy", nogil=True)
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


@lru_cache(maxsize=1)
def _kernels() -> tuple[Any, Any]:
    """``_solve`` and ``_candidates`` compiled for any formula; kept on disk from one run to the next."""
    solve = jit(_KERNEL, error_model="numpy", nogil=True)(_solve)
    blocks = types.float64[:, :, ::1](FORMULA, _BLOCK, _BLOCK, _BLOCK, types.int64)
    return solve, jit(blocks, error_model="numpy")(_candidates.py_func)

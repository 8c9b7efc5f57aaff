"""Everything that the evidence needs of the pixels: G = X' W X, b = X' W r, r' W r, summed over conditions.

Weights are the inverse of the sensor's variance of a condition's mean, of what the renderer leaves, and of what no
twin gets right:

    1 / w = σ_t² / repeats + σ_fixed² + (Δ² - 1) / 12 + (f_s s)² + (f_g² + SAMPLED² / N^1.5) |∇s|² + (f_0 s̄)²

Δ: DN from one code to the next, where the files lack codes; what rounding to them leaves is alike in all repeats.
Residuals of neighbouring pixels go together over ``BLOCK`` px, so one pixel in BLOCK² counts (tempering).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.terms.base import Term
from analysis.gap.terms.sensitivities import Sensitivities, sensitivities

SIGNAL, GRADIENT, FLOOR = 0.002, 0.025, 0.001  # f_s, f_g px, f_0
# px: an edge's error by N stratified samples a pixel is SAMPLED N^(-3/4). Mitchell, SIGGRAPH 1996
SAMPLED = 0.6
BLOCK = 5
ENOUGH = 5000  # pixels of a condition
SUMMED = 1024  # products that are summed in float32


@dataclass(frozen=True, eq=False)
class Bends:
    """What k causes that are in force change beyond a straight line from nothing, N_c = Δ_c - X_c θ_c: a hypothesis
    without a cause has N_c in its residual besides. ``b`` (k, q): X' W N, ``r`` (k,): N' W r, ``N`` (k, k): N' W N."""

    b: np.ndarray
    r: np.ndarray
    N: np.ndarray

    def __add__(self, other: "Bends") -> "Bends":
        return Bends(self.b + other.b, self.r + other.r, self.N + other.N)


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """``G`` (q, q), ``b`` (q,), ``rr``; ``signal``: s' W s, by which terms are scaled, and ``own`` (q,): that of the
    conditions which show a term; ``log_w``: Σ log w; ``count`` of values. All tempered. ``G`` is float32 of one
    condition (as products of float32 are summed) and float64 of many."""

    G: np.ndarray
    b: np.ndarray
    rr: float
    signal: float
    own: np.ndarray
    log_w: float = 0.0
    count: float = 0.0
    bends: Bends | None = None

    def __add__(self, other: "NormalEquations") -> "NormalEquations":
        return NormalEquations(
            self.G + other.G,
            self.b + other.b,
            self.rr + other.rr,
            self.signal + other.signal,
            self.own + other.own,
            self.log_w + other.log_w,
            self.count + other.count,
            self.bends + other.bends if self.bends is not None and other.bends is not None else None,
        )

    @property
    def share(self) -> np.ndarray:
        """(q,): rms that a unit of each term gives to the image, over the signal's."""
        return np.sqrt(np.maximum(np.diag(self.G), 0) / max(self.signal, 1e-30))

    @property
    def own_share(self) -> np.ndarray:
        """(q,): the same of the conditions alone that show a term."""
        return np.sqrt(np.maximum(np.diag(self.G), 0) / np.maximum(self.own, 1e-30))

    def of(self, index: np.ndarray) -> "NormalEquations":
        """Those of some of the terms."""
        bends = self.bends and replace(self.bends, b=self.bends.b[:, index])
        return replace(
            self, G=self.G[np.ix_(index, index)], b=self.b[index], own=self.own[index], bends=bends
        )


def variance(state: State) -> np.ndarray:
    """(h, w, C): 1 / w."""
    s, e = np.maximum(state.signal, 0), state.simulation
    repeats = len(state.condition.captures)
    dx, dy = state.gradient
    sensor = state.take(e.temporal) / repeats + state.take(e.fixed) + (state.condition.step**2 - 1) / 12
    mean = float(s.mean())
    edge = GRADIENT**2 + (SAMPLED * state.shown.samples**-0.75) ** 2
    return np.asarray(sensor + (SIGNAL * s) ** 2 + edge * (dx**2 + dy**2) + (FLOOR * mean) ** 2, np.float32)


def equations(
    state: State,
    terms: Sequence[Term],
    theta: np.ndarray,
    doubt: np.ndarray | None = None,
    drawn: Sensitivities | None = None,
    bends: Sequence[np.ndarray] = (),
) -> NormalEquations:
    """Of one condition. ``theta`` (q,): where the chain, the flow and the scene of ``state`` stand; terms count from
    zero.

    ``doubt`` (h, w, C) DN²: variance that the forms of effects leave, beside ``variance``. ``drawn``: sensitivities
    that are known. ``bends``: N_c (h, w, C) DN of each cause that is in force (``Bends``).
    """
    mask = state.usable
    if drawn is None:
        drawn = sensitivities(state, terms)
    S, few, many = drawn.cells, drawn.few, drawn.many
    X = np.stack(drawn.columns) if drawn.columns else np.zeros((0, drawn.n), np.float32)
    r = state.residual[mask].reshape(-1).astype(np.float32) + theta[few].astype(np.float32) @ X
    v = variance(state) if doubt is None else variance(state) + doubt
    w = (1.0 / v)[mask].reshape(-1).astype(np.float32)
    s = state.signal[mask].reshape(-1)
    T = BLOCK**2 / state.stride**2
    root = np.sqrt(w / np.float32(T))
    X *= root
    r *= root
    q = len(terms)
    G, b = np.zeros((q, q), np.float32), np.zeros(q)
    G[np.ix_(few, few)] = gram(X)
    b[few] = X @ r
    if S is not None:
        S = sparse.csr_array(S * root[None, :])
        across = np.asarray(S @ X.T)
        G[np.ix_(many, few)], G[np.ix_(few, many)] = across, across.T
        G[np.ix_(many, many)] = (S @ S.T).toarray()
        b[many] = S @ r
    bent = None
    if bends:
        N = np.stack([x[mask].reshape(-1) for x in bends]).astype(np.float32)
        N = N * root
        across = np.zeros((len(N), q))
        across[:, few] = N @ X.T
        if S is not None:
            across[:, many] = np.asarray(S @ N.T).T
        bent = Bends(across, (N @ r).astype(np.float64), (N @ N.T).astype(np.float64))
    signal = float(np.sum(w * s * s, dtype=np.float64)) / T
    return NormalEquations(
        G=G,
        b=b,
        rr=float(np.sum(r * r, dtype=np.float64)),
        signal=signal,
        own=np.where(np.diag(G) > 0, signal, 0.0),
        log_w=float(np.log(w, dtype=np.float64).sum()) / T,
        count=len(w) / T,
        bends=bent,
    )


def gram(X: np.ndarray) -> np.ndarray:
    """X X' (k, k) float64 of float32 (k, n). Products of all n summed in float32 are off by 5e-7 of the largest, which
    takes numbers that hardly show as well known as they are from a matrix that has 1e6 of them."""
    out = np.zeros((len(X), len(X)))
    for first in range(0, X.shape[1], SUMMED):
        part = X[:, first : first + SUMMED]
        out += part @ part.T  # of a matrix and itself transposed BLAS computes a half
    return out


def stride_for(conditions: Sequence[Condition]) -> int:
    """Every so many rows and columns are enough: residuals of neighbours go together anyway."""
    smallest = min(c.mean.shape[0] * c.mean.shape[1] for c in conditions)
    return int(np.clip(round(np.sqrt(smallest / ENOUGH)), 1, BLOCK))


def total_of(parts: Sequence[NormalEquations]) -> NormalEquations:
    """The sum, ``G`` in float64."""
    G = np.zeros(parts[0].G.shape)
    for part in parts:  # in place: each is some 30 MB
        G += part.G
    rest = [replace(part, G=np.zeros((0, 0))) for part in parts]
    total = rest[0]
    for part in rest[1:]:
        total = total + part
    return replace(total, G=G)

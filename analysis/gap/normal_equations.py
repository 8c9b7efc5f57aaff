"""Everything that the evidence needs of the pixels: G = X' W X, b = X' W r, r' W r, summed over conditions.

Weights are the inverse of the sensor's variance of a condition's mean, of what the renderer leaves, and of what no
twin gets right:

    1 / w = σ_t² / repeats + σ_fixed² + (f_s s)² + (f_g² + SAMPLED² / N^1.5) |∇s|² + (f_0 s̄)²

Residuals of neighbouring pixels go together over ``BLOCK`` px, so one pixel in BLOCK² counts (tempering).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.gap.conditions import Condition
from analysis.gap.state import State
from analysis.gap.terms import Term

SIGNAL, GRADIENT, FLOOR = 0.002, 0.03, 0.0015  # f_s, f_g px, f_0
SAMPLED = (
    0.6  # px: an edge's error by N stratified samples a pixel is SAMPLED N^(-3/4). Mitchell, SIGGRAPH 1996
)
BLOCK = 5
STRIDE = 3


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """``G`` (q, q), ``b`` (q,), ``rr``; ``signal``: s' W s, by which terms are scaled. All tempered."""

    G: np.ndarray
    b: np.ndarray
    rr: float
    signal: float

    def __add__(self, other: "NormalEquations") -> "NormalEquations":
        return NormalEquations(
            self.G + other.G, self.b + other.b, self.rr + other.rr, self.signal + other.signal
        )

    @property
    def share(self) -> np.ndarray:
        """(q,): rms that a unit of each term gives to the image, over the signal's."""
        return np.sqrt(np.maximum(np.diag(self.G), 0) / max(self.signal, 1e-30))


def variance(state: State) -> np.ndarray:
    """(h, w, C): 1 / w."""
    s, e = np.maximum(state.signal, 0), state.simulation
    repeats = len(state.condition.captures)
    dx, dy = state.gradient
    sensor = state.take(e.temporal) / repeats + state.take(e.fixed)
    mean = float(s.mean())
    edge = GRADIENT**2 + (SAMPLED * state.shown.samples**-0.75) ** 2
    return np.asarray(sensor + (SIGNAL * s) ** 2 + edge * (dx**2 + dy**2) + (FLOOR * mean) ** 2, np.float32)


def columns(state: State, terms: Sequence[Term]) -> np.ndarray:
    """(q, n) float32: what a unit of each term adds to the ``n`` usable values, row by row of ``state``'s pixels."""
    mask = state.usable
    out = np.zeros((len(terms), int(mask.sum()) * state.condition.mean.shape[2]), np.float32)
    for row, term in zip(out, terms, strict=True):
        column = term.field(state)
        if column is not None:
            row[:] = np.asarray(column)[mask].reshape(-1)
    return out


def equations(state: State, terms: Sequence[Term], theta: np.ndarray) -> NormalEquations:
    """Of one condition. ``theta`` (q,): where the chain and the flow of ``state`` stand; terms count from zero."""
    mask = state.usable
    X = columns(state, terms)
    r = state.residual[mask].reshape(-1).astype(np.float64) + theta @ X
    w = 1.0 / variance(state)[mask].reshape(-1)
    s = state.signal[mask].reshape(-1)
    T = BLOCK**2 / state.stride**2
    XW = X * w
    return NormalEquations(
        G=(XW @ X.T).astype(np.float64) / T,
        b=XW.astype(np.float64) @ r / T,
        rr=float(np.sum(w * r * r)) / T,
        signal=float(np.sum(w * s * s, dtype=np.float64)) / T,
    )


def stride_for(conditions: Sequence[Condition]) -> int:
    """Every so many rows and columns are enough: ``STRIDE``, less for small images."""
    smallest = min(c.mean.shape[0] * c.mean.shape[1] for c in conditions)
    return int(np.clip(np.sqrt(smallest / 8000), 1, STRIDE))

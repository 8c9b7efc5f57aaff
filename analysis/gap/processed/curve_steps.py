"""What captured DN are of the simulated ones, by means of the middle half of ``BINS`` steps of the simulated: a curve
that captures went through is a function of DN alone.

What a lens or a lamp shades moves light along the curve. ``evened`` tells that in turn with the curve: by what the
steps make of captures, their light over the simulated is a smooth field over the image, which all conditions share and
which is 1 in its middle, and a gain of each condition and of each channel, 1 in their mean.

Steps are (x, y), each (BINS,) or fewer: simulated signals over the highest above black, captured DN over the highest.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from scipy.stats import trim_mean

from analysis.gap.compared.conditions import Condition
from analysis.gap.sensor.cut import sigma
from interchange.sensor import Sensor

BINS, LEAST = 32, 50  # steps of the simulated DN, each of as many values; values of one at least
SAMPLES = 5000  # pixels of a condition that tell the field
# of a pixel's signal, that neighbours differ by less: beside an edge light is not what is simulated
EVEN = 0.2
DIM = 6.0  # σ of the dark, below which the mean of a bent curve is not the curve of the mean
ROUNDS = 4  # of field and curve in turn: from the third on γ moves by 0.002
RANGE = 0.1  # of the captures' range, below which light is not told by them
FIELD = 4  # terms: squares and fourth powers of the radius, and a tilt
WIDE = 2.0  # times the median of what is left, from which on a pixel weighs less
Steps = tuple[np.ndarray, np.ndarray]


def steps(own: Sequence[Condition]) -> Steps | None:
    """Of all that is compared; None of too few."""
    x, y = (np.concatenate(parts) for parts in zip(*(_pairs(c) for c in own), strict=True))
    return _middles(x, y) if len(x) >= BINS * LEAST else None


def evened(own: Sequence[Condition]) -> Steps | None:
    """Of pixels away from edges, without what shades them, and of steps above the dark; None of too few."""
    told = [s for k, c in enumerate(own) for s in _samples(c, k, len(own))]
    x, y, by = (np.concatenate(parts) for parts in zip(*told, strict=True))
    if len(x) < BINS * LEAST:
        return None
    by[:, FIELD:] -= by[:, FIELD:].mean(axis=0)
    field = np.zeros(by.shape[1])
    for _ in range(ROUNDS):
        field = _field(x, y, by, _middles(x * np.exp(by @ field), y))
    bins, middles = _middles(x * np.exp(by @ field), y)
    seen = bins > DIM * _dark(own[0].camera.sensor)
    return (bins[seen], middles[seen]) if seen.sum() > BINS // 2 else None


def in_the_dark(own: Sequence[Condition]) -> tuple[float, float] | None:
    """Mean signals simulated and captured of what is no brighter than evened steps leave out; None of too few."""
    pairs = [_pairs(c) for c in own]
    x, y = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    dim = x < DIM * _dark(own[0].camera.sensor)
    return (float(x[dim].mean()), float(y[dim].mean())) if dim.sum() >= LEAST else None


def _dark(sensor: Sensor) -> float:
    """σ of the dark, of signals over the highest."""
    return float(sigma(np.array(sensor.black_level), sensor)) / (2**sensor.bit_depth - 1 - sensor.black_level)


def _field(x: np.ndarray, y: np.ndarray, by: np.ndarray, curve: Steps) -> np.ndarray:
    """Numbers of the logarithm of light over ``x`` that is simulated, where ``y`` follow the curve; robust."""
    light, first = np.unique(curve[0], return_index=True)
    dn = np.maximum.accumulate(curve[1][first]) + 1e-9 * np.arange(len(first))
    told = (y > dn[0] + RANGE * np.ptp(dn)) & (y < dn[-1]) & (x > 0)
    if told.sum() < BINS * LEAST:
        return np.zeros(by.shape[1])
    log = np.log(np.maximum(np.interp(y[told], dn, light), 1e-9) / x[told])
    columns = np.column_stack([by[told], np.ones(int(told.sum()))])  # whose gain is the curve's
    weight = np.ones(len(log))
    for _ in range(ROUNDS):
        solved = np.linalg.lstsq(columns * weight[:, None], log * weight, rcond=None)[0]
        off = np.abs(log - columns @ solved)
        weight = np.sqrt(1 / np.maximum(1, off / (WIDE * np.median(off) + 1e-9)))
    return np.asarray(solved[:-1])


def _samples(c: Condition, place: int, among: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Of each channel signals simulated and captured, (n,), and what shades them, (n, k): the field's terms, then ones
    for its condition and its channel, of which the first have none."""
    simulated = c.simulated()
    signal = np.maximum(simulated.dn - simulated.black, 0)
    around = np.ones((3, 3), np.uint8)
    change = (cv2.dilate(signal, around) - cv2.erode(signal, around)).reshape(signal.shape)
    even = (change < EVEN * signal.max(axis=2, keepdims=True)).all(axis=2)
    rows, columns = np.nonzero(c.compared & even)
    picked = np.random.default_rng(place).permutation(len(rows))[:SAMPLES]
    rows, columns = rows[picked], columns[picked]
    height, width = signal.shape[:2]
    u, v = 2 * columns / width - 1, (2 * rows - height) / width
    r2 = u * u + v * v
    channels = signal.shape[2]
    ones = np.zeros((len(rows), among - 1 + channels - 1))
    if place:
        ones[:, place - 1] = 1
    found = []
    for k in range(channels):
        own = ones.copy()
        if k:
            own[:, among - 2 + k] = 1
        x = signal[rows, columns, k] / (simulated.top - simulated.black)
        found.append((x, c.mean[rows, columns, k] / simulated.top, np.column_stack([r2, r2 * r2, u, v, own])))
    return found


def _middles(x: np.ndarray, y: np.ndarray) -> Steps:
    """Means of the middle half of each step's values: medians of codes are codes."""
    parts = np.array_split(np.argsort(x, kind="stable"), BINS)
    x, y = (np.array([trim_mean(plane[i], 0.25) for i in parts]) for plane in (x, y))
    return x, y


def _pairs(c: Condition) -> tuple[np.ndarray, np.ndarray]:
    """Simulated and captured signals of what is compared."""
    simulated = c.simulated()
    black, ok = simulated.black, c.compared
    x = np.maximum(simulated.dn[ok] - black, 0) / (simulated.top - black)
    return x.reshape(-1), (c.mean[ok] / simulated.top).reshape(-1)

"""Columns and rows of a sensor that are uneven: taken out of captures before effects are sought.

A pattern of columns stays at the same pixels whatever is seen, and no family of the fit is as fine. By columns j, with
s DN above black and r left of the simulation, less its mean over ``BESIDE`` columns,

    r = a_j s + b_j,      weights of the sensor's noise, where no edge is as near

once of the upper half of the rows and once of the lower: what both say is the columns', as pixels' own patterns and
what stands in the scene differ. What the mean takes of a slow pattern is found again by doing so ``TIMES`` times. Rows
alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.noise.fixed_pattern import flat
from analysis.gap.parallel import each
from analysis.gap.terms.base import NUISANCE, Field, Term

# columns that a column is compared with, again and again: 0.9 of a wave of 60 columns is found, 0.03 of one of 480
BESIDE, TIMES = 9, 60
GAINS, OFFSETS = 0.02, 3.0  # standard deviations of a_j and of b_j, DN, beforehand
SURELY = 5.0  # standard errors that both halves' agreement is from nothing
LEAST, SHARE = 0.3, 0.25  # DN rms that is looked at, and over what the data sheet says of pixels
FEWEST = 32  # columns that tell
SLOW = 60.0  # columns of a wave that is not found whole
COLUMNS, ROWS = 1, 0

Planes = tuple[np.ndarray, np.ndarray, np.ndarray]  # s, w and r, lines along the second axis


@dataclass(frozen=True)
class Lines:
    """``rms`` DN of what a camera's columns or rows differ by in its captures, whose pixels have ``signal`` DN."""

    camera: str
    axis: int
    rms: float
    signal: float

    def __str__(self) -> str:
        name = "Columns" if self.axis == COLUMNS else "Rows"
        return (
            f"{name} of {self.camera} are uneven by {self.rms:.2g} DN rms, {100 * self.rms / self.signal:.2g} % of the "
            f"signal, whatever is seen: taken out of the captures before effects are sought, and a part of the fixed "
            f"pattern."
        )


def without_lines(conditions: Sequence[Condition]) -> tuple[list[Condition], tuple[Lines, ...]]:
    """The conditions with such patterns taken out, as those that are not held out show them, and which there were."""
    out, told = list(conditions), []
    for camera in dict.fromkeys(c.camera.name for c in conditions):
        for axis in (COLUMNS, ROWS):
            own = [k for k, c in enumerate(out) if c.camera.name == camera]
            shown = [out[k] for k in own if not out[k].held_out]
            if len({c.mean.shape for c in shown}) != 1:
                continue
            planes = each(partial(_planes, axis=axis), shown)
            halves = np.sum([_sums(x) for x in planes], axis=0)
            signals = np.array([float(np.average(s, weights=w)) for s, w, _ in planes if w.any()])
            if not len(signals):  # edges everywhere
                continue
            sensor = shown[0].camera.sensor
            pixels = np.hypot(sensor.prnu * signals, sensor.dsnu * sensor.K_out)
            rms = _agreed(halves, signals)
            if rms > max(LEAST, SHARE * float(np.sqrt(np.mean(pixels**2)))):
                pattern = _followed(planes)
                for k in own:
                    out[k] = _evened(out[k], pattern, axis, rms)
                told.append(Lines(camera, axis, rms, float(signals.mean())))
    return out, tuple(told)


def _planes(c: Condition, axis: int) -> Planes:
    model = c.simulated()
    s, w = flat(c, model.dn)
    r = (c.mean - model.dn).astype(np.float32)
    if axis == ROWS:
        s, w, r = (np.ascontiguousarray(x.swapaxes(0, 1)) for x in (s, w, r))
    near = np.ones((1, BESIDE), np.uint8)
    there: np.ndarray = np.pad((w.min(axis=2) > 0).astype(np.uint8), BESIDE)  # nothing beyond the image
    clear = cv2.erode(there, near)[BESIDE:-BESIDE, BESIDE:-BESIDE]
    return s, w * clear[..., None], r


def _sums(planes: Planes) -> np.ndarray:
    """(2, 5, n, C): of both halves the sums over each line of w s², w s, w, w s r and w r."""
    s, w, r = planes
    r = r - cv2.blur(r, (BESIDE, 1)).reshape(r.shape)
    sums = np.stack([w * s * s, w * s, w, w * s * r, w * r]).astype(np.float64)
    middle = sums.shape[1] // 2
    return np.stack([sums[:, :middle].sum(axis=1), sums[:, middle:].sum(axis=1)])


def _followed(planes: Sequence[Planes]) -> np.ndarray:
    """(2, n, C): a_j and b_j of all rows together."""
    total: np.ndarray = np.zeros((2, *planes[0][0].shape[1:]))
    for _ in range(TIMES):
        left = [(s, w, (r - total[0] * s - total[1]).astype(np.float32)) for s, w, r in planes]
        total = total + _solved(np.sum([_sums(x) for x in left], axis=(0, 1)))
    return total


def _solved(sums: np.ndarray) -> np.ndarray:
    """(2, n, C): a_j and b_j."""
    a11, a12, a22, b1, b2 = sums
    a11, a22 = a11 + GAINS**-2, a22 + OFFSETS**-2
    return np.stack([a22 * b1 - a12 * b2, a11 * b2 - a12 * b1]) / (a11 * a22 - a12**2)


def _agreed(halves: np.ndarray, signals: np.ndarray) -> float:
    """rms DN over conditions of mean ``signals`` DN that both halves show alike; 0 where all of it may be nothing."""
    told = (halves[:, 2] > 0).all(axis=0)
    if told.sum() < FEWEST:
        return 0.0
    upper, lower = (_solved(x)[:, told] for x in halves)
    at = signals[:, None]
    product = ((upper[0] * at + upper[1]) * (lower[0] * at + lower[1])).mean(axis=0)
    if product.mean() <= SURELY * product.std() / np.sqrt(len(product)):
        return 0.0
    return float(np.sqrt(product.mean() / (1 - 1 / BESIDE)))


def _evened(c: Condition, pattern: np.ndarray, axis: int, rms: float) -> Condition:
    """Without the outermost lines, which have no neighbours on both sides."""
    black, mask, out = c.camera.sensor.black_out, c.mask.copy(), BESIDE // 2
    gain, offset = (x[None] if axis == COLUMNS else x[:, None] for x in pattern)
    lines = mask if axis == ROWS else mask.T
    lines[:out], lines[-out:] = False, False
    mean = (c.mean - black - offset) / (1 + gain) + black
    return replace(c, mean=mean, mask=mask, uneven={**c.uneven, axis: rms})


def left_of_lines(conditions: Sequence[Condition]) -> list[Term]:
    """Of columns that differ by lot, waves so slow that ``BESIDE`` columns do not show them: calibration's, as offsets
    and as gains, an equal part of the variance in each of n waves."""
    terms = []
    for c in {c.camera.name: c for c in conditions}.values():
        signal = max(float(np.mean(c.mean)) - c.camera.sensor.black_out, 1.0)
        for axis, rms in c.uneven.items():
            n = c.mean.shape[axis]
            for order in range(1, min(n, round(2 * n / SLOW)) + 1):
                spike = rms * float(np.sqrt(2 / n))
                for unit, width in (("DN", spike), ("1", spike / signal)):
                    name = f"{'columns' if axis == COLUMNS else 'rows'} {order} {unit}"
                    wave = _wave(c.camera.name, axis, order, n, unit == "DN")
                    terms.append(Term(NUISANCE, c.camera.name, name, unit, width, wave))
    return terms


def _wave(camera: str, axis: int, order: int, n: int, offset: bool) -> Field:
    def field(s: State) -> np.ndarray | None:
        if s.camera.name != camera:
            return None
        wave = np.cos(np.pi * order * (s.grid[0 if axis == COLUMNS else 1] + 0.5) / n)[..., None]
        return np.asarray(wave * (np.ones_like(s.signal) if offset else s.signal), np.float32)

    return field

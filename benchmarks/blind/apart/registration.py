"""Where images lie on the sensor, off what the calibration says. Who writes the diagnosis does not read this folder."""

from dataclasses import dataclass

import numpy as np

from benchmarks.blind.apart.budget import PEAK, Budget

Pair = tuple[np.ndarray, np.ndarray]


def _radial(x: np.ndarray, y: np.ndarray, s: np.ndarray) -> Pair:
    """What a fit of low order leaves: it swings with the radius and is nothing on two rings."""
    r2 = x * x + y * y
    k = (r2 - 0.16 - 0.1 * s[0] ** 2) * (r2 - 0.64 - 0.1 * abs(s[1]))
    return x * k, y * k


def _decentred(x: np.ndarray, y: np.ndarray, s: np.ndarray) -> Pair:
    """A tilted or shifted element."""
    r2, along = x * x + y * y, s[0] * x + s[1] * y
    return s[0] * r2 + 2 * x * along, s[1] * r2 + 2 * y * along


def _target(x: np.ndarray, y: np.ndarray, s: np.ndarray) -> Pair:
    """A calibration target that isn't flat: waves about as long as it is."""
    u = np.sin(2.6 * (s[0] * x + s[1] * y) + 3 * s[2])
    v = np.sin(2.6 * (s[1] * x - s[3] * y) + 3 * s[4])
    return u, v


def _focal(x: np.ndarray, y: np.ndarray, s: np.ndarray) -> Pair:
    """Focal length, the pixels' aspect, and a camera that turned in its clamp."""
    return s[0] * x + s[1] * y, -s[1] * x + (s[0] + 0.5 * s[2]) * y


def _middle(x: np.ndarray, y: np.ndarray, s: np.ndarray) -> Pair:
    return s[0] * np.ones_like(x), s[1] * np.ones_like(y)


KINDS = (_radial, _decentred, _target, _focal, _middle)


@dataclass(frozen=True, eq=False)
class Registration:
    """Of one camera. ``weights`` px of each of KINDS; ``drift``, (shots, 3) px: shift, and growth at the corner."""

    half: float  # px, half the diagonal
    shapes: np.ndarray
    weights: np.ndarray
    drift: np.ndarray

    def __call__(self, shot: int, x: np.ndarray, y: np.ndarray) -> Pair:
        """px from the middle -> px of displacement."""
        u, v = x / self.half, y / self.half
        dx, dy = self.drift[shot, 0] + self.drift[shot, 2] * u, self.drift[shot, 1] + self.drift[shot, 2] * v
        for kind, s, w in zip(KINDS, self.shapes, self.weights, strict=True):
            if w:
                a, b = kind(u, v, s)
                dx, dy = dx + w * a, dy + w * b
        return dx, dy


def grid(size: tuple[int, int]) -> Pair:
    """A few places all over the sensor, px from its middle."""
    x, y = np.meshgrid(*(np.linspace(-n / 2, n / 2, 19) for n in size))
    return x, y


def registration(b: Budget, tolerance: float, size: tuple[int, int], times: np.ndarray) -> Registration:
    """``times`` (shots,) of the series, 0 to 1. Over the sensor and the series the rms per axis is what is drawn."""
    half = float(np.hypot(*size) / 2)
    x, y = grid(size)
    shapes = b.normal(len(KINDS), 5)
    share = b.shares(len(KINDS) + 2)
    weights = np.zeros(len(KINDS))
    for k, kind in enumerate(KINDS):
        a = np.stack(kind(x / half, y / half, shapes[k]))
        weights[k] = tolerance * share[k] / max(float(np.sqrt(np.mean(a**2))), 1e-6)
    warming = (1 - np.exp(-times / b.rng.uniform(0.15, 1.0)))[:, None] * b.normal(3)
    warming -= warming[len(times) // 2]  # it was calibrated somewhere within
    shaking = b.normal(len(times), 3) * [1, 1, 0]
    drift = np.zeros((len(times), 3))
    for w, d in zip(share[-2:], (warming, shaking), strict=True):
        rms = np.sqrt(np.mean(d[:, :2] ** 2 + d[:, 2:] ** 2 / 3))  # a third: mean square over the sensor
        drift += w * tolerance * d / max(float(rms), 1e-6)
    found = Registration(half, shapes, weights, drift)
    worst = max(float(np.abs(d).max()) for k in range(len(times)) for d in found(k, x, y))
    k = max(1.0, worst / (PEAK * b.more * tolerance))
    return Registration(half, shapes, weights / k, drift / k)

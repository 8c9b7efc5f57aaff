"""What noise makes of the mean where a converter cuts it off at DN 0, and where a curve bends.

Of linear DN x ~ N(µ, σ²), σ² = K (µ - black) + K² (σ_d² + DSNU²) + PRNU² (µ - black)², a camera gives
f(max(x, 0)), whose mean is no f(µ). For a line, with u = µ / σ,

    E = σ m(u),  m = u Φ(u) + φ(u);    Var = σ² c(u),  c = u² Φ + u φ + Φ - m²

Otherwise it is told by quadrature, once for every µ; where noise is a few DN wide, by the whole DN that curves are
given, of which a steep one makes more: all below 0.5 is 0. Means over pixels are of light, which codes' noise was cut
off from before. Cameras without a black level to speak of, and pictures that it was taken off from, are brighter in the
dark than their light by 0.4 σ.

Johnson, Kotz, Balakrishnan: Continuous univariate distributions 1, 1994, section 10.1 (censored normal variables).
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.special import ndtr

from analysis.gap.sensor.filters import Averaging
from interchange.camera import Sensor
from interchange.effects.response_curve import ResponseCurve

NEAR = 6.0  # σ of the dark above DN 0, from which on nothing is cut
Z = np.arange(-NEAR, NEAR + 1e-9, 1 / 8)
WEIGHTS = np.exp(-0.5 * Z**2) / np.exp(-0.5 * Z**2).sum()
LEAST = 1e-3  # DN, of σ
BRIGHT = 4096  # nodes of what is bright
FEW = 8.0  # DN of σ, up to which whole DN are told apart: above, rounding is 1e-3 of the variance
WHOLE = np.arange(-NEAR * FEW - 1, NEAR * FEW + 2)
MOST = 2**17  # nodes of an even table: 0.03 DN of 12 bits


@dataclass(frozen=True, eq=False)
class Even:
    """``y`` (n,) of places that are ``step`` apart, from ``first`` on: looked up without a search, which takes three to
    seven times as long."""

    first: float
    step: float
    y: np.ndarray

    @classmethod
    def of(cls, x: np.ndarray, y: np.ndarray) -> "Even":
        """Of rising ``x``, as finely as they are where they are finest, or by ``MOST``."""
        span = float(x[-1] - x[0])
        n = int(min(span / float(np.diff(x).min()), MOST - 1)) + 1
        step = span / n
        return cls(float(x[0]), step, np.interp(x[0] + step * np.arange(n + 1), x, y))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """float64; beyond either end what is there."""
        place = np.clip((np.asarray(x, np.float64) - self.first) / self.step, 0, len(self.y) - 1)
        below = np.minimum(place.astype(np.int32), len(self.y) - 2)
        place -= below
        return np.asarray(self.y[below] + place * self._rise[below])

    @cached_property
    def _rise(self) -> np.ndarray:
        return np.diff(self.y)


def sigma(linear: np.ndarray, sensor: Sensor) -> np.ndarray:
    """Of linear DN with the black level in them, over frames and pixels, DN."""
    signal = np.maximum(linear - sensor.black_level, 0)
    pattern = np.square(sensor.prnu * signal) + (sensor.K * sensor.dsnu) ** 2
    return np.asarray(np.sqrt(sensor.K * signal + (sensor.K * sensor.read_noise) ** 2 + pattern + LEAST**2))


def of_codes(linear: np.ndarray, sensor: Sensor) -> np.ndarray:
    """The same of what is cut off, DN: of the codes, where a sensor's values are means of their light."""
    codes = sensor.codes if isinstance(sensor, Averaging) else 1
    return np.asarray(np.sqrt(codes) * sigma(linear, sensor))


def is_cut(sensor: Sensor) -> bool:
    return bool(sensor.black_level < NEAR * float(of_codes(np.array(sensor.black_level), sensor)))


def mean(linear: np.ndarray, sensor: Sensor, curve: ResponseCurve | None) -> np.ndarray:
    """The mean DN of what a camera makes of ``linear`` DN and their noise."""
    if curve is None:
        return cut(linear, of_codes(linear, sensor)) if is_cut(sensor) else linear
    # of a curve that bends little it is what it makes of their mean
    if not curve.bends_in_the_dark and not is_cut(sensor):
        return curve.output(linear, sensor.bit_depth, sensor.black_level)
    return even(sensor, curve)(linear)


def slope(linear: np.ndarray, sensor: Sensor, curve: ResponseCurve | None) -> np.ndarray:
    """By how much ``mean`` grows with ``linear``, over a DN."""
    above, below = (mean(linear + x, sensor, curve) for x in (0.5, -0.5))
    return np.asarray(above - below)


def cut(linear: np.ndarray, s: np.ndarray) -> np.ndarray:
    u = linear / s
    return np.asarray(linear * ndtr(u) + s * _phi(u))


def kept(u: np.ndarray) -> np.ndarray:
    """c(u): of the variance of x, what is left of it."""
    m = u * ndtr(u) + _phi(u)
    return np.asarray(np.where(u > NEAR, 1.0, u * m + ndtr(u) - m**2))


def seen(u: np.ndarray) -> np.ndarray:
    """Share of frames in which nothing is cut off: by how much the mean follows µ."""
    return np.asarray(ndtr(u))


def level(dn: np.ndarray, sensor: Sensor) -> np.ndarray:
    """Linear DN whose mean is ``dn``, of a camera without a curve; no lower than the black level."""
    if not is_cut(sensor):
        return dn
    x = _levels(sensor)
    return np.interp(dn, cut(x, of_codes(x, sensor)), x)


@lru_cache(maxsize=64)
def table(sensor: Sensor, curve: ResponseCurve) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Linear DN, rising, the mean DN that the camera gives of each, and the standard deviation of these over that of
    the linear ones."""
    x = _levels(sensor)
    if isinstance(sensor, Averaging):
        y, slope = _of_means(x, sensor, curve)
        return x, y, slope
    s = sigma(x, sensor)
    y, variance = _moments(x, s, sensor, curve)
    slope = np.sqrt(variance) / s
    x.flags.writeable = y.flags.writeable = slope.flags.writeable = False
    return x, y, slope


def _moments(
    x: np.ndarray, s: np.ndarray, sensor: Sensor, curve: ResponseCurve
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance, over N(x, s²), of what the curve makes of DN that are whole and no less than 0."""

    def output(dn: np.ndarray) -> np.ndarray:
        return np.maximum(curve.output(dn, sensor.bit_depth, sensor.black_level), 0)

    y, variance = np.empty_like(x), np.empty_like(x)
    few = s < FEW
    codes = np.rint(x[few, None]) + WHOLE
    share = ndtr((codes + 0.5 - x[few, None]) / s[few, None]) - ndtr(
        (codes - 0.5 - x[few, None]) / s[few, None]
    )
    given = output(np.maximum(codes, 0))
    y[few] = (share * given).sum(axis=1)
    variance[few] = (share * np.square(given - y[few, None])).sum(axis=1)
    given = output(np.maximum(x[~few, None] + s[~few, None] * Z, 0))
    y[~few] = given @ WEIGHTS
    variance[~few] = np.square(given - y[~few, None]) @ WEIGHTS
    return y, variance


def _of_means(x: np.ndarray, sensor: Averaging, curve: ResponseCurve) -> tuple[np.ndarray, np.ndarray]:
    """Of means of light: codes are cut off by their own noise, and the curve is of the mean."""
    s = of_codes(x, sensor)
    light = cut(x, s)
    y = np.maximum(curve.output(light, sensor.bit_depth, sensor.black_level), 0)
    return y, np.gradient(y, np.maximum.accumulate(light) + 1e-9 * np.arange(len(x))) * np.sqrt(kept(x / s))


@lru_cache(maxsize=32)  # of 2 MB at most
def even(sensor: Sensor, curve: ResponseCurve) -> Even:
    """The means of ``table``, to look up in."""
    x, y, _ = table(sensor, curve)
    return Even.of(x, y)


@lru_cache(maxsize=32)
def slopes(sensor: Sensor, curve: ResponseCurve) -> Even:
    """By how much noise grows through curve and cut, of linear DN: where a curve is steep over less than noise is wide,
    it is no slope of the curve's."""
    x, _, slope = table(sensor, curve)
    return Even.of(x, slope)


def _levels(sensor: Sensor) -> np.ndarray:
    dark = float(of_codes(np.array(sensor.black_level), sensor))
    low = dark * np.arange(-NEAR, 4 * NEAR, 1 / 8)
    top = 2.0**sensor.bit_depth - 1 - sensor.black_level
    above = np.concatenate([low[low < top], np.geomspace(min(low[-1], top), top, BRIGHT)])
    return np.unique(sensor.black_level + above)


def _phi(u: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp(-0.5 * u * u) / np.sqrt(2 * np.pi))

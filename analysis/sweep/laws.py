"""How a number of a plan is spread: laws by their quantile and density, so that any design of the unit interval becomes
samples of them, and samples of one law can stand for another.

    x = F^-1(u),    weight w = p(x) / q(x),    E_q[w f(x)] = E_p[f(x)]

q is the law that is sampled, p the one of nature. Owen: Monte Carlo theory, methods and examples, 2013, chapter 9.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.special import ndtr, ndtri


class Law(Protocol):
    def quantile(self, u: np.ndarray) -> np.ndarray: ...

    def density(self, x: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True)
class Uniform:
    low: float
    high: float

    def quantile(self, u: np.ndarray) -> np.ndarray:
        return self.low + u * (self.high - self.low)

    def density(self, x: np.ndarray) -> np.ndarray:
        return np.where((x >= self.low) & (x <= self.high), 1 / (self.high - self.low), 0.0)


@dataclass(frozen=True)
class LogUniform:
    """Evenly over magnitudes; 0 < low < high."""

    low: float
    high: float

    def quantile(self, u: np.ndarray) -> np.ndarray:
        return self.low * (self.high / self.low) ** u

    def density(self, x: np.ndarray) -> np.ndarray:
        inside = (x >= self.low) & (x <= self.high)
        return np.where(inside, 1 / (np.where(inside, x, 1.0) * np.log(self.high / self.low)), 0.0)


@dataclass(frozen=True)
class Normal:
    """Gaussian, cut off at low and high."""

    mean: float
    sigma: float
    low: float
    high: float

    @property
    def _ends(self) -> tuple[float, float]:
        a, b = ndtr((np.array([self.low, self.high]) - self.mean) / self.sigma)
        return float(a), float(b)

    def quantile(self, u: np.ndarray) -> np.ndarray:
        a, b = self._ends
        x = self.mean + self.sigma * ndtri(a + u * (b - a))
        return np.clip(x, self.low, self.high)

    def density(self, x: np.ndarray) -> np.ndarray:
        a, b = self._ends
        z = (x - self.mean) / self.sigma
        value = np.exp(-0.5 * z**2) / (np.sqrt(2 * np.pi) * self.sigma * (b - a))
        return np.where((x >= self.low) & (x <= self.high), value, 0.0)


@dataclass(frozen=True)
class Choice:
    """One of ``values``, each with its share; shares add up to 1."""

    values: tuple[float, ...]
    shares: tuple[float, ...]

    def quantile(self, u: np.ndarray) -> np.ndarray:
        k = np.searchsorted(np.cumsum(self.shares), u, side="right")
        # rounding may leave the sum short of 1; the last value that has a share at all is meant
        last = max(i for i, s in enumerate(self.shares) if s > 0)
        return np.asarray(self.values)[np.minimum(k, last)]

    def density(self, x: np.ndarray) -> np.ndarray:
        """Probability of each value."""
        x = np.asarray(x)[..., None]
        return np.sum(np.where(x == np.array(self.values), np.array(self.shares), 0.0), axis=-1)

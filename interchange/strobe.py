"""A strobe: a lamp that is on from t0 for a while, and what of that an exposure gets.

    share = k |[t0, t0 + T] ∩ [t, t + t_exp]| / t_exp

An image is the mean radiance over the exposure, so a strobed lamp's intensity is scaled by its share
(interchange.lamps.exposed). Flashes that repeat with a period add up.
"""

from dataclasses import dataclass

import numpy as np

from interchange.parameter import ParameterError, freeze, parameter
from interchange.problems import BrightfieldError


@dataclass(frozen=True)
class Strobe:
    """On from ``start`` s for ``duration`` s; again every ``period`` s, forwards and backwards in time, unless that is
    0. The clock is the scene's (``Scene.seconds``); ``triggered`` by the camera, it begins with each exposure, that of
    a rolling shutter's first row. Without a ``duration`` the lamp is always on, and the rest says nothing."""

    start: float = parameter(0.0, "t_0", "s", -1e6, 1e6, "the flash begins")
    duration: float = parameter(0.0, "T", "s", 0, 1e6, "of a flash; 0 is a lamp that is always on")
    period: float = parameter(0.0, "P", "s", 0, 1e6, "from flash to flash; 0 is a single one")
    overdrive: float = parameter(1.0, "k", "1", 0, 1e4, "the flash over the lamp's steady intensity")
    triggered: bool = False

    def __post_init__(self) -> None:
        freeze(self)
        object.__setattr__(self, "triggered", bool(self.triggered))
        if self.period and self.period < self.duration:
            raise ParameterError(
                f"Strobe.period (P, from flash to flash) must be 0 or hold the duration, {self.duration:g} s; "
                f"got {self.period:g} s."
            )

    @property
    def is_there(self) -> bool:
        return self.duration > 0

    def on_until(self, t: np.ndarray | float) -> np.ndarray:
        """Seconds of light up to ``t``, from any fixed moment: differences count."""
        t = np.asarray(t, np.float64) - self.start
        if not self.period:
            return np.clip(t, 0, self.duration)
        whole = np.floor(t / self.period)
        return whole * self.duration + np.clip(t - whole * self.period, 0, self.duration)

    def share(self, t_exp: float, start: np.ndarray | float = 0.0) -> np.ndarray:
        """The lamp's mean over exposures of ``t_exp`` s from ``start`` s on, over its steady intensity."""
        if not self.is_there:
            return np.ones(np.shape(start))
        if not t_exp > 0:
            raise BrightfieldError(f"A strobe lights an exposure above 0 s; got {t_exp:g} s.")
        start = np.asarray(start, np.float64)
        return self.overdrive * (self.on_until(start + t_exp) - self.on_until(start)) / t_exp

    def lit(self, t_exp: float, start: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """When the light of exposures of ``t_exp`` s from ``start`` s on begins and ends, over ``t_exp``: 0 and 1 of a
        lamp that is always on, ½ and ½ in the dark. Raises BrightfieldError where an exposure gets several flashes."""
        begin = np.asarray(start, np.float64) - self.start
        if not self.is_there or self.period == self.duration:
            return np.zeros(begin.shape), np.ones(begin.shape)
        if self.period:
            first = np.floor((begin - self.duration) / self.period) + 1  # that is not over
            if (np.ceil((begin + t_exp) / self.period) - 1 > first).any():
                raise BrightfieldError(
                    f"An exposure in which something moves must get one flash; {t_exp:g} s get several, one every "
                    f"{self.period:g} s."
                )
            begin = begin - first * self.period
        low, high = (np.clip((t - begin) / t_exp, 0, 1) for t in (0.0, self.duration))
        dark = high <= low
        return np.where(dark, 0.5, low), np.where(dark, 0.5, high)

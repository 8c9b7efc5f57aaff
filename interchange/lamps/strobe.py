"""Strobes: a lamp that is on from t0 for a while, and what of that an exposure gets.

    share = |[t0, t0 + T] ∩ [start, start + t_exp]| / t_exp

An image is the mean radiance over the exposure, so a strobed lamp's intensity is scaled by its share. Flashes that
repeat with a period add up. A rolling shutter's row has an exposure of its own: it starts ``line_time`` later.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.light import Light
from interchange.problems import BrightfieldError
from interchange.scene import Scene


@dataclass(frozen=True)
class Strobe:
    """On from ``start`` s for ``duration`` s; again every ``period`` s, forwards and backwards in time, unless that is
    0. ``overdrive``: the flash over the lamp's steady intensity."""

    start: float
    duration: float
    period: float = 0.0
    overdrive: float = 1.0

    def __post_init__(self) -> None:
        if not self.duration >= 0 or not self.overdrive >= 0 or not np.isfinite(self.start):
            raise BrightfieldError(f"A strobe's times must be finite, its duration not negative; got {self}.")
        if self.period and not self.period >= self.duration:
            raise BrightfieldError(
                f"A strobe must be over before the next: its period holds its duration; got {self}."
            )

    def on_until(self, t: np.ndarray | float) -> np.ndarray:
        """Seconds of light up to ``t``, from any fixed moment: differences count."""
        t = np.asarray(t, np.float64) - self.start
        if not self.period:
            return np.clip(t, 0, self.duration)
        whole = np.floor(t / self.period)
        return whole * self.duration + np.clip(t - whole * self.period, 0, self.duration)

    def share(self, t_exp: float, start: np.ndarray | float = 0.0) -> np.ndarray:
        """The lamp's mean over exposures of ``t_exp`` s from ``start`` s on, over its steady intensity."""
        if not t_exp > 0:
            raise BrightfieldError(f"A strobe lights an exposure above 0 s; got {t_exp:g} s.")
        start = np.asarray(start, np.float64)
        return self.overdrive * (self.on_until(start + t_exp) - self.on_until(start)) / t_exp

    def rows(self, camera: Camera, start: float = 0.0) -> np.ndarray:
        """(H,) the share of each row of a rolling shutter; all alike with a global one."""
        height = camera.sensor.resolution[1]
        return self.share(camera.t_exp, start + camera.sensor.line_time * np.arange(height))


def strobed(light: Light, strobe: Strobe, t_exp: float, start: float = 0.0) -> Light:
    """The lamp as steady light that gives the exposure as much."""
    r, g, b = np.asarray(light.intensity) * strobe.share(t_exp, start)
    return replace(light, intensity=(float(r), float(g), float(b)))


def strobed_series(
    scene: Scene, strobes: dict[str, Strobe], t_exp: float, starts: Sequence[float]
) -> tuple[Scene, ...]:
    """One scene an exposure, one time code each: the lamps named in ``strobes`` as they light it.

    ``starts``: s at which each exposure begins. ``author_scene`` writes the series as time samples. Raises
    BrightfieldError for a name that no lamp has.
    """
    unknown = [n for n in strobes if n not in {x.name for x in scene.lights}]
    if unknown:
        raise BrightfieldError(
            f"No lamp is called {', '.join(unknown)}; there are {[x.name for x in scene.lights]}."
        )
    return tuple(
        replace(
            scene,
            time=float(k),
            lights=tuple(
                strobed(x, strobes[x.name], t_exp, start) if x.name in strobes else x for x in scene.lights
            ),
        )
        for k, start in enumerate(starts)
    )

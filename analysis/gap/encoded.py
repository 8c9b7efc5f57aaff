"""Whether captures are encoded for a screen where the scene says that they are linear: most of what leaves a camera as
a picture is. The curve is known, so it is taken for what it is before anything is fitted: no number of a response curve
follows its straight toe, and what it leaves would be taken for effects that are not there.

Over all pixels of a camera the captures' DN are a function of the simulated ones. Medians of ``BINS`` steps of it are
fitted by a line and by the curve of IEC 61966-2-1 (sRGB), each with a gain and an offset of its own; a black level that
was taken off before is part of the gain and the offset.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.gap.conditions import Condition
from analysis.gap.parallel import each
from interchange.camera import Camera
from interchange.effects.response_curve import ResponseCurve
from interchange.sensor import Response, Sensor

BINS, LEAST = 32, 50  # steps of the simulated DN, each of as many values; values of one at least
GAINS = np.geomspace(0.5, 2.0, 141)
BENT = 0.01  # of the captures' range, rms, that a line leaves at least
BETTER = 10.0  # times as much (squared) that it leaves as sRGB's curve does
GROUNDS = (
    "Over all pixels of a camera the captured DN follow sRGB's curve of the simulated ones, and no line: it was taken "
    "so before anything was fitted."
)


@dataclass(frozen=True)
class Screen:
    """A camera whose captures are encoded; ``black_off``: whether its black level was taken off before."""

    camera: str
    black_off: bool

    def of(self, camera: Camera) -> Camera:
        """The camera as its captures are."""
        if camera.name != self.camera:
            return camera
        black = 0.0 if self.black_off else camera.sensor.black_level
        return replace(camera, sensor=replace(camera.sensor, response=Response.SRGB, black_level=black))


def encoded(found: Sequence[Condition]) -> list[Screen]:
    """The cameras of which that is so."""
    cameras: dict[str, list[Condition]] = {}
    for c in found:
        if is_linear(c.camera.sensor):
            cameras.setdefault(c.camera.name, []).append(c)
    told = each(_black_off, cameras.values())
    return [Screen(name, off) for name, off in zip(cameras, told, strict=True) if off is not None]


def is_linear(sensor: Sensor) -> bool:
    """Whether a scene says that DN are linear, of however few bits."""
    return sensor.response is Response.LINEAR and sensor.gamma == 1 and not (sensor.bow or sensor.skew)


def _black_off(own: Sequence[Condition]) -> bool | None:
    """Whether black is gone from captures that follow the curve; None of those that do not."""
    x, y = (np.concatenate(parts) for parts in zip(*(_pairs(c) for c in own), strict=True))
    if len(x) < BINS * LEAST:
        return None
    steps = np.array_split(np.argsort(x, kind="stable"), BINS)
    x, y = (np.array([np.median(plane[i]) for i in steps]) for plane in (x, y))
    line = np.stack([x, np.ones(BINS)], axis=1)
    straight = float(np.square(y - line @ np.linalg.lstsq(line, y, rcond=None)[0]).mean())
    curve = ResponseCurve(response=Response.SRGB).curve
    off = [y - curve(np.clip(g * x, 0, 1)) for g in GAINS]
    best = min(off, key=lambda d: float(d.var()))
    if straight <= max(BENT * np.ptp(y), 1e-12) ** 2 or straight <= BETTER * best.var():
        return None
    sensor = own[0].camera.sensor
    black = sensor.black_level / (2**sensor.bit_depth - 1)
    return bool(abs(best.mean()) < abs(best.mean() - black))


def _pairs(c: Condition) -> tuple[np.ndarray, np.ndarray]:
    """Simulated and captured signals over the highest, of what is compared."""
    simulated = c.simulated()
    black, ok = simulated.black, c.compared
    x = np.maximum(simulated.dn[ok] - black, 0) / (simulated.top - black)
    return x.reshape(-1), (c.mean[ok] / simulated.top).reshape(-1)

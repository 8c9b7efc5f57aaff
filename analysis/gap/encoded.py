"""Whether captures are encoded for a screen where the scene says that they are linear: most of what leaves a camera as
a picture is, and a curve that a file applied is no effect of the camera.

Over all pixels of a camera the captures' DN are a function of the simulated ones. Medians of ``BINS`` steps of it are
fitted by a line and by the curve of IEC 61966-2-1 (sRGB), each with a gain and an offset of its own; a black level that
was taken off before is part of the gain and the offset.
"""

from collections.abc import Sequence

import numpy as np

from analysis.gap.conditions import Condition
from interchange.effects.response_curve import ResponseCurve
from interchange.sensor import Response

BINS, LEAST = 32, 50  # steps of the simulated DN, each of as many values; values of one at least
GAINS = np.geomspace(0.5, 2.0, 141)
BENT = 0.01  # of the captures' range, rms, that a line leaves at least
BETTER = 10.0  # times as much (squared) that it leaves as sRGB's curve does


def encoded(found: Sequence[Condition]) -> list[str]:
    """The cameras of which that is so."""
    cameras: dict[str, list[Condition]] = {}
    for c in found:
        s = c.camera.sensor
        if s.response is Response.LINEAR and s.gamma == 1 and not s.bow:
            cameras.setdefault(c.camera.name, []).append(c)
    return [name for name, own in cameras.items() if _is_encoded(own)]


def _is_encoded(own: Sequence[Condition]) -> bool:
    x, y = (np.concatenate(parts) for parts in zip(*(_pairs(c) for c in own), strict=True))
    if len(x) < BINS * LEAST:
        return False
    steps = np.array_split(np.argsort(x, kind="stable"), BINS)
    x, y = (np.array([np.median(plane[i]) for i in steps]) for plane in (x, y))
    line = np.stack([x, np.ones(BINS)], axis=1)
    straight = float(np.square(y - line @ np.linalg.lstsq(line, y, rcond=None)[0]).mean())
    curve = ResponseCurve(response=Response.SRGB).curve
    bent = min(float((y - curve(np.clip(g * x, 0, 1))).var()) for g in GAINS)
    return straight > max(BENT * np.ptp(y), 1e-12) ** 2 and straight > BETTER * bent


def _pairs(c: Condition) -> tuple[np.ndarray, np.ndarray]:
    """Simulated and captured signals over the highest, of what is compared."""
    simulated = c.simulated()
    black, ok = simulated.black * simulated.top / (2**c.camera.sensor.bit_depth - 1), c.compared
    x = np.maximum(simulated.dn[ok] - black, 0) / (simulated.top - black)
    return x.reshape(-1), (c.mean[ok] / simulated.top).reshape(-1)

"""When frames are due: the grid in time that a camera's exposures follow, and how well they kept to it.

Frames are due at whole multiples of the period since the scene began, so errors do not add up and cameras of one rate
expose together; a camera that was too slow leaves out whole periods and counts them. Jitter is the spread of (start of
exposure - when it was due).
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

SAME = 1e-6  # of a period: what rounding leaves
KEPT = 10_000  # exposures that the statistics look back on


@dataclass(frozen=True)
class Timing:
    """``rate`` frames/s that came; lateness of the start of exposures, s; ``missed``: periods without a frame."""

    frames: int
    rate: float
    jitter_rms: float
    late_median: float
    late_p95: float
    missed: int


class Pace:
    """Times are s since the scene began."""

    def __init__(self) -> None:
        self._last: float | None = None
        self._late: deque[float] = deque(maxlen=KEPT)
        self._starts: deque[float] = deque(maxlen=KEPT)
        self.frames = 0
        self.missed = 0

    def due(self, period: float, now: float) -> float:
        """When the next frame is due."""
        if self._last is None:  # as if there had been a frame before
            self._last = float((np.ceil(now / period - SAME) - 1) * period)
        return float((np.floor(self._last / period + SAME) + 1) * period)

    def took(self, now: float, due: float, period: float) -> float:
        """A frame that was ``due`` is begun at ``now``; which time it is the frame of."""
        gone = max(0, int((now - due) / period + SAME))
        self.missed += gone
        self.frames += 1
        self._last = due if not gone else float(np.floor(now / period + SAME) * period)
        self._late.append(now - self._last)
        self._starts.append(now)
        return self._last

    @property
    def timing(self) -> Timing:
        late, starts = np.array(self._late), np.array(self._starts)
        rate = (len(starts) - 1) / (starts[-1] - starts[0]) if len(starts) > 1 else 0.0
        if not len(late):
            return Timing(0, 0.0, 0.0, 0.0, 0.0, self.missed)
        middle, high = np.percentile(late, [50, 95])
        return Timing(self.frames, float(rate), float(late.std()), float(middle), float(high), self.missed)

"""When frames are due: the grid in time that a camera's exposures follow, and how well they kept to it.

A frame is due one period after the last one was due, so errors do not add up; a camera that was too slow leaves out
whole periods and counts them. Jitter is the spread of (start of exposure - when it was due).
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

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
    """Times are those of one clock, s."""

    def __init__(self) -> None:
        self._last: float | None = None
        self._late: deque[float] = deque(maxlen=KEPT)
        self._starts: deque[float] = deque(maxlen=KEPT)
        self.frames = 0
        self.missed = 0

    def due(self, period: float, now: float) -> float:
        """When the next frame is due; the first one is at once."""
        return now if self._last is None else self._last + period

    def took(self, now: float, due: float, period: float) -> None:
        """A frame that was ``due`` was begun at ``now``."""
        gone = max(0, int((now - due) / period))
        self.missed += gone
        self.frames += 1
        self._last = due + gone * period
        self._late.append(now - self._last)
        self._starts.append(now)

    @property
    def timing(self) -> Timing:
        late, starts = np.array(self._late), np.array(self._starts)
        rate = (len(starts) - 1) / (starts[-1] - starts[0]) if len(starts) > 1 else 0.0
        if not len(late):
            return Timing(0, 0.0, 0.0, 0.0, 0.0, self.missed)
        middle, high = np.percentile(late, [50, 95])
        return Timing(self.frames, float(rate), float(late.std()), float(middle), float(high), self.missed)

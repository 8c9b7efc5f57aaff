"""When frames are due: the clock that a camera's exposures follow, and how well they kept to it.

Frame k is due at t0 + k T, so errors do not add up; a camera that was too slow leaves out whole periods and counts
them. Jitter is the spread of (start of exposure - when it was due).
"""

import threading
import time
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
    """Waits for the next frame's time. One thread waits, any may stop it."""

    def __init__(self) -> None:
        self._due = 0.0
        self._period = 0.0
        self._stopped = threading.Event()
        self._late: deque[float] = deque(maxlen=KEPT)
        self._starts: deque[float] = deque(maxlen=KEPT)
        self.frames = 0
        self.missed = 0

    def wait(self, period: float) -> bool:
        """Until the next frame is due, ``period`` s after the last one; False where ``stop`` was called."""
        now = time.monotonic()
        if self._due == 0.0 or period != self._period:
            self._due = max(now, self._due) if self._due else now
            self._period = period
        elif now > self._due + period:
            gone = int((now - self._due) / period)
            self.missed += gone
            self._due += gone * period
        if self._due > now and self._stopped.wait(self._due - now):
            return False
        if self._stopped.is_set():
            return False
        self.took(time.monotonic(), self._due)
        self._due += period
        return True

    def took(self, now: float, due: float) -> None:
        """A frame was begun at ``now`` that was due at ``due``."""
        self.frames += 1
        self._late.append(now - due)
        self._starts.append(now)

    def stop(self) -> None:
        self._stopped.set()

    @property
    def timing(self) -> Timing:
        late, starts = np.array(self._late), np.array(self._starts)
        rate = (len(starts) - 1) / (starts[-1] - starts[0]) if len(starts) > 1 else 0.0
        if not len(late):
            return Timing(0, 0.0, 0.0, 0.0, 0.0, self.missed)
        middle, high = np.percentile(late, [50, 95])
        return Timing(self.frames, float(rate), float(late.std()), float(middle), float(high), self.missed)

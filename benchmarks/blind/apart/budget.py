"""How much of a tolerance is drawn, and how its kinds of error share it.

Who writes the diagnosis does not read this folder.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.blind.errors import SHARE

LEVEL = (0.5, 1.0)  # of a declared deviation, all kinds together
MEAN = 0.76  # rms of LEVEL
PEAK = 2.0  # declared deviations, that nothing exceeds


@dataclass(frozen=True)
class Budget:
    """``scale``: that of a plan; above 1 more than is declared, as many times as the first way has it."""

    rng: np.random.Generator
    scale: float = 1.0

    @property
    def more(self) -> float:
        return 1.0 if self.scale == 1 else self.scale * SHARE / MEAN

    def shares(self, n: int) -> np.ndarray:
        """(n,) of squares that add up to that of the level drawn; some are 0."""
        active = self.rng.random(n) < 0.6
        active[self.rng.integers(n)] = True
        weight = np.where(active, self.rng.gamma(1.0, size=n), 0.0)
        return self.more * self.rng.uniform(*LEVEL) * np.sqrt(weight / weight.sum())

    def mixed(self, tolerance: float, parts: Sequence[np.ndarray]) -> np.ndarray:
        """The kinds ``parts``, of rms 1 each and alike in shape, within ``tolerance``."""
        total = sum(w * p for w, p in zip(self.shares(len(parts)), parts, strict=True))
        return tolerance * self.capped(np.asarray(total))

    def capped(self, errors: np.ndarray) -> np.ndarray:
        """All of it smaller, where its worst would be beyond what is likely."""
        return errors / max(1.0, float(np.abs(errors).max()) / (PEAK * self.more))

    def normal(self, *shape: int) -> np.ndarray:
        return np.clip(self.rng.standard_normal(shape), -2, 2)


def unit(field: np.ndarray) -> np.ndarray:
    """Mean 0 and rms 1 over the first two axes, or less where its peak would be above 2."""
    out = field - field.mean(axis=(0, 1), keepdims=True)
    return out / max(float(np.sqrt(np.mean(out**2))), float(np.abs(out).max()) / PEAK, 1e-12)

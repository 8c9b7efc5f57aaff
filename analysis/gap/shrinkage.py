"""How far the gap shrinks, on captures that nothing was fitted to.

    χ² = mean (capture - simulation)² / σ²,   closed = (before² - after²) / (before² - floor²)

Intervals by resampling blocks of ``SIDE`` px, within which residuals go together. Kuensch: The jackknife and the
bootstrap for general stationary observations. Ann. Stat. 1989.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.gap.conditions import Condition
from analysis.gap.expected import noise_variance
from analysis.gap.fit import Model

SIDE, RESAMPLES = 32, 500


@dataclass(frozen=True)
class Gap:
    """χ, and rms in DN, before and after; 95 % intervals; the part of what can be closed that was closed."""

    before: float
    after: float
    noise_floor: float
    ci95_before: tuple[float, float]
    ci95_after: tuple[float, float]
    rmse_dn_before: float
    rmse_dn_after: float
    held_out: tuple[str, ...]

    @property
    def explained(self) -> float:
        removable = self.before**2 - self.noise_floor**2
        return (self.before**2 - self.after**2) / removable if removable > 0 else 0.0


def gap(
    held_out: Sequence[Condition],
    before: Model,
    after: Model,
    temporal_scale: float,
    rng: np.random.Generator,
) -> Gap:
    blocks = np.concatenate([_blocks(c, before, after, temporal_scale) for c in held_out])
    sums = blocks.sum(axis=0)
    picks = rng.integers(0, len(blocks), (RESAMPLES, len(blocks)))
    again = np.stack([blocks[p].sum(axis=0) for p in picks])
    chi = np.sqrt(again[:, 1:3] / again[:, :1])
    low, high = np.percentile(chi, [2.5, 97.5], axis=0)
    means = np.sqrt(sums[1:] / sums[0])
    return Gap(
        before=float(means[0]),
        after=float(means[1]),
        noise_floor=float(means[2]),
        ci95_before=(float(low[0]), float(high[0])),
        ci95_after=(float(low[1]), float(high[1])),
        rmse_dn_before=float(means[3]),
        rmse_dn_after=float(means[4]),
        held_out=tuple(i for c in held_out for i in c.images),
    )


def _blocks(condition: Condition, before: Model, after: Model, temporal_scale: float) -> np.ndarray:
    """(n, 6): count, Σ before²/σ², Σ after²/σ², Σ V/σ², Σ before², Σ after² of each block that has usable pixels."""
    ok = condition.usable(condition.simulated())[..., None] & np.ones(condition.mean.shape, bool)
    dn = [m.simulated(condition) for m in (before, after)]
    temporal, fixed = noise_variance(dn[1], condition.camera)
    variance = (temporal + fixed).astype(np.float64)
    noise = (temporal_scale * temporal + fixed) / variance
    planes = np.zeros((*ok.shape[:2], 6))
    for capture in condition.captures:
        e = [capture.pixels - d for d in dn]
        for k, plane in enumerate(
            (1.0, e[0] ** 2 / variance, e[1] ** 2 / variance, noise, e[0] ** 2, e[1] ** 2)
        ):
            planes[..., k] += np.where(ok, plane, 0.0).sum(axis=2)
    rows, columns = (np.arange(0, n, SIDE) for n in ok.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(planes, rows, axis=0), columns, axis=1).reshape(-1, 6)
    return np.asarray(sums[sums[:, 0] > 0])

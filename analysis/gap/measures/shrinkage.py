"""How far the gap shrinks, on captures that nothing was fitted to.

    χ² = mean (capture - simulation)² / σ²,   closed = (before² - after²) / (before² - floor²)

Three simulations are told, in this order:

| name | is |
|---|---|
| as written | the scene file, rendered, and nothing else |
| before | the scene file where it fits best within its declared tolerances: what the file claims, at its best |
| after | that, with the effects that were found |

``before`` counts as the gap: a file says its numbers and how far they may be off, and what lies within that is no
finding. So an effect is not credited with what registration closes, and the gap of captures that are what the file
says is the noise. The step from ``as written`` to ``before`` is told beside it.

Intervals by resampling blocks of ``SIDE`` px, within which residuals go together. Kuensch: The jackknife and the
bootstrap for general stationary observations. Ann. Stat. 1989.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.gap.compared.conditions import Condition

SIDE, RESAMPLES = 32, 500

Images = Sequence[np.ndarray]  # (H, W, C) DN, one a condition


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
    as_written: float
    rmse_dn_as_written: float

    @property
    def explained(self) -> float:
        removable = self.before**2 - self.noise_floor**2
        return (self.before**2 - self.after**2) / removable if removable > 0 else 0.0


@dataclass(frozen=True, eq=False)
class Yardstick:
    """What all simulations of the held-out conditions are measured by: one σ² and one set of pixels for all.

    ``variance`` (H, W, C) DN², ``noise``: what of it repeats show, over it; ``ok`` (H, W, C) bool: what is compared.
    """

    conditions: tuple[Condition, ...]
    ok: tuple[np.ndarray, ...]
    variance: tuple[np.ndarray, ...]
    noise: tuple[np.ndarray, ...]

    def blocks(self, *simulations: Images) -> np.ndarray:
        """(n, 2 + 2 m): count, Σ noise, then Σ e²/σ² and Σ e² of each simulation, for every block of pixels."""
        return np.concatenate(
            [self._blocks(k, [s[k] for s in simulations]) for k in range(len(self.conditions))]
        )

    def chi2(self, simulation: Images) -> float:
        """Mean χ² of one simulation."""
        sums = self.blocks(simulation).sum(axis=0)
        return float(sums[2] / sums[0])

    def _blocks(self, k: int, simulations: Images) -> np.ndarray:
        condition, ok, variance = self.conditions[k], self.ok[k], self.variance[k]
        planes = np.zeros((*ok.shape[:2], 2 + 2 * len(simulations)))
        repeats = len(condition.captures)
        planes[..., 0] = repeats * ok.sum(axis=2)
        planes[..., 1] = repeats * np.where(ok, self.noise[k], 0.0).sum(axis=2)
        for capture in condition.captures:
            for i, dn in enumerate(simulations):
                e2 = np.where(ok, capture.pixels - dn, 0.0) ** 2
                planes[..., 2 + 2 * i] += (e2 / variance).sum(axis=2)
                planes[..., 3 + 2 * i] += e2.sum(axis=2)
        return _summed(planes)

    def claims(self, before: Images, after: Images, drift: float = 0.0) -> np.ndarray:
        """(n, 3): count, Σ δ r / σ² and Σ δ² / σ² for every block of pixels, r what captures have beyond ``before``
        and δ what ``after`` has. A gain of each condition's own, normally distributed with the standard deviation
        ``drift``, is marginalised: no effect is refuted by how bright one capture is beside the others."""
        found = []
        for k, c in enumerate(self.conditions):
            w = np.where(self.ok[k], len(c.captures) / self.variance[k], 0.0)
            r, delta = c.mean - before[k], after[k] - before[k]
            own = delta
            if drift > 0:
                signal = np.maximum(before[k] - c.simulated().black, 0)
                gain = float((w * signal * delta).sum()) / (drift**-2 + float((w * signal**2).sum()))
                own = delta - gain * signal
            planes = [self.ok[k], w * own * r, w * own * delta]
            found.append(_summed(np.stack([x.sum(axis=2) for x in planes], axis=2)))
        return np.concatenate(found)


def _summed(planes: np.ndarray) -> np.ndarray:
    """(n, k): sums of (h, w, k) over blocks of ``SIDE`` px, those whose first is not 0."""
    rows, columns = (np.arange(0, n, SIDE) for n in planes.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(planes, rows, axis=0, dtype=np.float64), columns, axis=1)
    sums = sums.reshape(-1, planes.shape[2])
    return np.asarray(sums[sums[:, 0] > 0])


def yardstick(held_out: Sequence[Condition], best: Images, temporal_scale: float) -> Yardstick:
    """``best``: the simulation that the noise is reckoned from; ``temporal_scale``: what repeats showed of it."""
    ok, variances, noises = [], [], []
    for condition, dn in zip(held_out, best, strict=True):
        usable = condition.usable(condition.simulated())
        ok.append(usable[..., None] & np.ones(condition.mean.shape, bool))
        temporal, fixed = condition.variance_at(dn)
        variance = (temporal + fixed).astype(np.float64)
        variances.append(variance)
        noises.append((temporal_scale * temporal + fixed) / variance)
    return Yardstick(tuple(held_out), tuple(ok), tuple(variances), tuple(noises))


def gap(by: Yardstick, as_written: Images, before: Images, after: Images, rng: np.random.Generator) -> Gap:
    blocks = by.blocks(as_written, before, after)
    sums = blocks.sum(axis=0)
    if not sums.size or not sums[0]:
        raise ValueError("no pixel of the held-out conditions can be compared")
    picks = rng.integers(0, len(blocks), (RESAMPLES, len(blocks)))
    again = np.stack([blocks[p].sum(axis=0) for p in picks])
    low, high = np.percentile(np.sqrt(again[:, [4, 6]] / again[:, :1]), [2.5, 97.5], axis=0)
    noise, raw, raw_dn, chi_before, dn_before, chi_after, dn_after = np.sqrt(sums[1:] / sums[0])
    return Gap(
        before=float(chi_before),
        after=float(chi_after),
        noise_floor=float(noise),
        ci95_before=(float(low[0]), float(high[0])),
        ci95_after=(float(low[1]), float(high[1])),
        rmse_dn_before=float(dn_before),
        rmse_dn_after=float(dn_after),
        held_out=tuple(i for c in by.conditions for i in c.images),
        as_written=float(raw),
        rmse_dn_as_written=float(raw_dn),
    )

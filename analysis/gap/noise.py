"""Effects of noise do not move the mean image: they are judged on the variance of repeats.

var(DN) = K² (e + σ_d²) + 1/12     K, σ_d by least squares of measured variance on expected electrons
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.gap.conditions import Condition

SPIKE = 0.03  # relative error of the variance that a sensor's data sheet leaves
LEVELS = 24  # of brightness that variances are put together by


@dataclass(frozen=True)
class NoiseFit:
    """``ratio``: measured variance over the model's; ``read_noise`` e- and its σ, given the model's K."""

    ratio: float
    ratio_sigma: float
    read_noise: float
    read_noise_sigma: float
    probability: float


def noise_fit(conditions: Sequence[Condition]) -> NoiseFit | None:
    """None without repeats. Electrons are the mean of the repeats themselves, so that no other effect matters."""
    x, y, n = [], [], []
    for c in conditions:
        if c.spread is None:
            continue
        s = c.camera.sensor
        ok = c.usable(c.simulated())
        electrons = ((c.mean[ok] - s.black_level) / s.K).reshape(-1)
        measured = c.spread[ok].reshape(-1) / s.K**2 - 1 / 12 / s.K**2
        order = np.array_split(np.argsort(electrons), LEVELS)
        x += [float(electrons[i].mean()) for i in order if len(i)]
        y += [float(measured[i].mean()) for i in order if len(i)]
        n += [(len(c.captures) - 1) * len(i) for i in order if len(i)]
        read = s.read_noise
    if not x:
        return None
    mu, variance, count = np.maximum(x, 0), np.array(y), np.array(n, float)
    model = mu + read**2
    sd = np.maximum(model, 1.0) * np.sqrt(2 / count)
    ratio = float(np.sum(variance * model / sd**2) / np.sum(model**2 / sd**2))
    ratio_sigma = float(1 / np.sqrt(np.sum(model**2 / sd**2)))
    extra = float(np.sum((variance - mu) / sd**2) / np.sum(1 / sd**2))
    extra_sigma = float(1 / np.sqrt(np.sum(1 / sd**2)))
    found = float(np.sqrt(max(extra, 0.0)))
    # spike and slab on the ratio: as far off as a data sheet may be, or by anything up to a half
    narrow, wide = (np.hypot(w, ratio_sigma) for w in (SPIKE, 0.5))
    z = [-0.5 * ((ratio - 1) / w) ** 2 - np.log(w) for w in (narrow, wide)]
    probability = float(1 / (1 + np.exp(np.clip(z[0] - z[1] + np.log(9.0), -700, 700))))
    return NoiseFit(ratio, ratio_sigma, found, extra_sigma / max(2 * found, 1e-3), probability)

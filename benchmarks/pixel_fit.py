"""One Lafortune lobe at every pixel of an illumination series, against a loop over SciPy's solver.

512 x 512 pixels, 24 x 6 lamps, 1 % noise; the same minimum is meant within 1e-6 of the cost. The loop is timed on a
sample of pixels, from one start, with the exact Jacobian; times include compiling.

    python benchmarks/pixel_fit.py [--size 512] [--sample 1000]
"""

import argparse
import time

import numpy as np
from scipy.optimize import least_squares

from analysis.fit.lafortune_pixels import fit_lafortune_pixels

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--size", type=int, default=512)
parser.add_argument("--sample", type=int, default=1000)
options = parser.parse_args()

polar, azimuth = np.radians([12, 24, 36, 48, 60, 72]), np.arange(24) * 2 * np.pi / 24
wi = np.array([[np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)] for t in polar for a in azimuth])
rng = np.random.default_rng(0)
count = options.size**2
k_d = rng.uniform(0.05, 0.8, count)
n = np.exp(rng.uniform(np.log(1), np.log(150), count))
c_z = np.exp(rng.uniform(np.log(0.05), np.log(3), count)) ** (1 / n)
y = k_d / np.pi + (c_z * wi[:, 2:]) ** n
y *= 1 + 0.01 * rng.normal(size=y.shape)

start = time.perf_counter()
fits = fit_lafortune_pixels(y.reshape(len(wi), options.size, options.size), wi, np.array([0.0, 0.0, 1.0]))
ours = time.perf_counter() - start


def loop(i: int) -> float:
    def residual(x: np.ndarray) -> np.ndarray:
        return x[1] / np.pi + (x[0] * wi[:, 2]) ** x[2] - y[:, i]

    def jacobian(x: np.ndarray) -> np.ndarray:
        base = np.maximum(x[0] * wi[:, 2], 1e-300)
        lobe = base ** x[2]
        return np.stack([x[2] * lobe / x[0], np.full(len(wi), 1 / np.pi), lobe * np.log(base)], axis=-1)

    bounds = ([1e-9, 0, 0.05], [2, np.pi, 1e4])
    return 2 * least_squares(residual, [1.0, 0.3, 5.0], jacobian, bounds, x_scale="jac").cost


chosen = rng.choice(count, options.sample, replace=False)
start = time.perf_counter()
costs = np.array([loop(i) for i in chosen])
theirs = (time.perf_counter() - start) / options.sample * count
ratio = fits.cost[chosen] / costs
print(f"ours                      {ours:8.1f} s   {options.size} x {options.size} pixels, {len(wi)} lamps")
print(f"scipy.optimize in a loop  {theirs:8.0f} s   from {options.sample} pixels")
print(f"ratio                     {theirs / ours:8.0f}")
print(f"same minimum or lower     {(ratio <= 1 + 1e-6).mean():8.2%}")
print(f"same minimum              {(np.abs(ratio - 1) <= 1e-6).mean():8.2%}")
print(f"lower than the loop's     {(ratio < 1 - 1e-6).mean():8.2%}")
print(f"converged                 {fits.converged.mean():8.3%}")

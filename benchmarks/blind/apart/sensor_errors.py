"""Flat field, pixels' gains and black level, off what is declared.

Who writes the diagnosis does not read this folder.
"""

import cv2
import numpy as np

from benchmarks.blind.apart.budget import Budget, unit
from benchmarks.blind.bench import Shot
from benchmarks.blind.cause import Frame


def flat(b: Budget, tolerance: float, size: tuple[int, int]) -> np.ndarray:
    """(h, w, 3) gain of mean 1: what a correction by an integrating sphere leaves."""
    x, y = Frame(size).grid
    r2 = x * x + y * y
    ring = (r2 - b.rng.uniform(0.1, 0.3)) * (r2 - b.rng.uniform(0.5, 0.8))
    sphere = np.cos(b.rng.uniform(1.5, 3.5) * (x * b.normal() + y * b.normal()) + b.rng.uniform(0, 6))
    angle = b.rng.uniform(0, 2 * np.pi)
    tilt = (x * np.cos(angle) + y * np.sin(angle))[..., None] * [1, 0.2, -0.9]
    halves = np.tanh((x - b.rng.choice([0.0, 0.2])) * 1e3)
    dust = np.zeros_like(x)
    for _ in range(int(b.rng.integers(1, 6))):
        cx, cy = b.rng.uniform(-0.7, 0.7, 2)
        r = np.hypot(x - cx, y - cy) / b.rng.uniform(0.03, 0.08)
        dust -= np.exp(-(((r - 0.8) / 0.35) ** 2))  # a grain far before the sensor: its shadow is a ring
    three = [np.repeat(f[..., None], 3, axis=2) for f in (ring, sphere, halves, dust)]
    return 1 + b.mixed(tolerance, [unit(np.asarray(f)) for f in (*three, tilt)])


def pixels(rng: np.random.Generator, prnu: float, size: tuple[int, int]) -> np.ndarray:
    """(h, w, 3) gain of rms prnu: most of it white, a little by columns and a little blotchy, all of one kind."""
    w, h = size
    columns, blotches = rng.uniform(0, 0.02), rng.uniform(0, 0.06)  # of the variance
    soft = cv2.GaussianBlur(rng.standard_normal((h, w, 3)), (0, 0), rng.uniform(0.8, 2.0))
    out = np.sqrt(1 - columns - blotches) * rng.standard_normal((h, w, 3))
    out += np.sqrt(columns) * rng.standard_normal((1, w, 1)) + np.sqrt(blotches) * soft / soft.std()
    return 1 + prnu * out / out.std()


def black(b: Budget, tolerance: float, shots: tuple[Shot, ...], times: np.ndarray, rows: int) -> np.ndarray:
    """(shots, repeats, rows, 3) DN of one camera."""
    repeats = max(s.repeats for s in shots)
    one = np.ones((len(shots), repeats, rows, 3))
    exposure = np.array([s.exposure for s in shots])
    dark = (exposure - 0.5)[:, None, None, None] / 0.5
    row = np.linspace(-1, 1, rows)[None, None, :, None] * np.sqrt(3)
    warm = (1 - np.exp(-3 * times))[:, None, None, None] / 0.6
    parts = [
        b.normal() * one, b.normal(3) * one, b.normal() * dark * one, b.normal() * row / np.sqrt(3) * one,
        b.normal() * warm * one, 0.5 * b.normal(len(shots), repeats, 1, 1) * one,
    ]  # fmt: skip
    return b.mixed(tolerance, parts)

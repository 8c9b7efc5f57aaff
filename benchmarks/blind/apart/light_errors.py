"""Lamps' power and reflectances, off what is declared. Who writes the diagnosis does not read this folder."""

from dataclasses import dataclass

import numpy as np

from benchmarks.blind.apart.budget import Budget
from benchmarks.blind.bench import Bench, Shot


def lamps(b: Budget, tolerance: float, shots: tuple[Shot, ...], n: int, times: np.ndarray) -> np.ndarray:
    """(shots, lamps, 3) gain."""
    one = np.ones((len(shots), n, 3))
    meter = b.normal() * one
    each = b.normal(n, 1) * one
    tint = b.normal(n, 1) * np.array([1.0, 0.0, -1.0]) * one
    # a diode is brightest when cold; the meter looked at it somewhere within
    cooling = np.exp(-times / b.rng.uniform(0.1, 0.5))
    warm = (cooling - cooling[len(times) // 2])[:, None, None] * b.rng.uniform(0.5, 1.5, (n, 1)) * 2 * one
    walk = np.cumsum(b.normal(len(shots), 1, 1), axis=0) / np.sqrt(len(shots)) * one
    # a supply that sags where several are on
    on = np.array([max(len(s.lamps) - 1, 0) for s in shots])[:, None, None] / max(n - 1, 1)
    sag = -2 * on * one * b.rng.uniform(0.3, 1.0)
    again = 0.5 * b.normal(len(shots), n, 1) * one
    return 1 + b.mixed(tolerance, [meter, each, tint, warm, walk, sag, again])


def frames(b: Budget, tolerance: float, shots: tuple[Shot, ...]) -> np.ndarray:
    """(shots, repeats) gain: from one frame of a burst to the next lamps are steadier than from shot to shot."""
    ripple = 0.1 * tolerance * b.rng.uniform(0, 1)
    return 1 + ripple * b.normal(len(shots), max(s.repeats for s in shots))


@dataclass(frozen=True, eq=False)
class Reflectances:
    """``even`` {matter: (3,)}, ``uneven`` {matter: (amplitude, k (3,) rad/m, phase)}."""

    even: dict[str, np.ndarray]
    uneven: dict[str, tuple[float, np.ndarray, float]]

    def __call__(self, bench: Bench, where: dict[str, np.ndarray]) -> np.ndarray:
        """(h, w, 3) gain."""
        out = np.ones((*where["part"].shape, 3), np.float32)
        for k, part in enumerate(bench.parts):
            if part.matter not in self.even:
                continue
            seen = where["part"] == k
            a, way, phase = self.uneven[part.matter]
            wave = a * np.cos(where["position"][seen] @ way + phase)
            out[seen] = self.even[part.matter] + wave[:, None]
        return out


def reflectances(b: Budget, tolerance: float, bench: Bench) -> Reflectances:
    names = [m.name for m in bench.matters]
    one = np.ones((len(names), 3))
    slope = np.array([1.2, 0.0, -1.2])
    batch = b.rng.integers(2, size=len(names))
    wave = 2 * one  # its peak counts, being somewhere
    parts = [
        b.normal() * one, b.normal(3) * one, b.normal(len(names), 1) * one, b.normal(len(names), 1) * slope * one,
        b.normal(2)[batch][:, None] * one, wave * b.rng.uniform(0.2, 0.7, (len(names), 1)),
    ]  # fmt: skip
    share = b.shares(len(parts))
    total = sum(w * np.abs(p) for w, p in zip(share, parts, strict=True))
    fit = 1 / max(1.0, float(np.max(total)) / (2 * b.more))
    even = fit * tolerance * np.asarray(sum(w * p for w, p in zip(share[:-1], parts[:-1], strict=True)))
    uneven = {}
    for k, name in enumerate(names):
        way = b.normal(3)
        way *= 2 * np.pi / b.rng.uniform(0.12, 0.4) / max(float(np.linalg.norm(way)), 1e-6)
        uneven[name] = (
            float(fit * tolerance * share[-1] * parts[-1][k, 0]),
            way,
            float(b.rng.uniform(0, 6.3)),
        )
    return Reflectances({name: 1 + even[k] for k, name in enumerate(names)}, uneven)

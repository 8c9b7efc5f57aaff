"""Forms of light and surfaces that need no rendering of their own. Who writes the diagnosis does not read this folder.

Each takes one lamp's light on the fine grid (``tracing.layer``), what the fine pixels look at (``tracing.guide``),
the bench, the lamp (None: the surroundings) and the cause.
"""

import numpy as np

from benchmarks.blind.bench import Bench, Lamp
from benchmarks.blind.cause import Cause

Layer = dict[str, np.ndarray]


def on(where: Layer, bench: Bench, matter: str) -> np.ndarray:
    """(h, w): where the material is seen."""
    return np.isin(where["part"], [k for k, p in enumerate(bench.parts) if p.matter == matter])


def _emitted(found: Layer, where: Layer, lamp: Lamp, c: Cause, law: str) -> Layer:
    """Exact for the light that met one surface; what met more has its mean factor."""
    d = where["position"] - np.array(lamp.position) / 1e3
    axis = np.array(c.shape["aim"]) - np.array(lamp.position)
    cos = (d @ axis) / np.maximum(np.linalg.norm(d, axis=-1) * np.linalg.norm(axis), 1e-9)
    theta = np.arccos(np.clip(cos, -1, 1))
    if law == "bell":
        factor = np.exp(-c.amplitude * theta**2)
    else:
        factor = 1 + c.amplitude * np.sin(np.minimum(theta, np.pi / 2)) ** 2 * np.cos(theta)
    direct = factor[..., None].astype(np.float32) * found["direct"]
    mean = float(direct.sum() / max(float(found["direct"].sum()), 1e-12))
    return {"direct": direct, "indirect": mean * found["indirect"]}


def narrow(found: Layer, where: Layer, bench: Bench, lamp: Lamp | None, c: Cause) -> Layer:
    """A lens on the chip: Gaussian in the angle, about an axis that misses the middle of the scene."""
    return found if lamp is None else _emitted(found, where, lamp, c, "bell")


def wings(found: Layer, where: Layer, bench: Bench, lamp: Lamp | None, c: Cause) -> Layer:
    """A bat-wing lens: brighter beside the axis than on it."""
    return found if lamp is None else _emitted(found, where, lamp, c, "wings")


def window(found: Layer, where: Layer, bench: Bench, lamp: Lamp | None, c: Cause) -> Layer:
    """Surroundings that are bright on one side: what faces it gets more, what faces away less."""
    if lamp is not None:
        return found
    facing = 1 + c.shape["lean"] * (where["normal"] @ np.array(c.shape["side"]))
    return {k: (v * facing[..., None]).astype(np.float32) for k, v in found.items()}


def patches(found: Layer, where: Layer, bench: Bench, lamp: Lamp | None, c: Cause) -> Layer:
    """Rubbed, greasy places: waves of many lengths over the surface, longer one way, clipped softly; a is about rms."""
    rng = np.random.default_rng(c.shape["seed"])
    p = 1e3 * where["position"].astype(float)
    total = np.zeros(p.shape[:2])
    grain = c.shape["grain"]
    for _ in range(36):
        length = np.exp(rng.uniform(np.log(8), np.log(90)))  # mm
        angle = grain + rng.normal(0, 0.5)  # the waves run across the grain
        k = 2 * np.pi / length * np.array([-np.sin(angle), np.cos(angle), rng.normal(0, 0.5)])
        total += np.sqrt(length) * np.cos(p @ k + rng.uniform(0, 2 * np.pi))
    total *= np.sqrt(2 / 36) / np.sqrt(35)  # the mean of the lengths drawn is about 35 mm
    gain = 1 + c.amplitude * np.tanh(1.5 * total) * on(where, bench, c.place)
    return {k: (v * np.maximum(gain, 0)[..., None]).astype(np.float32) for k, v in found.items()}

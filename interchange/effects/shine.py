"""Materials whose lobes are wider, stronger or stretched, with their textures."""

from dataclasses import replace
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.lobes import body_off, width_factors
from interchange.brdf.sum import Sum
from interchange.brdf.ward_anisotropic import WardAnisotropic
from interchange.effects.parts import scaled
from interchange.material import Material


def shone(material: Material, along: float, across: float, level: float) -> Material:
    """Lobes ``along`` and ``across`` times as wide, ``level`` times as strong."""
    factors = width_factors(material.brdf, along, across)
    brdf, strength = material.brdf, material.brdf.strength
    changed: dict[str, Any] = {n: np.asarray(getattr(brdf, n)) * f for n, f in factors.items()}
    boost = np.asarray(level)
    if brdf.height:  # the peak of a cosine lobe's light that stays the same: (n + 2) / 2π
        (exponent,) = brdf.width
        n, now = np.asarray(getattr(brdf, exponent)), np.asarray(changed[exponent])
        ratio = (now + 2) / (n + 2)
        boost = boost * (ratio[..., None] if ratio.ndim else ratio)
    if strength:
        changed[strength] = np.asarray(getattr(brdf, strength)) * boost
    maps = {
        name: scaled(t, factors[name]) if name in factors else scaled(t, level) if name == strength else t
        for name, t in material.maps.items()
    }
    new = replace(material, brdf=replace(brdf, **changed), maps=maps)  # type: ignore[type-var]
    return new if strength or level == 1 else _added(new, body_off(new.brdf), level - 1)


def stretched(material: Material, ratio: float) -> Material:
    """An elliptic lobe in exchange for a round one of the same width and light."""
    alpha, rho = _equivalent(material.brdf)
    round_, root = WardAnisotropic((0, 0, 0), rho, alpha, alpha), np.sqrt(ratio)
    long = replace(round_, alpha_x=float(np.clip(alpha * root, 1e-3, 1)),
                   alpha_y=float(np.clip(alpha / root, 1e-3, 1)))  # fmt: skip
    parts = (material.brdf, long, round_)
    weight = ((1.0,) * 3, (1.0,) * 3, (-1.0,) * 3)
    return replace(material, brdf=Sum(weight, parts), maps=_first(material))


def _added(material: Material, part: Brdf, weight: float) -> Material:
    """f + weight f_part, ``part`` under the same textures as far as it has their parameters."""
    maps = _first(material) | {
        f"part1_{n}": t for n, t in material.maps.items() if n != material.brdf.matte and n in part.slots()
    }
    return replace(material, brdf=Sum(((1.0,) * 3, (weight,) * 3), (material.brdf, part)), maps=maps)


def _first(material: Material) -> dict[str, Any]:
    return {f"part0_{name}": texture for name, texture in material.maps.items()}


def _equivalent(brdf: Brdf) -> tuple[float, tuple[float, float, float]]:
    """Ward's α and albedo of a round lobe like this one's: from the peak and the half width of its light around the
    mirror direction at 30 degrees."""
    theta = np.radians(30.0)
    wo = np.array([np.sin(theta), 0.0, np.cos(theta)])
    turn = np.radians(np.concatenate([[0.0], np.geomspace(0.2, 50, 200)]))
    tilted = np.stack([-np.sin(theta) * np.cos(turn), np.sin(turn), np.cos(theta) * np.cos(turn)], axis=-1)
    values = body_off(brdf).evaluate(tilted, wo)
    mean = values.mean(axis=-1)
    peak = values[0]
    # exp(-tan² δ / α²) has half its height where tan δ = α √ln 2; h turns by half of what wi does, over cos θ
    half = float(np.interp(-0.5 * mean[0], -mean, turn))
    delta = np.arctan(np.tan(half / 2) / np.cos(theta))
    alpha = float(np.clip(np.tan(delta) / np.sqrt(np.log(2)), 2e-3, 0.8))
    rho = peak * 4 * np.pi * alpha**2 * np.cos(theta)
    return alpha, tuple(float(x) for x in np.clip(rho, 0, 1))  # type: ignore[return-value]

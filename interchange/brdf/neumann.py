"""Neumann's metals: Phong's mirror lobe stretched towards grazing angles, on a Lambertian base.

    f = rho_d / pi + k_s (n + 2) / (2 pi) max(r . wo, 0)^n / max(wi.z, wo.z),    r = (-wi.x, -wi.y, wi.z)

The larger cosine in the denominator (max-Phong) keeps the lobe's albedo near k_s at all angles, as of a metal, where
Lafortune's plain lobe darkens towards grazing. At normal incidence it is k_s; it falls to k_s (n + 2) / (2 (n + 1))
at grazing incidence, where the horizon cuts the lobe in half. For n to infinity it is a mirror.

Reciprocal. The lobe alone never reflects more than k_s of what it receives (for n >= 1; a flatter one would, at
grazing angles); with rho_d the sum may exceed 1.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.cosine_power import cosine_power
from interchange.brdf.lambert import Color
from interchange.brdf.sampling import Lobe, Shape, mirror
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class Neumann(Brdf):
    source = "Neumann, Neumann, Szirmay-Kalos: Compact metallic reflectance models. Eurographics 1999."
    conserves_energy = False  # rho_d + k_s may exceed 1
    matte = "diffuse"
    strength = "k_s"
    width = widths(n=(-1, -1))

    diffuse: Color = parameter((0.05, 0.05, 0.05), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    k_s: Color = parameter((0.6, 0.6, 0.6), "k_s", "1", 0, 1, "albedo of the lobe, head-on", Kind.COLOR)
    n: float = parameter(50.0, "n", "1", 1, 1e4, "lobe exponent")

    def f(self, wi: Any, wo: Any) -> Any:
        x, y, z = wi[0] + wo[0], wi[1] + wo[1], wo[2] - wi[2]  # from the mirror direction to wo
        fall = 0.5 * (np.square(x) + np.square(y) + np.square(z))  # 1 - r . wo
        power = cosine_power(fall * (2.0 - fall), np.square(1.0 - fall), self.n)
        lobe = (self.n + 2.0) / (2.0 * np.pi) * np.where(fall < 1.0, power, 0.0) / np.maximum(wi[2], wo[2])
        return self.diffuse / np.pi + self.k_s * lobe  # type: ignore[operator]  # one channel

    def sampling(self, wo: Any) -> list[Lobe]:
        diffuse: Any = self.diffuse
        return [Lobe(0.02 + self.k_s, Shape.POWER, mirror(wo), self.n), Lobe(0.05 + diffuse)]  # type: ignore[operator]

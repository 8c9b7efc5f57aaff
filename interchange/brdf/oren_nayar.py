"""Rough matte surfaces: V-grooves of Lambertian facets with Gaussian slope angles; full model with interreflection.

    f = rho / pi (C1 + cos dphi C2 tan b + (1 - |cos dphi|) C3 tan((a + b) / 2))
        + 0.17 rho² / pi  sigma² / (sigma² + 0.13)  (1 - cos dphi (2 b / pi)²)
    C1 = 1 - sigma² / (2 (sigma² + 0.33))
    C2 = 0.45 sigma² / (sigma² + 0.09) (sin a - (0 if cos dphi >= 0 else (2 b / pi)³))
    C3 = 0.125 sigma² / (sigma² + 0.09) (4 a b / pi²)²

a, b: the larger and the smaller of the polar angles of wi and wo; dphi: their difference in azimuth. sigma = 0 is
Lambert. The fit of the paper falls below zero where sigma is above 0.6 and both directions graze opposite sides: it
is held at 0 there. Towards grazing angles it may return more light than it receives: of rho = 1 up to 1.05 times.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import polar_angle
from interchange.brdf.sampling import Lobe
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class OrenNayar(Brdf):
    source = "Oren and Nayar: Generalization of Lambert's reflectance model. SIGGRAPH 1994."
    conserves_energy = False
    matte = "rho"

    rho: Color = parameter((0.5, 0.5, 0.5), "ρ", "1", 0, 1, "albedo of a facet", Kind.COLOR)
    sigma: float = parameter(0.5, "σ", "rad", 0, np.pi / 2, "standard deviation of the facets' slope angles")

    def f(self, wi: Any, wo: Any) -> Any:
        rho: Any = self.rho
        sin_i, sin_o = (np.sqrt(np.square(w[0]) + np.square(w[1])) for w in (wi, wo))
        theta_i, theta_o = polar_angle(wi), polar_angle(wo)
        a, b = np.maximum(theta_i, theta_o), np.minimum(theta_i, theta_o)
        cos = (wi[0] * wo[0] + wi[1] * wo[1]) / np.maximum(sin_i * sin_o, 1e-12)
        cos = np.minimum(np.maximum(cos, -1.0), 1.0)

        variance = np.square(self.sigma)
        rough = variance / (variance + 0.09)
        low = 2.0 / np.pi * b
        back = np.where(cos >= 0.0, 0.0, np.square(low) * low)
        c1 = 1.0 - 0.5 * variance / (variance + 0.33)
        c2 = 0.45 * rough * (np.maximum(sin_i, sin_o) - back)
        c3 = 0.125 * rough * np.square(4.0 / np.pi**2 * a * b)
        tan_b = np.minimum(sin_i, sin_o) / np.maximum(wi[2], wo[2])
        tan_mean = (sin_i + sin_o) / (wi[2] + wo[2])
        once = c1 + cos * c2 * tan_b + (1.0 - np.absolute(cos)) * c3 * tan_mean
        twice = 0.17 * rho * variance / (variance + 0.13) * (1.0 - cos * np.square(low))
        return rho / np.pi * np.maximum(once + twice, 0.0)

    def sampling(self, wo: Any) -> list[Lobe]:
        return [Lobe(1.0)]

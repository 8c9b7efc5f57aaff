"""Ashikhmin and Premoze's BRDF made of a distribution of half vectors alone, on a Lambertian base.

    f = rho_d / pi + p(h) F(wo . h) / (4 (wi.z + wo.z - wi.z wo.z)),    F = f_0 + (1 - f_0) (1 - wo . h)^5

p is any density of h over the hemisphere (1/sr); it alone gives the highlight its shape, and the denominator stands
for shadowing and masking. The source reads p off measured retro-reflection; here it is a sum that can follow such
data: Gaussians of slope, each a density, and an even floor,

    p(h) = sum_l w_l exp(-(h.x²/sigma_x² + h.y²/sigma_y²) / h.z²) / (pi sigma_x sigma_y h.z³) + w_0 / (2 pi),

so that the integral of p is w_0 + sum w_l. The lobe reflects at most that much: wi.z / (wi.z + wo.z - wi.z wo.z) <= 1.
Reciprocal; energy is kept while rho_d + w_0 + sum w_l <= 1, which the bounds do not enforce.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import beckmann, fresnel_schlick, half_vector
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class AshikhminPremoze(Brdf):
    source = "Ashikhmin, Premoze: Distribution-based BRDFs. Technical report, University of Utah 2007."
    isotropic = False
    conserves_energy = False  # the weights are free
    matte = "diffuse"
    width = widths(sigma_x=(1, 0), sigma_y=(0, 1))

    diffuse: Color = parameter((0.2, 0.2, 0.2), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    f_0: Color = parameter((0.4, 0.4, 0.4), "f_0", "1", 0, 1, "Fresnel reflectance head-on", Kind.COLOR)
    floor: float = parameter(0.1, "w_0", "1", 0, 10, "share of half vectors spread evenly")
    weight: tuple[float, ...] = parameter((0.9,), "w", "1", 0, 10, "share of half vectors", per_lobe=True)
    sigma_x: tuple[float, ...] = parameter(
        (0.2,), "σ_x", "1", 0.01, 2, "slope width along the tangent", per_lobe=True
    )
    sigma_y: tuple[float, ...] = parameter(
        (0.1,), "σ_y", "1", 0.01, 2, "slope width along the bitangent", per_lobe=True
    )

    def f(self, wi: Any, wo: Any) -> Any:
        h, cos = half_vector(wi, wo)
        p: Any = self.floor / (2.0 * np.pi)
        for weight, along, across in zip(self.weight, self.sigma_x, self.sigma_y, strict=True):
            p = p + weight * beckmann(h, along, across) * h[2]
        shadowed = 4.0 * (wi[2] + wo[2] - wi[2] * wo[2])
        return self.diffuse / np.pi + p * fresnel_schlick(cos, self.f_0) / shadowed  # type: ignore[operator]

    def sampling(self, wo: Any) -> list[Lobe]:
        diffuse: Any = self.diffuse
        fresnel = fresnel_schlick(wo[2], self.f_0)
        lobes = [
            Lobe(0.02 + weight * fresnel, Shape.GGX, width=along, across=across)
            for weight, along, across in zip(self.weight, self.sigma_x, self.sigma_y, strict=True)
        ]
        return [*lobes, Lobe(0.05 + diffuse + self.floor * fresnel)]

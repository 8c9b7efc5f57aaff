"""Ashikhmin and Shirley's anisotropic Phong: an elliptic half-vector lobe with Fresnel over a matte base that it dims.

    f = f_s + f_d
    f_s = sqrt((n_u + 1) (n_v + 1)) / (8 pi)  h.z^e / ((wo . h) max(wi.z, wo.z))  F,
    e = (n_u h.x² + n_v h.y²) / (h.x² + h.y²),    F = R_s + (1 - R_s) (1 - wo . h)^5
    f_d = 28 R_d / (23 pi) (1 - R_s) (1 - (1 - wi.z / 2)^5) (1 - (1 - wo.z / 2)^5)

Equations 4 and 5 of the report with h the half vector. n_u, n_v narrow the highlight along tangent and bitangent.
The matte part takes only what the lobe leaves: its directional albedo R_d (1 - R_s) (1 - (1 - wo.z / 2)^5) vanishes
at grazing angles. The lobe reflects at most the mean of F over its half vectors. Both together stay below 1.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.cosine_power import cosine_power
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import Vector, fresnel_schlick, half_vector
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class AshikhminShirley(Brdf):
    source = "Ashikhmin, Shirley: An anisotropic Phong BRDF model. J. Graphics Tools 5(2), 2000."
    isotropic = False
    matte = "R_d"
    strength = "R_s"
    width = widths(n_u=(-2, 0), n_v=(0, -2))

    R_d: Color = parameter((0.4, 0.4, 0.4), "R_d", "1", 0, 1, "diffuse albedo below the lobe", Kind.COLOR)
    R_s: Color = parameter((0.05, 0.05, 0.05), "R_s", "1", 0, 1, "mirror reflectance head-on", Kind.COLOR)
    n_u: float = parameter(50.0, "n_u", "1", 0, 1e4, "lobe exponent along the tangent")
    n_v: float = parameter(200.0, "n_v", "1", 0, 1e4, "lobe exponent along the bitangent")

    def f(self, wi: Any, wo: Any) -> Any:
        r_d: Any = self.R_d
        r_s: Any = self.R_s
        h, cos = half_vector(wi, wo)
        lobe = np.sqrt((self.n_u + 1.0) * (self.n_v + 1.0)) / (8.0 * np.pi) * elliptic(h, self.n_u, self.n_v)
        specular = lobe / (cos * np.maximum(wi[2], wo[2])) * fresnel_schlick(cos, r_s)
        matte = (1.0 - np.power(1.0 - 0.5 * wi[2], 5.0)) * (1.0 - np.power(1.0 - 0.5 * wo[2], 5.0))
        return specular + 28.0 / (23.0 * np.pi) * r_d * (1.0 - r_s) * matte

    def sampling(self, wo: Any) -> list[Lobe]:
        r_d: Any = self.R_d
        r_s: Any = self.R_s
        across, along = (np.sqrt(2.0 / (n + 2.0)) for n in (self.n_v, self.n_u))
        specular = fresnel_schlick(wo[2], r_s)
        return [Lobe(0.02 + specular, Shape.GGX, width=along, across=across), Lobe(0.05 + r_d * (1.0 - r_s))]


def elliptic(h: Vector, n_u: Any, n_v: Any) -> Any:
    """h.z^((n_u h.x² + n_v h.y²) / (h.x² + h.y²)); 1 at the normal, where the quotient is 0 / 0."""
    sin2 = np.square(h[0]) + np.square(h[1])
    exponent = (n_u * np.square(h[0]) + n_v * np.square(h[1])) / np.maximum(sin2, 1e-20)
    return cosine_power(sin2, np.square(h[2]), exponent)

"""Mirror facets with Gaussian slope angles in V-shaped grooves: the first model with an off-specular peak.

    f = rho_d / pi + b F(wi.h) G exp(-c² angle(h)²) / (wi.z wo.z)
    G = min(1, 2 h.z wi.z / wi.h, 2 h.z wo.z / wi.h)

angle(h): between the facet's normal h and the surface's, in rad (the paper's c is per degree); F: Fresnel's
reflectance at the complex index eta + i k. The paper's radiance is divided by the irradiance, which adds 1 / wi.z; G
in the vector form of Blinn 1977. The factor b (facets in number times area) is free, so that energy is not kept:
b = c² / 4 pi, for c >> 1, would normalise the facets.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import fresnel_conductor, half_vector, polar_angle, v_grooves
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class TorranceSparrow(Brdf):
    source = (
        "Torrance and Sparrow: Theory for off-specular reflection from roughened surfaces. JOSA 57(9), 1967."
    )
    conserves_energy = False  # b is free
    matte = "diffuse"
    strength = "b"
    width = widths(c=(-0.5, -0.5))

    diffuse: Color = parameter((0.2, 0.2, 0.2), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    b: Color = parameter((0.5, 0.5, 0.5), "b", "1/sr", 0, 1e3, "area of facets", Kind.COLOR)
    c: float = parameter(2.9, "c", "1/rad", 0.5, 500, "narrowness of the facets' slopes")
    eta: Color = parameter((1.5, 1.5, 1.5), "η", "1", 0.01, 10, "index of refraction", Kind.COLOR)
    k: Color = parameter((0.0, 0.0, 0.0), "k", "1", 0, 20, "extinction coefficient", Kind.COLOR)

    def f(self, wi: Any, wo: Any) -> Any:
        diffuse: Any = self.diffuse
        h, cos = half_vector(wi, wo)
        facets = self.b * np.exp(-np.square(self.c * polar_angle(h)))
        shown = v_grooves(wi, wo, h, cos) / (wi[2] * wo[2])
        return diffuse / np.pi + facets * fresnel_conductor(cos, self.eta, self.k) * shown

    def sampling(self, wo: Any) -> list[Lobe]:
        diffuse: Any = self.diffuse
        b: Any = self.b
        width = 1.0 / self.c
        lobe = 4.0 * np.pi * b * np.square(width) * fresnel_conductor(wo[2], self.eta, self.k)
        return [
            Lobe(1e-3 + lobe, Shape.GGX, width=np.minimum(width, 1.0)),
            Lobe(1e-3 + diffuse + 0.2 * lobe),
        ]

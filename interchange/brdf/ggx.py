"""Mirror facets with the long-tailed distribution of Trowbridge and Reitz, by the name that Walter gave it.

    f = rho_d / pi + F(wi.h) D(h) G / (4 wi.z wo.z)
    D = 1 / (pi alpha_x alpha_y (h.x² / alpha_x² + h.y² / alpha_y² + h.z²)²)
    G = 1 / (1 + Lambda(wi) + Lambda(wo))                if correlated, else 1 / (1 + Lambda(wi)) / (1 + Lambda(wo))
    Lambda(w) = (sqrt(1 + (alpha_x² w.x² + alpha_y² w.y²) / w.z²) - 1) / 2

F: Fresnel's reflectance at the complex index eta + i k. Walter et al. hold shadowing and masking independent; that
the higher points of a surface are both lit and seen makes G larger and is closer to simulated surfaces (Heitz 2014),
hence the default. Light reflected twice between facets is lost either way: of a mirror with alpha = 1, seen head-on,
the share 1 - ln 2 = 0.31 is left. The facets alone keep energy at every angle.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import fresnel_conductor, ggx, half_vector, lambda_ggx
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter, setting


@dataclass(frozen=True)
class Ggx(Brdf):
    source = (
        "Trowbridge and Reitz: Average irregularity representation of a rough surface for ray reflection. JOSA "
        "65(5), 1975; Walter et al.: Microfacet models for refraction through rough surfaces. EGSR 2007."
    )
    isotropic = False
    conserves_energy = False  # the diffuse part is added without weakening it by what the facets reflect
    matte = "diffuse"
    width = widths(alpha_x=(1, 0), alpha_y=(0, 1))

    diffuse: Color = parameter((0.2, 0.2, 0.2), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    alpha_x: float = parameter(0.3, "α_x", "1", 1e-3, 1, "roughness along the tangent")
    alpha_y: float = parameter(0.3, "α_y", "1", 1e-3, 1, "roughness along the bitangent")
    eta: Color = parameter((1.5, 1.5, 1.5), "η", "1", 0.01, 10, "index of refraction", Kind.COLOR)
    k: Color = parameter((0.0, 0.0, 0.0), "k", "1", 0, 20, "extinction coefficient", Kind.COLOR)
    correlated: int = setting(1, "c", 0, 1, "1: heights lit and seen are correlated; 0: as Walter et al.")

    def f(self, wi: Any, wo: Any) -> Any:
        diffuse: Any = self.diffuse
        h, cos = half_vector(wi, wo)
        hidden_i, hidden_o = (lambda_ggx(w, self.alpha_x, self.alpha_y) for w in (wi, wo))
        g = 1.0 / (1.0 + hidden_i + hidden_o + (0.0 if self.correlated else hidden_i * hidden_o))
        facets = ggx(h, self.alpha_x, self.alpha_y) * g / (4.0 * wi[2] * wo[2])
        return diffuse / np.pi + fresnel_conductor(cos, self.eta, self.k) * facets

    def sampling(self, wo: Any) -> list[Lobe]:
        diffuse: Any = self.diffuse
        lobe = fresnel_conductor(wo[2], self.eta, self.k)
        return [
            Lobe(1e-3 + lobe, Shape.GGX, width=self.alpha_x, across=self.alpha_y),
            Lobe(1e-3 + diffuse + 0.1 * lobe),
        ]

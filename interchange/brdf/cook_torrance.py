"""Mirror facets with Beckmann's slopes in V-shaped grooves, coloured by Fresnel's reflectance.

    f = rho_d / pi + s F(wi.h) D(h) G / (4 wi.z wo.z)
    D = exp(-tan²(h) / m²) / (pi m² h.z^4),    G = min(1, 2 h.z wi.z / wi.h, 2 h.z wo.z / wi.h)

F: exact at the complex index eta + i k, one a channel; m: rms slope times sqrt 2. The paper writes F / pi and
leaves the pi out of D; with the 4 of the law of reflection, which its print of 1982 lacks, D is normalised and the
lobe alone (s = 1) reflects no more than it receives. Several m (the paper's sum of w_j D(m_j)) are a ``Sum``.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import beckmann, fresnel_conductor, half_vector, v_grooves
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class CookTorrance(Brdf):
    source = "Cook and Torrance: A reflectance model for computer graphics. ACM Trans. Graphics 1(1), 1982."
    conserves_energy = False  # the diffuse part is added without weakening it by what the facets reflect
    matte = "diffuse"
    strength = "s"
    width = widths(m=(0.5, 0.5))

    diffuse: Color = parameter((0.2, 0.2, 0.2), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    s: Color = parameter((1.0, 1.0, 1.0), "s", "1", 0, 1, "share of the facets", Kind.COLOR)
    m: float = parameter(0.3, "m", "1", 1e-3, 1, "slope of the facets, rms times √2")
    eta: Color = parameter((1.5, 1.5, 1.5), "η", "1", 0.01, 10, "index of refraction", Kind.COLOR)
    k: Color = parameter((0.0, 0.0, 0.0), "k", "1", 0, 20, "extinction coefficient", Kind.COLOR)

    def f(self, wi: Any, wo: Any) -> Any:
        diffuse: Any = self.diffuse
        h, cos = half_vector(wi, wo)
        shown = beckmann(h, self.m, self.m) * v_grooves(wi, wo, h, cos) / (4.0 * wi[2] * wo[2])
        return diffuse / np.pi + self.s * fresnel_conductor(cos, self.eta, self.k) * shown

    def sampling(self, wo: Any) -> list[Lobe]:
        diffuse: Any = self.diffuse
        lobe = self.s * fresnel_conductor(wo[2], self.eta, self.k)
        return [Lobe(1e-3 + lobe, Shape.GGX, width=self.m), Lobe(1e-3 + diffuse + 0.1 * lobe)]

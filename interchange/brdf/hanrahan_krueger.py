"""Hanrahan and Krueger's thin layer: light scattered once in a turbid film under a smooth boundary, over a matte base.

    f = F(wi.h) D(h) h.z / (4 (wo.h) max(wi.z, wo.z))
        + T(wi) T(wo) / eta² [ W p(cos j) (1 - e^(-tau (1/ci + 1/co))) / (ci + co) + rho_b / pi e^(-tau (1/ci + 1/co)) ]
    T = 1 - F at the boundary,    p = (1 - g²) / (4 pi (1 + g² - 2 g cos j)^(3/2))    (Henyey and Greenstein)

ci, co are the cosines of the refracted directions, j the angle by which light turns inside, tau the optical depth, W
the share that is scattered of what is lost, p its phase function (1/sr). rho_b is a Lambertian base, 0 for black. The
boundary's mirror term is a lobe of slope width alpha (Beckmann's D). The paper's T12 T21 holds eta² and 1 / eta²:
radiance grows on entering and shrinks on leaving; what is left for a BRDF is the 1 / eta² of a solid angle that opens.

Reciprocal. Every path is counted with no more than its own light, so no energy is gained; light that is scattered
twice, or reflected back inside by boundary or base, is lost: bright thick layers come out too dark.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import Vector, fresnel_dielectric, half_vector
from interchange.brdf.physical_optics import mirror_lobe
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class HanrahanKrueger(Brdf):
    source = (
        "Hanrahan, Krueger: Reflection from layered surfaces due to subsurface scattering. SIGGRAPH 1993."
    )

    W: Color = parameter((0.9, 0.8, 0.6), "W", "1", 0, 1, "single scattering albedo", Kind.COLOR)
    tau: Color = parameter((0.5, 0.5, 0.5), "τ_d", "1", 0, 50, "optical depth of the layer", Kind.COLOR)
    base: Color = parameter((0.5, 0.5, 0.5), "ρ_b", "1", 0, 1, "albedo of the base", Kind.COLOR)
    g: float = parameter(0.3, "g", "1", -0.95, 0.95, "mean cosine of the scattering angle")
    eta: float = parameter(1.4, "η", "1", 1, 3, "index of refraction of the layer")
    alpha: float = parameter(0.1, "α", "1", 0.01, 1, "slope width of the boundary's mirror lobe")

    def f(self, wi: Any, wo: Any) -> Any:
        albedo: Any = self.W
        base: Any = self.base
        h, cos = half_vector(wi, wo)
        surface = fresnel_dielectric(cos, self.eta) * mirror_lobe(wi, wo, h, cos, self.alpha)
        i, o = self._refracted(wi), self._refracted(wo)
        depth = self.tau * (1.0 / i[2] + 1.0 / o[2])
        kept = np.exp(-depth)
        lost = np.where(depth < 0.01, depth * (1.0 - depth * (0.5 - depth / 6.0)), 1.0 - kept)
        # 1 - cos j with cos j = -i.o, so that forward scattering does not cancel
        turn = 1.0 + i[0] * o[0] + i[1] * o[1] + i[2] * o[2]
        spread = np.square(1.0 - self.g) + 2.0 * self.g * turn
        phase = (1.0 - np.square(self.g)) / (4.0 * np.pi * spread * np.sqrt(spread))
        through = self._transmitted(wi) * self._transmitted(wo) / np.square(self.eta)
        return surface + through * (albedo * phase * lost / (i[2] + o[2]) + base / np.pi * kept)

    def _refracted(self, w: Vector) -> Vector:
        x, y = w[0] / self.eta, w[1] / self.eta
        return x, y, np.sqrt(np.maximum(1.0 - np.square(x) - np.square(y), 1e-12))

    def _transmitted(self, w: Vector) -> Any:
        return 1.0 - fresnel_dielectric(w[2], self.eta)

    def sampling(self, wo: Any) -> list[Lobe]:
        return [
            Lobe(0.05 + fresnel_dielectric(wo[2], self.eta), Shape.GGX, width=self.alpha),
            Lobe(0.5),
        ]

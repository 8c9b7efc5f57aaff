"""Ward's elliptical Gaussian lobe on a Lambertian base, for brushed surfaces.

    f = rho_d / pi + rho_s exp(-(h.x²/alpha_x² + h.y²/alpha_y²) / h.z²) / (4 pi alpha_x alpha_y sqrt(wi.z wo.z))

Equal widths are ``ward``, which says where light is lost and made. The exponent is the exact one, not the paper's
approximation of it for speed.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class WardAnisotropic(Brdf):
    source = "Ward: Measuring and modeling anisotropic reflection. SIGGRAPH 1992."
    isotropic = False
    conserves_energy = False
    matte = "diffuse"
    strength = "specular"
    width = widths(alpha_x=(1, 0), alpha_y=(0, 1))

    diffuse: Color = parameter((0.3, 0.3, 0.3), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    specular: Color = parameter((0.2, 0.2, 0.2), "ρ_s", "1", 0, 1, "albedo of the lobe", Kind.COLOR)
    alpha_x: float = parameter(0.1, "α_x", "1", 1e-3, 1, "slope along the tangent, rms times √2")
    alpha_y: float = parameter(0.3, "α_y", "1", 1e-3, 1, "slope along the bitangent, rms times √2")

    def f(self, wi: Any, wo: Any) -> Any:
        diffuse: Any = self.diffuse
        specular: Any = self.specular
        hx, hy, hz = (a + b for a, b in zip(wi, wo, strict=True))
        tan2 = (np.square(hx / self.alpha_x) + np.square(hy / self.alpha_y)) / np.square(hz)
        area = 4.0 * np.pi * self.alpha_x * self.alpha_y
        return diffuse / np.pi + specular * np.exp(-tan2) / (area * np.sqrt(wi[2] * wo[2]))

    def sampling(self, wo: Any) -> list[Lobe]:
        diffuse: Any = self.diffuse
        specular: Any = self.specular
        return [
            Lobe(1e-3 + specular, Shape.GGX, width=self.alpha_x, across=self.alpha_y),
            Lobe(1e-3 + diffuse + 0.1 * specular),
        ]

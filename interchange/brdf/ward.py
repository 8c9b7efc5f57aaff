"""Ward's Gaussian lobe on a Lambertian base, isotropic.

    f = rho_d / pi + rho_s exp(-tan²(h) / alpha²) / (4 pi alpha² sqrt(wi.z wo.z))

tan(h): of the angle between the half vector and the normal. Seen head-on a narrow lobe reflects rho_s,
at theta only rho_s cos theta; a broad one grows like 1 / sqrt(cos theta) in the end: with rho_s = 1 and alpha = 0.5
the albedo is above 1 at 89.9 degrees.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class Ward(Brdf):
    source = "Ward: Measuring and modeling anisotropic reflection. SIGGRAPH 1992."
    conserves_energy = False
    matte = "diffuse"
    strength = "specular"
    width = widths(alpha=(0.5, 0.5))

    diffuse: Color = parameter((0.3, 0.3, 0.3), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    specular: Color = parameter((0.2, 0.2, 0.2), "ρ_s", "1", 0, 1, "albedo of the lobe", Kind.COLOR)
    alpha: float = parameter(0.15, "α", "1", 1e-3, 1, "slope of the surface, rms times √2")

    def f(self, wi: Any, wo: Any) -> Any:
        diffuse: Any = self.diffuse
        specular: Any = self.specular
        hx, hy, hz = (a + b for a, b in zip(wi, wo, strict=True))
        tan2 = (np.square(hx) + np.square(hy)) / np.square(hz)
        alpha2 = np.square(self.alpha)
        lobe = np.exp(-tan2 / alpha2) / (4.0 * np.pi * alpha2 * np.sqrt(wi[2] * wo[2]))
        return diffuse / np.pi + specular * lobe

    def sampling(self, wo: Any) -> list[Lobe]:
        diffuse: Any = self.diffuse
        specular: Any = self.specular
        return [
            Lobe(1e-3 + specular, Shape.GGX, width=self.alpha),
            Lobe(1e-3 + diffuse + 0.1 * specular),
        ]

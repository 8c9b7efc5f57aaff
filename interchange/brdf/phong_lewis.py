"""Phong's mirror lobe, normalised and reciprocal, on a Lambertian base.

    f = rho_d / pi + rho_s (n + 2) / (2 pi) max(r . wo, 0)^n,    r = (-wi.x, -wi.y, wi.z)

Lit along the normal the lobe reflects exactly the share rho_s, from elsewhere less, as part of it falls below the
surface. Energy is kept where rho_d + rho_s <= 1, which the bounds do not force.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.sampling import Lobe, Shape, mirror
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class PhongLewis(Brdf):
    source = "Lewis: Making shaders more physically plausible. Computer Graphics Forum 13(2), 1994."
    conserves_energy = False  # rho_d + rho_s may exceed 1
    matte = "diffuse"
    strength = "specular"
    width = widths(n=(-1, -1))

    diffuse: Color = parameter((0.4, 0.4, 0.4), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    specular: Color = parameter((0.2, 0.2, 0.2), "ρ_s", "1", 0, 1, "albedo of the lobe", Kind.COLOR)
    n: float = parameter(20.0, "n", "1", 0, 1e4, "lobe exponent")

    def f(self, wi: Any, wo: Any) -> Any:
        diffuse: Any = self.diffuse
        specular: Any = self.specular
        cos = np.maximum(wi[2] * wo[2] - wi[0] * wo[0] - wi[1] * wo[1], 0.0)
        return diffuse / np.pi + specular * (self.n + 2.0) / (2.0 * np.pi) * np.power(cos, self.n)

    def sampling(self, wo: Any) -> list[Lobe]:
        diffuse: Any = self.diffuse
        specular: Any = self.specular
        return [
            Lobe(1e-3 + specular, Shape.POWER, mirror(wo), self.n),
            Lobe(1e-3 + diffuse + 0.1 * specular),
        ]

"""Phong's mirror lobe on a Lambertian base, as a BRDF.

    f = rho_d / pi + k_s max(r . wo, 0)^n / wi.z,    r = (-wi.x, -wi.y, wi.z)

Phong gave an amount of light, I = k_d cos + k_s cos^n(angle to the mirror direction); divided by the
cosine of incidence it is a BRDF that renders the same. It is not reciprocal and reflects more light than
it receives near grazing incidence: use Lafortune (mirror lobe) where energy counts.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.sampling import Lobe, Shape, mirror
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class Phong(Brdf):
    source = "Phong: Illumination for computer generated pictures. Comm. ACM 18(6), 1975."
    reciprocal = False
    conserves_energy = False
    matte = "diffuse"
    strength = "specular"
    height = True
    width = widths(n=(-1, -1))

    diffuse: Color = parameter((0.5, 0.5, 0.5), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    specular: Color = parameter((0.1, 0.1, 0.1), "k_s", "1/sr", 0, 100, "lobe height", Kind.COLOR)
    n: float = parameter(20.0, "n", "1", 0.01, 1e4, "lobe exponent")

    def f(self, wi: Any, wo: Any) -> Any:
        mirror = np.maximum(wi[2] * wo[2] - wi[0] * wo[0] - wi[1] * wo[1], 0.0)
        return self.diffuse / np.pi + self.specular * np.power(mirror, self.n) / wi[2]  # type: ignore[operator]

    def sampling(self, wo: Any) -> list[Lobe]:
        return [Lobe(0.9, Shape.POWER, mirror(wo), self.n), Lobe(0.1)]

"""Blinn's half-vector lobe with Phong's cosine power on a Lambertian base, as a BRDF.

    f = rho_d / pi + k_s max(h . n, 0)^n / wi.z,    h = (wi + wo) / |wi + wo|

The amount of light k_s cos^n is divided by the cosine of incidence, as in ``phong``, with the same limits.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class BlinnPhong(Brdf):
    source = "Blinn: Models of light reflection for computer synthesized pictures. SIGGRAPH 1977."
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
        hx, hy, hz = (a + b for a, b in zip(wi, wo, strict=True))
        cos = np.maximum(hz, 0.0) / np.sqrt(np.square(hx) + np.square(hy) + np.square(hz))
        return self.diffuse / np.pi + self.specular * np.power(cos, self.n) / wi[2]  # type: ignore[operator]

    def sampling(self, wo: Any) -> list[Lobe]:
        return [Lobe(0.9, Shape.BLINN, width=self.n), Lobe(0.1)]

"""UsdPreviewSurface by its specification: Schlick-Fresnel GGX lobe and clear coat over a matte base.

    f = (1 - metallic) diffuse / pi (1 - F) + F D G / (4 wi.z wo.z) + clearcoat F_c D_c G_c / (4 wi.z wo.z)
    F = F0 + (F90 - F0) (1 - wo.h)^5,   D = a² / (pi (sin² + a² cos²)²),   G = g(wi.z) g(wo.z),
    g(c) = c / (c (1 - k) + k),   a = roughness²,   k = a / 2,   angles of h to the normal

Metallic workflow: with s = mix(1, diffuse, metallic), F0 = mix(R² s, s, metallic), F90 = s, and
R = (1 - ior) / (1 + ior); specular workflow: F0 = specularColor, F90 = 1. The reference shader's 0.001 added
against division by zero, and its pi of four digits, are left out.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class UsdPreviewSurface(Brdf):
    source = (
        "UsdPreviewSurface specification 2.6 and its reference shader previewSurface.glslfx, openusd.org."
    )
    conserves_energy = False  # the clear coat is added without weakening what lies below
    matte = "diffuseColor"
    width = widths(roughness=(0.25, 0.25), clearcoatRoughness=(0.25, 0.25))

    diffuseColor: Color = parameter((0.18, 0.18, 0.18), "c_d", "1", 0, 1, "base colour", Kind.COLOR)
    useSpecularWorkflow: float = parameter(0.0, "w", "1", 0, 1, "1: specularColor rules; 0: metallic rules")
    specularColor: Color = parameter((0.0, 0.0, 0.0), "c_s", "1", 0, 1, "reflectance head-on", Kind.COLOR)
    metallic: float = parameter(0.0, "m", "1", 0, 1, "share of metal")
    roughness: float = parameter(0.5, "r", "1", 0, 1, "square root of the GGX width")
    clearcoat: float = parameter(0.0, "c_c", "1", 0, 1, "strength of the clear coat")
    clearcoatRoughness: float = parameter(0.01, "r_c", "1", 0, 1, "roughness of the clear coat")
    ior: float = parameter(1.5, "η", "1", 1, 10, "index of refraction")

    def f(self, wi: Any, wo: Any) -> Any:
        base: Any = self.diffuseColor
        head_on: Any = self.specularColor
        hx, hy, hz = (a + b for a, b in zip(wi, wo, strict=True))
        length2 = np.square(hx) + np.square(hy) + np.square(hz)
        cos2, sin2 = np.square(hz) / length2, (np.square(hx) + np.square(hy)) / length2
        cos_d = (wo[0] * hx + wo[1] * hy + wo[2] * hz) / np.sqrt(length2)
        schlick = np.power(np.maximum(1.0 - cos_d, 0.0), 5.0)

        r0 = np.square((1.0 - self.ior) / (1.0 + self.ior))
        tint = 1.0 - self.metallic + base * self.metallic
        metal_f0 = r0 * tint * (1.0 - self.metallic) + tint * self.metallic
        specular = self.useSpecularWorkflow
        f0 = specular * head_on + (1.0 - specular) * metal_f0
        f90 = specular + (1.0 - specular) * tint
        fresnel = f0 + (f90 - f0) * schlick
        matte = base / np.pi * (1.0 - (1.0 - specular) * self.metallic) * (1.0 - fresnel)

        coat = self.clearcoat * (r0 + (1.0 - r0) * schlick)
        return (
            matte
            + fresnel * _ggx(self.roughness, wi[2], wo[2], cos2, sin2)
            + coat * _ggx(self.clearcoatRoughness, wi[2], wo[2], cos2, sin2)
        )

    def sampling(self, wo: Any) -> list[Lobe]:
        base: Any = self.diffuseColor
        wide, narrow = (np.square(np.maximum(r, 0.03)) for r in (self.roughness, self.clearcoatRoughness))
        grazing = 0.3 * np.power(np.maximum(1.0 - wo[2], 0.0), 5.0)
        return [
            Lobe(0.1 + base * (1.0 - self.metallic)),
            Lobe(0.1 + base * self.metallic + grazing, Shape.GGX, width=wide),
            Lobe(0.2 * self.clearcoat, Shape.GGX, width=narrow),
        ]


def _ggx(roughness: Any, cos_i: Any, cos_o: Any, cos2: Any, sin2: Any) -> Any:
    """D G / (4 cos_i cos_o) in 1/sr."""
    alpha = np.square(np.maximum(roughness, 0.001))
    alpha2 = np.square(alpha)
    d = alpha2 / (np.pi * np.square(sin2 + alpha2 * cos2))
    k = 0.5 * alpha
    return d / (4.0 * (cos_i * (1.0 - k) + k) * (cos_o * (1.0 - k) + k))

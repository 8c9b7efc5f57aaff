"""Kurt, Szirmay-Kalos and Krivanek's anisotropic lobes for fitting, any number of them on a Lambertian base.

    f = rho_d / pi + sum_l k_l F_l(wo . h) D_l(h) / (4 (wo . h) (wi.z wo.z)^alpha_l)
    F_l = f_l + (1 - f_l) (1 - wo . h)^5
    D_l = exp(-(h.x²/m_x² + h.y²/m_y²) / h.z²) / (pi m_x m_y h.z^4)

Cook and Torrance's lobe whose shadowing is left to one exponent: alpha = 0 keeps the lobe's height towards grazing
angles, so that its albedo falls; alpha = 1/2, Ward's square root, keeps the albedo within 2 % up to 75 degrees for
m = 0.05; alpha = 1 doubles it at 60 degrees.

Reciprocal. Energy is not kept over the bounds: the weights are free, and for alpha > 0 the albedo grows without
limit in the last degrees before grazing (alpha = 1/2, m = 0.2: beyond 1 from 86 degrees on).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import beckmann, fresnel_schlick, half_vector
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class Kurt(Brdf):
    source = (
        "Kurt, Szirmay-Kalos, Krivanek: An anisotropic BRDF model for fitting and Monte Carlo rendering. "
        "ACM SIGGRAPH Computer Graphics 44(1), 2010."
    )
    isotropic = False
    conserves_energy = False  # the weights are free
    matte = "diffuse"
    strength = "weight"
    width = widths(m_x=(1, 0), m_y=(0, 1))

    diffuse: Color = parameter((0.2, 0.2, 0.2), "k_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    weight: tuple[Color, ...] = parameter(
        ((0.5, 0.5, 0.5),), "k_s", "1", 0, 10, "strength of the lobe", Kind.COLOR, per_lobe=True
    )
    f_0: tuple[float, ...] = parameter((0.4,), "f_0", "1", 0, 1, "Fresnel reflectance head-on", per_lobe=True)
    m_x: tuple[float, ...] = parameter(
        (0.2,), "m_x", "1", 0.01, 2, "slope width along the tangent", per_lobe=True
    )
    m_y: tuple[float, ...] = parameter(
        (0.1,), "m_y", "1", 0.01, 2, "slope width along the bitangent", per_lobe=True
    )
    alpha: tuple[float, ...] = parameter((0.5,), "α", "1", 0, 1, "exponent of both cosines", per_lobe=True)

    def f(self, wi: Any, wo: Any) -> Any:
        h, cos = half_vector(wi, wo)
        value = self.diffuse / np.pi + 0.0 * wi[2]  # type: ignore[operator]  # one channel
        lobes = zip(self.weight, self.f_0, self.m_x, self.m_y, self.alpha, strict=True)
        for weight, f_0, along, across, alpha in lobes:
            lobe = beckmann(h, along, across) / (4.0 * cos * np.power(wi[2] * wo[2], alpha))
            value = value + weight * fresnel_schlick(cos, f_0) * lobe
        return value

    def sampling(self, wo: Any) -> list[Lobe]:
        diffuse: Any = self.diffuse
        lobes = [
            Lobe(0.02 + weight * fresnel_schlick(wo[2], f_0), Shape.GGX, width=along, across=across)
            for weight, f_0, along, across in zip(self.weight, self.f_0, self.m_x, self.m_y, strict=True)
        ]
        return [*lobes, Lobe(0.05 + diffuse)]

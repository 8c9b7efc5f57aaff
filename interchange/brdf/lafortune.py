"""Lafortune's generalized cosine lobes on a Lambertian base.

    f = rho_d / pi + sum_i weight_i max(Cx_i wi.x wo.x + Cy_i wi.y wo.y + Cz_i wi.z wo.z, 0)^n_i

Cx = Cy = -1, Cz = 1 is Phong's mirror lobe; Cz > |Cx| lifts it off the mirror direction towards the normal;
Cx > 0 makes it retro-reflective; Cx != Cy makes it anisotropic.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class Lafortune(Brdf):
    source = "Lafortune et al.: Non-linear approximation of reflectance functions. SIGGRAPH 1997."
    isotropic = False
    conserves_energy = False  # weight and C are free
    example: ClassVar[Mapping[str, Any]] = {"weight": (0.8,), "C": ((-0.97, -0.97, 1.0),), "n": (30.0,)}
    matte = "diffuse"
    strength = "weight"
    height = True
    width = widths(n=(-1, -1))

    diffuse: Color = parameter((0.3, 0.3, 0.3), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    weight: tuple[Color, ...] = parameter((), "w", "1/sr", 0, 1e3, "lobe height", Kind.COLOR, per_lobe=True)
    C: tuple[Color, ...] = parameter(
        (), "C", "1", -2, 2, "lobe weights along tangent, bitangent, normal", Kind.VECTOR, per_lobe=True
    )
    n: tuple[float, ...] = parameter((), "n", "1", 0.01, 2e4, "lobe exponent", per_lobe=True)

    def f(self, wi: Any, wo: Any) -> Any:
        value = self.diffuse / np.pi + 0.0 * wi[2]  # type: ignore[operator]  # one channel
        for weight, (cx, cy, cz), n in zip(self.weight, self.C, self.n, strict=True):
            cos = cx * wi[0] * wo[0] + cy * wi[1] * wo[1] + cz * wi[2] * wo[2]
            value = value + weight * np.power(np.maximum(cos, 0.0), n)
        return value

    def sampling(self, wo: Any) -> list[Lobe]:
        lobes: list[Lobe] = []
        total: Any = 0.0
        for weight, (cx, cy, cz), n in zip(self.weight, self.C, self.n, strict=True):
            axis = (cx * wo[0], cy * wo[1], cz * wo[2])
            length = np.sqrt(np.square(axis[0]) + np.square(axis[1]) + np.square(axis[2]))
            # power of the lobe over the whole sphere: 2 pi / (n + 1) of its height
            height = 1e-6 + weight * np.power(length, n) / (n + 1.0)
            total = total + height
            lobes.append(Lobe(height, Shape.POWER, axis, n))
        return [*lobes, Lobe(0.1 * total)] if lobes else []

"""An ideal matte surface: the same radiance in every direction.

f = rho_d / pi
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.sampling import Lobe
from interchange.parameter import Kind, parameter

Color = tuple[float, float, float]


@dataclass(frozen=True)
class Lambert(Brdf):
    source = "Lambert: Photometria. Augsburg 1760."
    matte = "diffuse"

    diffuse: Color = parameter((0.5, 0.5, 0.5), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)

    def f(self, wi: Any, wo: Any) -> Any:
        return self.diffuse / np.pi + 0.0 * wi[2]  # type: ignore[operator]  # one channel

    def sampling(self, wo: Any) -> list[Lobe]:
        return []  # the path tracer's own matte surface

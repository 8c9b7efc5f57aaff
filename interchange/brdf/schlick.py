"""Schlick's inexpensive model of one layer: rational functions in place of Fresnel's, Smith's and Beckmann's.

    f = S(u) Z(t) A(w) G(wi.z) G(wo.z) / (4 pi wi.z wo.z)
    S(u) = C + (1 - C) (1 - u)^5,          u = wi.h
    Z(t) = r / (1 + r t² - t²)²,           t = h.z
    A(w) = sqrt(p / (p² - p² w² + w²)),    w = h.x / sqrt(h.x² + h.y²)
    G(v) = v / (r - r v + v)

r: roughness from 0 (mirror) to 1; p: isotropy, 1 where all azimuths are alike, towards 0 for scratches along the
tangent; w = 0 at h = n, where A has no limit and pinches the highlight. Z / pi is the distribution of Trowbridge and
Reitz with alpha² = r. With r for the width, G hides too little of narrow lobes near grazing angles: of white facets
(C = 1) the albedo is at most 1 up to 80 degrees, and at 89 degrees up to 2. Left out: the paper's second term (1 - G
G) / (4 pi wi.z wo.z) for light caught between the facets, whose albedo grows like 1 / (2 wo.z) towards grazing
angles, and its blend with an ideal mirror and with Lambert by r. A matte base, or the paper's second layer, are
added by ``Sum``.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import fresnel_schlick, half_vector
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class Schlick(Brdf):
    source = "Schlick: An inexpensive BRDF model for physically-based rendering. Eurographics 1994."
    isotropic = False
    conserves_energy = False
    width = widths(r=(1, 1))

    C: Color = parameter((0.5, 0.5, 0.5), "C", "1", 0, 1, "reflectance head-on", Kind.COLOR)
    r: float = parameter(0.1, "r", "1", 1e-5, 1, "roughness")
    p: float = parameter(1.0, "p", "1", 0.01, 1, "isotropy")

    def f(self, wi: Any, wo: Any) -> Any:
        h, u = half_vector(wi, wo)
        sin2 = np.square(h[0]) + np.square(h[1])
        zenith = self.r / np.square(sin2 + self.r * np.square(h[2]))
        w2 = np.where(sin2 > 1e-14, np.square(h[0]) / np.maximum(sin2, 1e-14), 0.0)
        p2 = np.square(self.p)
        azimuth = np.sqrt(self.p / (p2 - p2 * w2 + w2))
        shown = 1.0
        for v in (wi[2], wo[2]):
            shown = shown / (self.r - self.r * v + v)
        return fresnel_schlick(u, self.C) * zenith * azimuth * shown / (4.0 * np.pi)

    def sampling(self, wo: Any) -> list[Lobe]:
        width, ratio = np.sqrt(self.r), np.sqrt(self.p)
        across = np.minimum(width / ratio, 1.0)
        return [Lobe(0.9, Shape.GGX, width=width * ratio, across=across), Lobe(0.1)]

"""Poulin and Fournier's brushed surface: parallel cylinders side by side, along the tangent, on a flat floor.

    f = 1/s { 1 / (wi.z wo.z)  integral over phi of f_m(n) (n.wi) (n.wo)  +  f_m(z) l }
    f_m(n) = k_d / pi + k_s C (n.h)^m,    C = (m + 2) (m + 4) / (8 pi (2^(-m/2) + m)),    m the exponent
    n(phi) = (0, sin phi, cos phi)

Lengths are in radii of a cylinder. The floor lies ``h`` above the axes, with a gap ``d`` between neighbours, so that
the period is s = 2 sqrt(1 - h²) + d. The integral runs over the normals that are both lit and seen, one interval:
|phi| <= arccos h, within a quarter turn of either direction, and not behind the neighbour's tangent,
sin|phi - theta| <= s cos theta - 1 towards the side of the direction, at theta to z in the plane across the cylinders.
l is the width of the floor that is lit and seen. Each cylinder is one curved mirror: the highlight is a streak across
the tangent.

The matte part of the integral is in closed form; the glossy one, of cos^m(phi - phi_h) times both cosines, is taken
by 16 Gauss-Legendre nodes over five widths of the lobe, cut to the interval. The source gives intensities of Lambert's
and Blinn's rules on the cylinder; here its surface has a reciprocal BRDF, C (n.h)^m with albedo 1 head-on. Grooves
(cylinders cut out of the floor) are left out.

Reciprocal; k_d + k_s may exceed 1, each part alone keeps energy. Light is reflected once: what a cylinder throws onto
its neighbour is lost.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.cosine_power import cosine_power
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import Vector, half_vector
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)  # type: ignore[no-untyped-call]


@dataclass(frozen=True)
class PoulinFournier(Brdf):
    source = "Poulin, Fournier: A model for anisotropic reflection. SIGGRAPH 1990."
    isotropic = False
    conserves_energy = False  # k_d + k_s may exceed 1

    k_d: Color = parameter((0.2, 0.2, 0.2), "k_d", "1", 0, 1, "diffuse albedo of a cylinder", Kind.COLOR)
    k_s: Color = parameter((0.5, 0.5, 0.5), "k_s", "1", 0, 1, "specular albedo of a cylinder", Kind.COLOR)
    n: float = parameter(60.0, "n", "1", 1, 5000, "exponent of a cylinder's lobe")
    h: float = parameter(0.5, "h", "1", 0, 0.99, "height of the floor above the axes, in radii")
    d: float = parameter(0.2, "d", "1", 0, 10, "gap between cylinders at the floor, in radii")

    def f(self, wi: Any, wo: Any) -> Any:
        k_d: Any = self.k_d
        k_s: Any = self.k_s
        edge = np.sqrt(1.0 - np.square(self.h))  # where a cylinder meets the floor, from its axis
        period = 2.0 * edge + self.d
        across_i, theta_i, low_i, high_i, left_i, right_i = self._reach(wi, edge, period)
        across_o, theta_o, low_o, high_o, left_o, right_o = self._reach(wo, edge, period)
        top = np.arctan2(edge, self.h)  # shaders' arcus cosine is coarse
        low = np.maximum(np.maximum(low_i, low_o), -top)
        high = np.maximum(np.minimum(np.minimum(high_i, high_o), top), low)

        span = high - low
        swing = np.sin(span) * np.cos(low + high - theta_i - theta_o)
        matte = 0.5 * np.maximum(span * np.cos(theta_i - theta_o) + swing, 0.0)

        half, _ = half_vector(wi, wo)
        crest = np.arctan2(half[1], half[2])
        wide = np.minimum(0.5 * np.pi, 5.0 / np.sqrt(self.n))
        start, end = np.maximum(low - crest, -wide), np.minimum(high - crest, wide)
        middle, reach = 0.5 * (start + end), 0.5 * np.maximum(end - start, 0.0)
        gloss: Any = 0.0
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            psi = middle + float(node) * reach
            cosines = np.maximum(np.cos(psi + (crest - theta_i)), 0.0) * np.cos(psi + (crest - theta_o))
            lobe = cosine_power(np.square(np.sin(psi)), np.square(np.cos(psi)), self.n)
            gloss = gloss + float(weight) * lobe * np.maximum(cosines, 0.0)
        height = (self.n + 2.0) * (self.n + 4.0) / (8.0 * np.pi * (np.power(2.0, -0.5 * self.n) + self.n))
        x2, y2, z2 = (np.square(c) for c in half)
        gloss = k_s * height * cosine_power(x2, y2 + z2, self.n) * gloss * reach

        cap = (k_d / np.pi * matte + gloss) * across_i * across_o / (wi[2] * wo[2])
        gap = np.maximum(period - np.maximum(left_i, left_o) - np.maximum(right_i, right_o), 0.0)
        flat = k_d / np.pi + k_s * height * cosine_power(x2 + y2, z2, self.n)
        return (cap + flat * gap) / period

    def _reach(self, w: Vector, edge: Any, period: Any) -> tuple[Any, Any, Any, Any, Any, Any]:
        """Of a direction: its length across the cylinders and its angle there to z; the lowest and highest phi it
        reaches; how far from the left and the right axis the floor is shadowed."""
        across = np.maximum(np.sqrt(np.square(w[1]) + np.square(w[2])), 1e-6)
        theta = np.arctan2(w[1], w[2])
        cos, sin = w[2] / across, np.absolute(w[1]) / across
        blocked = cos < edge  # the neighbour's tangent stands above the floor
        limit = np.where(blocked, np.minimum(period * cos - 1.0, 1.0), 1.0)
        free = np.arctan2(limit, np.sqrt(np.maximum(1.0 - np.square(limit), 0.0)))
        shadow = np.where(blocked, (1.0 - self.h * sin) / cos, edge)
        right = w[1] >= 0.0
        return (
            across,
            theta,
            np.where(right, theta - 0.5 * np.pi, theta - free),
            np.where(right, theta + free, theta + 0.5 * np.pi),
            np.where(right, edge, shadow),
            np.where(right, shadow, edge),
        )

    def sampling(self, wo: Any) -> list[Lobe]:
        k_d: Any = self.k_d
        k_s: Any = self.k_s
        along = np.sqrt(2.0 / (self.n + 2.0))
        edge = np.sqrt(1.0 - np.square(self.h))
        flat = self.d / (2.0 * edge + self.d)
        return [
            Lobe(0.02 + k_s * (1.0 - flat), Shape.GGX, width=along, across=np.maximum(edge, along)),
            Lobe(0.02 + k_s * flat, Shape.GGX, width=along),
            Lobe(0.05 + k_d + 0.2 * k_s),
        ]

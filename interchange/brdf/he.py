"""He, Torrance, Sillion and Greenberg: reflection of a Gaussian rough surface by physical optics, for each wavelength.

    f = f_sp + f_dd + diffuse / pi
    f_sp = F S e^-g  D_s(h) h.z / (4 (wo.h) max(wi.z, wo.z))
    f_dd = F S / pi  G D / (wi.z wo.z),    G = ((v.v) / v.z)²,    v = wi + wo
    D    = (pi tau / 2 lambda)²  sum_{m >= 1} e^-g g^m / (m! m)  e^(-(pi tau / lambda)² (v.x² + v.y²) / m)
    g    = (2 pi sigma v.z / lambda)²,    F at half the angle between wi and wo

sigma_0 is the rms height, tau the distance over which heights correlate as exp(-(r / tau)²); the rms slope is
sqrt 2 sigma_0 / tau. sigma = sigma_0 / sqrt(1 + z²) is the height of what is neither shadowed nor masked, with
z e^(z² / 2) = (K(wi) + K(wo)) / sqrt(8 pi), K = tan erfc(tau cot / 2 sigma_0). S = S1(wi) S1(wo), Smith's
S1 = (1 - erfc(x) / 2) / (Lambda + 1), Lambda = (e^(-x²) / (x sqrt pi) - erfc(x)) / 2, x = tau cot / 2 sigma_0.

Light is unpolarised. The paper's G is a quotient of polarisation vectors over |wi x wo|^4 that cancels to the square
above; its exponents hold v in units of 2 pi / lambda; its Lambda lacks e^(-x²), by its errata. Its mirror term is a
delta function: here it is a lobe of slope width ``spread``, which stands for the solid angle of lamp or instrument.
The series is the one of ``physical_optics``. For g >> 1 this is Cook and Torrance's model with Beckmann's D of width
2 sigma_0 / tau.

Reciprocal. The specular parts of a perfect conductor reflect all light where slopes are gentle and lose some where
they are steep or tau is below the wavelength, and never more than 1.001 of it (sigma_0 from 0.002 to 1 wavelength,
tau from 0.05 to 36, up to 89.5 degrees, by quadrature). ``diffuse`` is added freely and may carry the sum beyond 1.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import erf

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import Vector, fresnel_conductor, half_vector
from interchange.brdf.physical_optics import lambert_w, mirror_lobe, series
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class He(Brdf):
    source = (
        "He, Torrance, Sillion, Greenberg: A comprehensive physical model for light reflection. SIGGRAPH 1991, "
        "with the errata of Pacanowski and Holzschuch."
    )
    conserves_energy = False  # the diffuse part is free
    matte = "diffuse"
    width = widths(tau=(-0.5, -0.5))

    diffuse: Color = parameter((0.0, 0.0, 0.0), "ρ_ud", "1", 0, 1, "uniform diffuse albedo", Kind.COLOR)
    sigma_0: float = parameter(180.0, "σ_0", "nm", 0.1, 2000, "rms height of the surface")
    tau: float = parameter(3000.0, "τ", "nm", 50, 2e4, "correlation length of the surface")
    wavelength: Color = parameter((610.0, 550.0, 465.0), "λ", "nm", 100, 2e4, "wavelength", Kind.COLOR)
    eta: Color = parameter((1.25, 0.97, 0.65), "n", "1", 0.01, 20, "index of refraction", Kind.COLOR)
    k: Color = parameter((7.3, 6.6, 5.5), "κ", "1", 0, 20, "index of extinction", Kind.COLOR)
    spread: float = parameter(0.02, "α_s", "1", 0.005, 0.2, "slope width of the mirror's image")

    def f(self, wi: Any, wo: Any) -> Any:
        wavelength: Any = self.wavelength
        h, cos = half_vector(wi, wo)
        shown = fresnel_conductor(cos, self.eta, self.k) * self._lit(wi) * self._lit(wo)
        vz = wi[2] + wo[2]
        z2 = lambert_w(np.square(self._hidden(wi) + self._hidden(wo)) / (8.0 * np.pi))
        g = np.square(2.0 * np.pi * self.sigma_0 / wavelength * vz) / (1.0 + z2)
        across = np.square(np.pi * self.tau / wavelength)
        d = 0.25 * across * series(g, across * (np.square(wi[0] + wo[0]) + np.square(wi[1] + wo[1])))
        directional = np.square(4.0 * np.square(cos) / vz) * d / (np.pi * wi[2] * wo[2])
        mirror = np.exp(-g) * mirror_lobe(wi, wo, h, cos, self.spread)
        return self.diffuse / np.pi + shown * (directional + mirror)  # type: ignore[operator]

    def _slope(self, w: Vector) -> tuple[Any, Any]:
        """tan of the angle to the normal and tau cot / (2 sigma_0)."""
        tan = np.sqrt(np.square(w[0]) + np.square(w[1])) / np.maximum(w[2], 1e-6)
        return tan, self.tau / (2.0 * self.sigma_0 * np.maximum(tan, 1e-6))

    def _lit(self, w: Vector) -> Any:
        """S1: the part of the surface that a direction reaches."""
        x = np.minimum(self._slope(w)[1], 10.0)
        erfc = 1.0 - erf(x)
        hidden = np.maximum(0.5 * (np.exp(-np.square(x)) / (np.sqrt(np.pi) * x) - erfc), 0.0)
        return (1.0 - 0.5 * erfc) / (1.0 + hidden)

    def _hidden(self, w: Vector) -> Any:
        """K of the apparent height."""
        tan, x = self._slope(w)
        return tan * np.maximum(1.0 - erf(np.minimum(x, 10.0)), 0.0)

    def sampling(self, wo: Any) -> list[Lobe]:
        wavelength: Any = self.wavelength
        diffuse: Any = self.diffuse
        g = np.square(4.0 * np.pi * self.sigma_0 / wavelength * wo[2])
        mirror = np.exp(-np.minimum(g, 50.0))
        # width of the sum's exponential at its heaviest term, in slopes of h
        width = np.sqrt(np.maximum(g, 1.0)) * wavelength / (2.0 * np.pi * self.tau * np.maximum(wo[2], 0.05))
        return [
            Lobe(mirror, Shape.GGX, width=self.spread),
            Lobe(1.0 - 0.95 * mirror, Shape.GGX, width=np.minimum(np.maximum(width, 0.02), 1.0)),
            Lobe(0.1 + diffuse),
        ]

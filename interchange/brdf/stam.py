"""Stam's diffraction by a rough surface whose heights are Gaussian, with a correlation that may differ by direction.

    f = F [ (1 + wi.wo)² / (lambda² v.z² wi.z wo.z)  S + e^-g  D_s(h) h.z / (4 (wo.h) max(wi.z, wo.z)) ]
    S = pi T_x T_y  sum_{m >= 1} e^-g g^m / (m! m)  e^(-(pi / lambda)² ((v.x T_x)² + (v.y T_y)²) / m)
    g = (2 pi sigma v.z / lambda)²,    v = wi + wo,    F at half the angle between wi and wo

S is the spectral density of exp(i phase) for rms height sigma and correlation exp(-(x / T_x)² - (y / T_y)²): the
diffracted part, without the delta function e^-g of the mirror direction, which here is a lobe of slope width
``spread``. T_x = T_y is the isotropic surface. A short correlation along the tangent spreads light along it, wider at
longer wavelengths.

Reciprocal. There is no shadowing: f grows as 1 / wo.z, and more light than received leaves at grazing angles.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf, widths
from interchange.brdf.lambert import Color
from interchange.brdf.microfacet import fresnel_conductor, half_vector
from interchange.brdf.physical_optics import mirror_lobe, series
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, parameter


@dataclass(frozen=True)
class Stam(Brdf):
    source = "Stam: Diffraction shaders. SIGGRAPH 1999."
    isotropic = False
    conserves_energy = False
    matte = "diffuse"
    width = widths(T_x=(-1, 0), T_y=(0, -1))

    diffuse: Color = parameter((0.02, 0.02, 0.02), "ρ_d", "1", 0, 1, "diffuse albedo", Kind.COLOR)
    sigma: float = parameter(100.0, "σ", "nm", 0.1, 2000, "rms height of the surface")
    T_x: float = parameter(1000.0, "T_x", "nm", 50, 2e4, "correlation length along the tangent")
    T_y: float = parameter(3000.0, "T_y", "nm", 50, 2e4, "correlation length along the bitangent")
    wavelength: Color = parameter((610.0, 550.0, 465.0), "λ", "nm", 100, 2e4, "wavelength", Kind.COLOR)
    eta: Color = parameter((1.25, 0.97, 0.65), "n", "1", 0.01, 20, "index of refraction", Kind.COLOR)
    k: Color = parameter((7.3, 6.6, 5.5), "κ", "1", 0, 20, "index of extinction", Kind.COLOR)
    spread: float = parameter(0.02, "α_s", "1", 0.005, 0.2, "slope width of the mirror's image")

    def f(self, wi: Any, wo: Any) -> Any:
        wavelength: Any = self.wavelength
        h, cos = half_vector(wi, wo)
        vz = wi[2] + wo[2]
        g = np.square(2.0 * np.pi * self.sigma / wavelength * vz)
        across = np.square((wi[0] + wo[0]) * (np.pi * self.T_x / wavelength))
        across = across + np.square((wi[1] + wo[1]) * (np.pi * self.T_y / wavelength))
        density = np.pi * (self.T_x / wavelength) * (self.T_y / wavelength) * series(g, across)
        diffracted = np.square(2.0 * np.square(cos) / vz) * density / (wi[2] * wo[2])
        mirror = np.exp(-g) * mirror_lobe(wi, wo, h, cos, self.spread)
        fresnel = fresnel_conductor(cos, self.eta, self.k)
        return self.diffuse / np.pi + fresnel * (diffracted + mirror)  # type: ignore[operator]

    def sampling(self, wo: Any) -> list[Lobe]:
        wavelength: Any = self.wavelength
        diffuse: Any = self.diffuse
        g = np.square(4.0 * np.pi * self.sigma / wavelength * wo[2])
        mirror = np.exp(-np.minimum(g, 50.0))
        # width of the sum's exponential at its heaviest term, in slopes of h
        width = np.sqrt(np.maximum(g, 1.0)) * wavelength / (2.0 * np.pi * np.maximum(wo[2], 0.05))
        along, across = (np.minimum(np.maximum(width / t, 0.02), 1.0) for t in (self.T_x, self.T_y))
        return [
            Lobe(mirror, Shape.GGX, width=self.spread),
            Lobe(1.0 - 0.95 * mirror, Shape.GGX, width=along, across=across),
            Lobe(0.1 + diffuse),
        ]

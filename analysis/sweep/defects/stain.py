"""A stain: a flat spot of another colour, with an uneven outline.

r(φ) = radius (1 + irregularity Σ_k a_k cos(k φ + φ_k)),   k = 2 .. 6, a and φ_k by ``seed``, Σ a_k² = 1;
area: π radius² (1 + irregularity² / 2).   f = cover ρ_stain / π + (1 - cover) f_surface
"""

from dataclasses import dataclass, replace

import numpy as np

from analysis.sweep.defect import SurfaceDefect
from analysis.sweep.footprint import Footprint
from interchange.brdf.lambert import Lambert
from interchange.brdf.sum import Sum
from interchange.material import Material
from interchange.parameter import Kind, parameter
from interchange.problems import BrightfieldError

WAVES = np.arange(2, 7)


@dataclass(frozen=True)
class Stain(SurfaceDefect):
    source = "Fourier descriptors: Zahn, Roskies: Fourier descriptors for plane closed curves. IEEE Trans. Comp. 1972."

    radius: float = parameter(1.5, "r", "mm", 1e-3, 1e4, "mean of its outline")
    irregularity: float = parameter(0.15, "i", "1", 0, 0.4, "how uneven its outline is")
    cover: float = parameter(0.8, "c", "1", 0, 1, "share of the surface that it covers")
    rho: tuple[float, float, float] = parameter(
        (0.03, 0.025, 0.02), "ρ", "1", 0, 1, "albedo of what it is of", Kind.COLOR
    )
    seed: float = parameter(0.0, "s", "1", 0, 2**31, "its outline, of those that there are; whole numbers")

    def footprint(self) -> Footprint:
        rng = np.random.default_rng(int(self.seed))
        a = rng.normal(size=len(WAVES)) / WAVES
        a *= self.irregularity / np.linalg.norm(a)
        phase = rng.uniform(0, 2 * np.pi, len(WAVES))
        radius = 1e-3 * self.radius

        def level(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            angle = np.arctan2(y, x)[..., None]
            return np.hypot(x, y) - radius * (1 + np.sum(a * np.cos(WAVES * angle + phase), axis=-1))

        most = 1 + float(np.abs(a).sum())
        # dr/dφ / r bounds the slope of the level beside 1, the radius itself from where it is not small
        slope = float(np.hypot(1, np.sum(np.abs(a) * WAVES) / max(2 - most, 0.1)))
        return Footprint(level, (most * radius, most * radius), radius / 20, slope=slope)

    def material(self, material: Material) -> Material:
        paint = Lambert(self.rho)
        if self.cover >= 1:
            return replace(material, name=f"{material.name}_stain", brdf=paint, maps={}, glsl="")
        if material.glsl:
            raise BrightfieldError(
                f"A stain on a look that is GLSL must cover all (cover 1); {material.name} has a fragment."
            )
        c = self.cover
        brdf = Sum(((1 - c,) * 3, (c,) * 3), (material.brdf, paint))
        maps = {f"part0_{name}": texture for name, texture in material.maps.items()}
        return replace(material, name=f"{material.name}_stain", brdf=brdf, maps=maps)

"""Blur as it was measured over the field: a Gaussian whose rms outward and around the axis are given at field radii.

Slanted edges along and across the radius of a test chart give both. Between radii the rms is linear; beyond the last
one it stays.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.filtering import applied
from interchange.image import Image
from interchange.local import Local
from interchange.parameter import ParameterError
from interchange.varying_psf import over_field, pupil

MOST = 100.0  # px


@dataclass(frozen=True)
class MeasuredBlur(Effect):
    """``sigmas``: field radius (half the image's diagonal is 1), σ outward px, σ around px; the next radius …"""

    stage = Stage.OPTICS
    order = 29
    source = "ISO 12233:2017, slanted edges at positions of the field; Burns: Slanted-edge MTF. PICS 2000."
    identified_by = "Edges blur as the lens's measured point spread says."
    confused_with = ("defocus", "diffraction")
    separated_by = "slanted edges over the whole image"
    achromatic = True
    carried_by = carried(sigmas="lens.measured_blur")

    sigmas: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        sigmas = tuple(float(x) for x in self.sigmas)
        radii, widths = sigmas[0::3], (*sigmas[1::3], *sigmas[2::3])
        if len(sigmas) % 3 or any(b <= a for a, b in pairwise(radii)):
            raise ParameterError(
                f"MeasuredBlur.sigmas must hold triples (radius, σ, σ) of rising radius; got {sigmas}."
            )
        if not all(0 <= w <= MOST for w in widths) or not all(0 <= r <= 10 for r in radii):
            raise ParameterError(f"MeasuredBlur.sigmas must lie in [0, {MOST:g}] px; got {sigmas}.")
        object.__setattr__(self, "sigmas", sigmas)

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        if not self.is_there:
            return image
        return replace(image, pixels=applied(image.pixels, [self.local(image, camera)]))

    def local(self, image: Image, camera: Camera) -> Local:
        K = camera.K
        return over_field(self.rays, camera.sensor.resolution, (K[0, 2], K[1, 2]))

    def rays(self, r: float) -> np.ndarray:
        """(n, 2) px, outward and around, of evenly likely places of the Gaussian, at field radius ``r``."""
        sigma = self.sigma(r)
        u, phi = pupil(int(4096 * np.clip(max(sigma) ** 2 / 4, 1, 16)))
        rho = np.sqrt(-2 * np.log1p(-(u**2)))
        return np.stack([sigma[0] * rho * np.cos(phi), sigma[1] * rho * np.sin(phi)], axis=-1)

    def sigma(self, r: float) -> tuple[float, float]:
        """Rms blur, px, outward and around, at field radius ``r``."""
        s = self.sigmas
        return float(np.interp(r, s[0::3], s[1::3])), float(np.interp(r, s[0::3], s[2::3]))

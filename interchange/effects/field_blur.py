"""Field curvature, astigmatism and coma: third-order aberrations blur more towards the corners.

A ray through the pupil at (ρ, φ) arrives, away from its point's centroid, in the image of a point at field radius r

    outward   ½ (d_0 + d_T r²) ρ cos φ + C r ρ² (2 + cos 2φ)
    around    ½ (d_0 + d_S r²) ρ sin φ + C r ρ² sin 2φ          r = 1 is half the image's diagonal

    variance  (d_0 + d_T r²)² / 16 + C² r² / 2  outward,  (d_0 + d_S r²)² / 16 + C² r² / 6  around

Field curvature is d_T = d_S; a focus put between middle and corner is d_0 of the other sign. Where ``defocus`` adds
depth of field from the pass ``depth``, it takes these aberrations with it, d_0 + c(z) in place of d_0; else the object
is flat and across the axis. Distortion stays the lens model's: points keep their
centroids.
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.effects.defocus import Defocus
from interchange.filtering import applied
from interchange.image import Image
from interchange.local import Local
from interchange.parameter import parameter
from interchange.varying_psf import over_field, pupil


@dataclass(frozen=True)
class FieldBlur(Effect):
    stage = Stage.OPTICS
    order = 28
    source = (
        "Welford: Aberrations of Optical Systems. Adam Hilger 1986, chapter 7 (transverse ray aberrations)."
    )
    identified_by = "Edges blur towards the image's corners, along the radius other than around it."
    confused_with = ("defocus", "motion_blur")
    separated_by = "a pattern of edges in all directions over the whole image"
    achromatic = True
    carried_by = carried(
        axis="lens.field_blur.0",
        tangential="lens.field_blur.1",
        sagittal="lens.field_blur.2",
        coma="lens.field_blur.3",
    )

    axis: float = parameter(
        0.0, "d_0", "px", -100, 100, "diameter of the disc on the axis; its sign is a side"
    )
    tangential: float = parameter(0.0, "d_T", "px", -100, 100, "diameter added at the corner, outward")
    sagittal: float = parameter(0.0, "d_S", "px", -100, 100, "diameter added at the corner, around the axis")
    coma: float = parameter(0.0, "C", "px", -50, 50, "third of the length of the comatic flare at the corner")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        if not self.is_there or Defocus.of(camera).adds_depth_of_field(image):
            return image
        return replace(image, pixels=applied(image.pixels, [self.over_field(camera)]))

    def local(self, image: Image, camera: Camera) -> Local:
        here = not Defocus.of(camera).adds_depth_of_field(image)
        return self.over_field(camera) if here else Local(0, 0, (None,))

    def over_field(self, camera: Camera) -> Local:
        K = camera.K
        return over_field(self.rays, camera.sensor.resolution, (K[0, 2], K[1, 2]))

    def rays(self, r: float) -> np.ndarray:
        """(n, 2) px, outward and around, of rays that fill the pupil, at field radius ``r``."""
        rho, phi = pupil()
        flare = self.coma * r * rho**2
        return np.stack(
            [
                (self.axis + self.tangential * r**2) / 2 * rho * np.cos(phi) + flare * (2 + np.cos(2 * phi)),
                (self.axis + self.sagittal * r**2) / 2 * rho * np.sin(phi) + flare * np.sin(2 * phi),
            ],
            axis=-1,
        )

    def sigma(self, r: float) -> tuple[float, float]:
        """Rms blur, px, outward and around, at field radius ``r``."""
        outward = (self.axis + self.tangential * r**2) ** 2 / 16 + (self.coma * r) ** 2 / 2
        around = (self.axis + self.sagittal * r**2) ** 2 / 16 + (self.coma * r) ** 2 / 6
        return float(np.sqrt(outward)), float(np.sqrt(around))

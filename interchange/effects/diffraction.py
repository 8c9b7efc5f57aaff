"""Blur by the lens's aperture: the Airy pattern, whose first dark ring has the radius 1.22 λ N on the sensor."""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage
from interchange.filtering import airy_kernel, each_channel
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class Diffraction(Effect):
    """Each channel by its own wavelength (``Sensor.wavelength_nm``); an image of one channel by the second one's."""

    stage = Stage.OPTICS
    order = 50
    source = (
        "Airy: On the diffraction of an object-glass with circular aperture. Trans. Camb. Phil. Soc. 5, 1835."
    )
    identified_by = "All edges blur alike, red ones more than blue ones, more with a smaller aperture."
    confused_with = ("defocus", "axial_chromatic_aberration")
    separated_by = "the same scene with the aperture two stops wider"

    f_stop: float = parameter(0.0, "N", "1", 0, 1e3, "working f-number; 0 is an aperture without bounds")

    @classmethod
    def of(cls, camera: Camera) -> "Diffraction":
        return cls(camera.lens.f_stop if camera.lens.diffraction else 0.0)

    def on(self, camera: Camera) -> Camera:
        lens = replace(camera.lens, diffraction=self.f_stop > 0, f_stop=self.f_stop or camera.lens.f_stop)
        return replace(camera, lens=lens)

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        return replace(image, pixels=each_channel(image.pixels, self.kernels(image, camera)))

    def kernels(self, image: Image, camera: Camera) -> list[np.ndarray]:
        pitch = float(np.mean(camera.sensor.pixel_pitch))
        wavelengths: tuple[float, ...] = camera.sensor.wavelength_nm
        if image.pixels.shape[2] != 3:
            wavelengths = wavelengths[1:2]
        return [airy_kernel(1e-9 * w * self.f_stop / pitch) for w in wavelengths]

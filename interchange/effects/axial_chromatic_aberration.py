"""The channels are in focus at different distances: each is blurred by a disc of its own diameter."""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.filtering import disc, each_channel
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class AxialChromaticAberration(Effect):
    """A focus shifted by δ behind the lens at f-number N blurs by δ / N (see ``diameters``)."""

    stage = Stage.OPTICS
    order = 30
    source = "Smith: Modern Optical Engineering, 4th ed., 2008, chapter 5."
    identified_by = "Edges blur in one channel more than in another, without a shift."
    confused_with = ("lateral_chromatic_aberration", "defocus")
    separated_by = "black and white edges at distances before and behind the focus"
    carried_by = carried(
        red="lens.axial_chromatic_aberration.0",
        green="lens.axial_chromatic_aberration.1",
        blue="lens.axial_chromatic_aberration.2",
    )

    red: float = parameter(0.0, "d_R", "px", 0, 100, "diameter of red's disc of confusion")
    green: float = parameter(0.0, "d_G", "px", 0, 100, "diameter of green's disc of confusion")
    blue: float = parameter(0.0, "d_B", "px", 0, 100, "diameter of blue's disc of confusion")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        return replace(image, pixels=each_channel(image.pixels, self.kernels(image, camera)))

    def kernels(self, image: Image, camera: Camera) -> list[np.ndarray]:
        diameters = (self.red, self.green, self.blue) if image.pixels.shape[2] == 3 else (self.green,)
        return [disc(d) for d in diameters]

    @classmethod
    def shifted(cls, camera: Camera, shifts: tuple[float, float, float]) -> "AxialChromaticAberration":
        """Of foci that lie ``shifts`` m behind the sensor (red, green, blue) at the lens's f-number."""
        pitch = float(np.mean(camera.sensor.pixel_pitch))
        return cls(*(abs(s) / camera.lens.f_stop / pitch for s in shifts))

"""The camera's colour matrix: DN above black of red, green, blue become others, by 3 x 3 numbers row by row."""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage
from interchange.image import Image
from interchange.parameter import Kind, parameter
from interchange.sensor import Color

ROWS = ("red", "green", "blue")


@dataclass(frozen=True)
class ColorCorrection(Effect):
    """``red``: what red, green and blue give to the new red; ``green`` and ``blue`` alike."""

    stage = Stage.READOUT
    order = 50
    source = "EMVA GenICam SFNC 2.7, 2022: ColorTransformationControl."
    identified_by = "DN above black of the channels are mixed by one matrix that no sensor has by itself."
    confused_with = ("color_crosstalk", "white_balance")
    separated_by = "saturated red, green and blue patches, raw and processed"
    pointwise = True

    red: Color = parameter((1, 0, 0), "M_R", "1", -64, 64, "new red of each channel", Kind.VECTOR)
    green: Color = parameter((0, 1, 0), "M_G", "1", -64, 64, "new green of each channel", Kind.VECTOR)
    blue: Color = parameter((0, 0, 1), "M_B", "1", -64, 64, "new blue of each channel", Kind.VECTOR)

    @classmethod
    def of(cls, camera: Camera) -> "ColorCorrection":
        m = camera.sensor.color_correction
        return cls(m[0:3], m[3:6], m[6:9])  # type: ignore[arg-type]

    def on(self, camera: Camera) -> Camera:
        sensor = replace(camera.sensor, color_correction=(*self.red, *self.green, *self.blue))
        return replace(camera, sensor=sensor)

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        if image.pixels.shape[2] != 3:
            return image
        from interchange import kernels  # Numba comes with it

        return replace(
            image, pixels=kernels.transformed(image.pixels, *self.transform(camera.sensor.black_level))
        )

    def transform(self, black: float) -> tuple[np.ndarray, np.ndarray]:
        """(3, 3) and (3,) float32: what DN are multiplied with, and what is added."""
        matrix = np.array([self.red, self.green, self.blue], np.float32)
        return matrix, (black * (1 - matrix.sum(axis=1))).astype(np.float32)

"""A channel of the sensor sees light of the others: a 3 x 3 matrix on electrons whose rows sum to 1.

red' = (1 - rg - rb) red + rg green + rb blue,   and so on: grey stays grey
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class ColorCrosstalk(Effect):
    stage = Stage.SENSOR
    order = 20
    source = (
        "Nakamura (ed.): Image Sensors and Signal Processing for Digital Still Cameras. CRC 2006, chapter 3."
    )
    identified_by = "Saturated colours are paler by the same matrix on every material; grey stays grey."
    confused_with = ("white_balance", "albedo", "light_spectrum")
    separated_by = "saturated red, green and blue patches in one image"
    pointwise = True
    physical: ClassVar = dict.fromkeys(
        ("rg", "rb", "gr", "gb", "br", "bg"), 0.0
    )  # light that leaks is not negative
    carried_by = carried(
        rg="sensor.color_crosstalk.0",
        rb="sensor.color_crosstalk.1",
        gr="sensor.color_crosstalk.2",
        gb="sensor.color_crosstalk.3",
        br="sensor.color_crosstalk.4",
        bg="sensor.color_crosstalk.5",
    )

    rg: float = parameter(0.0, "m_rg", "1", -1, 1, "share of green in red")
    rb: float = parameter(0.0, "m_rb", "1", -1, 1, "share of blue in red")
    gr: float = parameter(0.0, "m_gr", "1", -1, 1, "share of red in green")
    gb: float = parameter(0.0, "m_gb", "1", -1, 1, "share of blue in green")
    br: float = parameter(0.0, "m_br", "1", -1, 1, "share of red in blue")
    bg: float = parameter(0.0, "m_bg", "1", -1, 1, "share of green in blue")

    @property
    def matrix(self) -> np.ndarray:
        """(3, 3), to stand before a column of red, green, blue."""
        return np.array(
            [
                [1 - self.rg - self.rb, self.rg, self.rb],
                [self.gr, 1 - self.gr - self.gb, self.gb],
                [self.br, self.bg, 1 - self.br - self.bg],
            ]
        )

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        if image.pixels.shape[2] != 3:
            return image
        from interchange import kernels  # Numba comes with it

        matrix = self.matrix.astype(np.float32)
        return replace(image, pixels=kernels.transformed(image.pixels, matrix, np.zeros(3, np.float32)))

"""A gain for each channel's DN above black, as cameras have to make a lamp's white white."""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.effects.mosaic import phases
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class WhiteBalance(Effect):
    """On a raw mosaic each pixel takes its own channel's gain; an image of one channel is left as it is."""

    stage = Stage.READOUT
    order = 30
    source = "EMVA GenICam SFNC 2.7, 2022: BalanceRatio."
    identified_by = "Channels differ by one factor each, in every capture and on every material."
    confused_with = ("light_spectrum", "color_crosstalk", "albedo")
    separated_by = "a grey card under each lamp alone"
    pointwise = True
    carried_by = carried(
        red="sensor.white_balance.0", green="sensor.white_balance.1", blue="sensor.white_balance.2"
    )

    red: float = parameter(1.0, "w_R", "1", 0, 64, "gain of red")
    green: float = parameter(1.0, "w_G", "1", 0, 64, "gain of green")
    blue: float = parameter(1.0, "w_B", "1", 0, 64, "gain of blue")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        y, pattern = image.pixels, camera.sensor.mosaic
        black = np.float32(camera.sensor.black_level)
        gains = (self.red, self.green, self.blue)
        if y.shape[2] == 3:
            from interchange import kernels  # Numba comes with it

            gain = np.array(gains, np.float32)
            out = kernels.transformed(y, np.diag(gain), black * (1 - gain))
        elif pattern.is_bayer:
            gain = np.empty((2, y.shape[1]), np.float32)
            for i, j, channel in phases(pattern, image.first_row):
                gain[i, j::2] = gains[channel]
            out = y - black
            out[0::2] *= gain[0][:, None]
            out[1::2] *= gain[1][:, None]
            out += black
        else:
            return image
        return replace(image, pixels=out)

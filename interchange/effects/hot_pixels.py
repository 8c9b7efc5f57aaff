"""Few pixels whose dark current is far above the others': they grow brighter with the exposure time, also in the dark.

    e' = e + h(u) t_exp,    h > 0 in a ``share`` of the pixels, there exponential with mean ``current``; else 0

Their place and strength belong to the serial number. Photon noise is drawn after: it is that of the dark current too.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.effects.fixed_pattern import stream
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class HotPixels(Effect):
    stage = Stage.SENSOR
    order = 35
    source = (
        "Widenhorn, Blouke, Weber, Rest, Bodegom: Temperature dependence of dark current in a CCD. Proc. SPIE 4669, "
        "2002 (a tail of the dark current's histogram that falls exponentially)."
    )
    identified_by = "Single pixels are brighter in every image, more so with longer exposure."
    confused_with = ("fixed_pattern",)
    separated_by = "a long exposure with the lens covered"
    pointwise = True
    carried_by = carried(share="sensor.hot_pixels.0", current="sensor.hot_pixels.1")

    share: float = parameter(0.0, "p_hot", "1", 0, 1, "of the pixels that are hot")
    current: float = parameter(
        0.0, "µ_hot", "e-/s", 0, 1e9, "mean dark current of a hot pixel above the others'"
    )

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        if not self.share or not self.current:
            return image
        pixels = image.pixels.copy()
        self.add(pixels, camera, image.first_row)
        return replace(image, pixels=pixels)

    def add(self, pixels: np.ndarray, camera: Camera, first_row: int = 0) -> None:
        """To electrons (r, W) or (r, W, C) from the image's ``first_row`` on, in place."""
        width, height = camera.sensor.resolution
        channels = pixels.shape[2] if pixels.ndim == 3 else 1
        shape = (height, width, channels)
        place, strength = hot(camera.sensor.serial_number, self.share, shape)
        begin = first_row * width * channels
        here = slice(*np.searchsorted(place, [begin, begin + pixels.size]))
        electrons = (strength[here] * (self.current * camera.t_exp)).astype(np.float32)
        pixels.reshape(-1)[place[here] - begin] += electrons


@lru_cache(maxsize=4)
def hot(serial: str, share: float, shape: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Places in the flattened (H, W, C) image, rising, and dark currents over their mean."""
    rng = stream(serial, "hot")
    count = rng.binomial(int(np.prod(shape)), share)
    place = np.sort(rng.choice(int(np.prod(shape)), count, replace=False, shuffle=False))
    return place, rng.standard_exponential(count)

"""Lossy compression inside the camera: the image as it comes out of libjpeg again. 8 bits."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from interchange.bands import BAND, each_band
from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.parameter import parameter
from interchange.problems import BrightfieldError

BLOCK = 16  # rows of pixels that 4:2:0 codes together
ROWS = 32 * BLOCK  # of a band


@dataclass(frozen=True)
class Jpeg(Effect):
    stage = Stage.READOUT
    order = 70
    source = "ITU-T T.81 | ISO/IEC 10918-1, by libjpeg-turbo as OpenCV has it."
    identified_by = "Steps between blocks of 8 by 8 px, and little else than a few values inside them."
    confused_with = ("quantization", "sensor_noise")
    separated_by = "one capture without compression"
    carried_by = carried(quality="sensor.jpeg_quality", subsampling="sensor.jpeg_subsampling")

    quality: float = parameter(0.0, "Q", "1", 0, 100, "of libjpeg; 0 is no compression")
    subsampling: bool = True  # colour at half the resolution, 4:2:0; else 4:4:4

    @property
    def is_there(self) -> bool:
        return self.quality > 0

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        if not self.quality:
            return image
        if camera.sensor.bits_out != 8:
            raise BrightfieldError(
                f"A JPEG must have 8 bits; the sensor's image has {camera.sensor.bits_out}."
            )
        y = np.clip(np.rint(image.pixels), 0, 255).astype(np.uint8)
        return replace(image, pixels=self.compressed(y).astype(np.float32))

    def compressed(self, y: np.ndarray) -> np.ndarray:
        """(H, W, C) uint8 as it comes out of the file again.

        In bands of whole blocks, each with one more block above and below: a block's coefficients depend on its own
        pixels, and colour at half the resolution is drawn larger by the next row alone. The file's coding of them
        loses nothing.
        """
        out = np.empty_like(y)
        height = len(y)

        def work(start: int, stop: int) -> None:
            low, high = max(start - BLOCK, 0), min(stop + BLOCK, height)
            part = decoded(self.encoded(Image(y[low:high])))
            out[start:stop] = part[start - low : stop - low]

        each_band(work, height, BAND // ROWS)
        return out

    def encoded(self, image: Image) -> bytes:
        """The file: DN of 8 bits, grey or RGB."""
        y = image.pixels
        if y.dtype != np.uint8:
            y = np.clip(np.rint(y), 0, 255).astype(np.uint8)
        y = cv2.cvtColor(y, cv2.COLOR_RGB2BGR) if y.shape[2] == 3 else y
        factor = (
            cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420 if self.subsampling else cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444
        )
        options = [cv2.IMWRITE_JPEG_QUALITY, int(self.quality), cv2.IMWRITE_JPEG_SAMPLING_FACTOR, factor]
        return bytes(cv2.imencode(".jpg", y, options)[1])


def decoded(file: bytes) -> np.ndarray:
    """(H, W, 1) or (H, W, 3) uint8, RGB."""
    y = cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_UNCHANGED)
    return y[..., None] if y.ndim == 2 else cv2.cvtColor(y, cv2.COLOR_BGR2RGB)

"""Light that lens surfaces and barrel scatter over the image.

E' = (1 - g) E + g mean(E),   the mean over the image, or over a Gaussian neighbourhood where ``radius`` is given
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from interchange.bands import each_band
from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.filtering import BORDER
from interchange.image import Image
from interchange.parameter import parameter

COARSE = 8.0  # px rms that the neighbourhood has where it is computed


@dataclass(frozen=True)
class VeilingGlare(Effect):
    stage = Stage.OPTICS
    order = 70
    source = (
        "ISO 9358:1994; Talvala, Adams, Horowitz, Levoy: Veiling glare in high dynamic range imaging. "
        "ACM Trans. Graphics 26(3), 2007."
    )
    identified_by = "A pedestal that follows the mean brightness of the scene."
    confused_with = ("black_level", "ambient_light", "interreflection")
    separated_by = "the same scene at a quarter of the exposure, and a capture with the lens covered"
    achromatic = True
    carried_by = carried(g="lens.veiling_glare.0", radius="lens.veiling_glare.1")

    g: float = parameter(0.0, "g", "1", 0, 1, "share of the light that is scattered")
    radius: float = parameter(
        0.0, "σ_g", "1", 0, 1, "how far, rms, over the image's diagonal; 0 is everywhere alike"
    )

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        E = np.ascontiguousarray(image.pixels)
        h, w, channels = E.shape
        if not self.radius:
            mean = np.array(cv2.mean(E)[:channels], np.float32)
            return replace(image, pixels=_mixed(E, np.tile(mean, w)[None], self.g))
        cells = self.cells(h, w)
        coarse = cv2.resize(E, cells[::-1], interpolation=cv2.INTER_AREA).reshape(*cells, channels)
        spread = cv2.resize(self.spread(coarse, h, w), (w, h), interpolation=cv2.INTER_LINEAR).reshape(h, -1)
        return replace(image, pixels=_mixed(E, spread, self.g))

    def cells(self, height: int, width: int) -> tuple[int, int]:
        """Rows and columns of the coarse image that the neighbourhood is computed on."""
        if not self.radius:
            return 1, 1
        step = max(1.0, self.radius * float(np.hypot(height, width)) / COARSE)
        return max(1, round(height / step)), max(1, round(width / step))

    def spread(self, coarse: np.ndarray, height: int, width: int) -> np.ndarray:
        """The veil of a coarse image (h, w, C), itself as coarse."""
        if not self.radius:
            return coarse
        sigma = self.radius * float(np.hypot(height, width)) * coarse.shape[1] / width
        return np.asarray(cv2.GaussianBlur(coarse, (0, 0), sigma, borderType=BORDER)).reshape(coarse.shape)


def _mixed(E: np.ndarray, veil: np.ndarray, g: float) -> np.ndarray:
    """(1 - g) E + g veil; ``veil`` (H, W C), or (1, W C) for all rows."""
    out = np.empty_like(E)
    rows, into = E.reshape(len(E), -1), out.reshape(len(E), -1)

    def work(start: int, stop: int) -> None:
        part = into[start:stop]
        np.multiply(rows[start:stop], np.float32(1 - g), out=part)
        part += np.float32(g) * (veil if len(veil) == 1 else veil[start:stop])

    each_band(work, len(E), rows.shape[1])
    return out

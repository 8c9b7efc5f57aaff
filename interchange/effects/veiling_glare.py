"""Light that lens surfaces and barrel scatter over the image.

E' = (1 - g - h) E + g mean(E) + h/4 Σ_k G_k * E - l/4 Σ_k G_k * (E beside the image)

G_k: Gaussians of ``reach`` times 1/2, 1, 2 and 4. Together they fall off about as a power of the distance, as measured
scatter does. Beside the image all is taken to shine as it does along its border, mirrored; where it is dark there
l = h, and no surroundings give more.
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

COARSE = 4.0  # px rms that the narrowest Gaussian has where it is computed
REACH = 0.05
SCALES = (0.5, 1.0, 2.0, 4.0)


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
    carried_by = carried(
        g="lens.veiling_glare.0",
        halo="lens.veiling_glare.1",
        reach="lens.veiling_glare.2",
        lost="lens.veiling_glare.3",
    )

    g: float = parameter(0.0, "g", "1", 0, 1, "share of the light that is scattered everywhere alike")
    halo: float = parameter(0.0, "h", "1", 0, 1, "share of the light that is scattered around where it fell")
    reach: float = parameter(0.0, "σ_h", "1", 0, 1, "how far, rms, over the image's diagonal; 0 is 0.05")
    lost: float = parameter(
        0.0, "l", "1", 0, 1, "share of the light that the halo lacks, as less comes from beside the image"
    )

    @property
    def share(self) -> float:
        """Of the light, that does not arrive where it should."""
        return self.g + self.halo

    @property
    def is_even(self) -> bool:
        """Whether what is scattered is the same everywhere."""
        return not self.halo and not self.lost

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        E = np.ascontiguousarray(image.pixels)
        h, w, channels = E.shape
        if self.is_even:
            mean = np.float32(self.g) * np.array(cv2.mean(E)[:channels], np.float32)
            return replace(image, pixels=_mixed(E, np.tile(mean, w)[None], self.share))
        cells = self.cells(h, w)
        coarse = cv2.resize(E, cells[::-1], interpolation=cv2.INTER_AREA).reshape(*cells, channels)
        spread = cv2.resize(self.spread(coarse, h, w), (w, h), interpolation=cv2.INTER_LINEAR).reshape(h, -1)
        return replace(image, pixels=_mixed(E, spread, self.share))

    def cells(self, height: int, width: int) -> tuple[int, int]:
        """Rows and columns of the coarse image that the scattered light is computed on."""
        if self.is_even:
            return 1, 1
        step = max(1.0, SCALES[0] * (self.reach or REACH) * float(np.hypot(height, width)) / COARSE)
        return max(1, round(height / step)), max(1, round(width / step))

    def spread(self, coarse: np.ndarray, height: int, width: int) -> np.ndarray:
        """The scattered light of a coarse image (h, w, C), itself as coarse."""
        mean = coarse.mean(axis=(0, 1), dtype=np.float32)
        veil = np.full(coarse.shape, self.g, np.float32) * mean
        if self.is_even:
            return np.asarray(veil)
        h, w = coarse.shape[:2]
        for scale in SCALES:
            sigma = scale * (self.reach or REACH) * float(np.hypot(height, width)) * w / width
            less = max(1.0, sigma / COARSE)
            cells = max(1, round(w / less)), max(1, round(h / less))
            small = cv2.resize(coarse, cells, interpolation=cv2.INTER_AREA)
            narrow = sigma * cells[0] / w
            around = cv2.GaussianBlur(small, (0, 0), narrow, borderType=BORDER)
            own = np.float32(self.halo / len(SCALES)) * around
            if self.lost:
                within = cv2.GaussianBlur(small, (0, 0), narrow, borderType=cv2.BORDER_CONSTANT)
                own -= np.float32(self.lost / len(SCALES)) * (around - within)
            veil += cv2.resize(own, (w, h), interpolation=cv2.INTER_LINEAR).reshape(coarse.shape)
        return np.asarray(veil)


def _mixed(E: np.ndarray, veil: np.ndarray, share: float) -> np.ndarray:
    """(1 - share) E + veil; ``veil`` (H, W C), or (1, W C) for all rows."""
    out = np.empty_like(E)
    rows, into = E.reshape(len(E), -1), out.reshape(len(E), -1)

    def work(start: int, stop: int) -> None:
        part = into[start:stop]
        np.multiply(rows[start:stop], np.float32(1 - share), out=part)
        part += veil if len(veil) == 1 else veil[start:stop]

    each_band(work, len(E), rows.shape[1])
    return out

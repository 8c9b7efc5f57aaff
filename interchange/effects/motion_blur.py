"""What moves while the shutter is open is drawn along its path, around where it is in the middle of the exposure.

The path of every pixel is the pass ``motion`` (px until the next frame) times the share of the frame that the
shutter is open; where all light comes from one flash, the part of it that the flash lights. A camera that moves or a
web that runs past it gives one path (u, v) to the whole image. An image without the pass is of a scene that stands
still. Exact, for paths that cross each other too, are renderings of moments (interchange.moments).
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage
from interchange.filtering import convolve, line, resample
from interchange.image import Image
from interchange.lamps.exposed import lit
from interchange.parameter import parameter

MOST_STEPS = 64  # along a path; it is sampled twice a pixel up to there


@dataclass(frozen=True)
class MotionBlur(Effect):
    stage = Stage.OPTICS
    order = 12
    source = "Potmesil, Chakravarty: Modeling motion blur in computer-generated images. SIGGRAPH 1983."
    identified_by = (
        "Edges across one direction blur, those along it stay; it grows with the exposure time, unless it is of a "
        "vibration that is done with many times in each."
    )
    confused_with = ("defocus", "rolling_shutter", "anisotropy")
    separated_by = "the same scene with a tenth of the exposure time and ten times the light"
    achromatic = True
    grows_with_exposure = ("u", "v")

    u: float = parameter(0.0, "u", "px", -1e3, 1e3, "columns that the image moves during the exposure")
    v: float = parameter(0.0, "v", "px", -1e3, 1e3, "rows that the image moves during the exposure")
    shutter: float = parameter(
        0.0, "s", "1", 0, 1e3, "exposure time over the time that pass motion stands for"
    )

    @classmethod
    def of(cls, camera: Camera) -> "MotionBlur":
        return cls(shutter=camera.t_exp * camera.sensor.frame_rate)

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        pixels = image.pixels
        if self.u or self.v:
            pixels = convolve(pixels, line(self.u, self.v))
        if self.shutter and (motion := image.passes.get("motion")) is not None:
            pixels = _along(image, pixels, np.nan_to_num(motion * np.float32(self.shutter)))
        return replace(image, pixels=pixels)

    def kernels(self, image: Image, camera: Camera) -> list[np.ndarray] | None:
        if self.shutter and "motion" in image.passes:
            return None
        return [line(self.u, self.v) if self.u or self.v else np.ones((1, 1), np.float32)]


def _along(image: Image, pixels: np.ndarray, path: np.ndarray) -> np.ndarray:
    longest = float(np.abs(path).max(initial=0.0))
    if longest < 1e-3:
        return pixels
    low, high = (t.astype(np.float32)[:, None] for t in lit(image))
    steps = int(np.clip(np.ceil(2 * longest * float((high - low).max())), 4, MOST_STEPS))
    column, row = np.meshgrid(
        np.arange(pixels.shape[1], dtype=np.float32), np.arange(pixels.shape[0], dtype=np.float32)
    )
    total = np.zeros_like(pixels)
    for part in (np.arange(steps) + 0.5) / steps:
        t = low + np.float32(part) * (high - low) - np.float32(0.5)
        cv2.accumulate(resample(pixels, column - t * path[..., 0], row - t * path[..., 1]), total)
    return total / np.float32(steps)

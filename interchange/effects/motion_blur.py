"""What moves while the shutter is open is drawn along its path, around where it is in the middle of the exposure.

The path of every pixel is the pass ``motion`` (px until the next frame) times the share of the frame that the
shutter is open; where all light comes from one flash, the part of it that the flash lights. An image without the pass
is of a scene that stands still. Exact, for paths that cross each other too, are renderings of moments
(interchange.moments).

A camera that moves or a web that runs past it gives one straight path to the whole image:

    (u, v) + (speed_u, speed_v) · exposure time

of which (u, v) is there in every exposure, as a vibration's is that is done with many times in each. Its speed may
change on the way, as that of a machine does that sets off or settles: by a factor of exp(``acceleration``) from start
to end, evenly by its logarithm, and the mean of the path stays where it is; what a flash lights of it runs at constant
speed. A path at constant speed does not tell
which way along it the image runs: the rows of a rolling shutter lean by the pass alone.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import cv2
import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.filtering import convolve, line, resample
from interchange.image import Image
from interchange.lamps.exposed import STROBED, lit
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
    per_second: ClassVar[dict[str, str]] = {"u": "speed_u", "v": "speed_v"}
    carried_by = carried(
        u="sensor.image_path.0",
        v="sensor.image_path.1",
        speed_u="sensor.image_speed.0",
        speed_v="sensor.image_speed.1",
        acceleration="sensor.image_acceleration",
    )

    u: float = parameter(0.0, "u", "px", -1e3, 1e3, "columns that the image moves during any exposure")
    v: float = parameter(0.0, "v", "px", -1e3, 1e3, "rows that the image moves during any exposure")
    speed_u: float = parameter(0.0, "u'", "px/s", -1e9, 1e9, "columns that the image moves a second")
    speed_v: float = parameter(0.0, "v'", "px/s", -1e9, 1e9, "rows that the image moves a second")
    acceleration: float = parameter(
        0.0, "a", "1", -8, 8, "logarithm of the speed at the path's end over that at its start"
    )
    shutter: float = parameter(
        0.0, "s", "1", 0, 1e3, "exposure time over the time that pass motion stands for"
    )

    @classmethod
    def of(cls, camera: Camera) -> "MotionBlur":
        return replace(super().of(camera), shutter=camera.t_exp * camera.sensor.frame_rate)

    def path(self, camera: Camera) -> tuple[float, float]:
        """(u, v) px that the image moves by while the camera exposes it."""
        return self.u + self.speed_u * camera.t_exp, self.v + self.speed_v * camera.t_exp

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        pixels = image.pixels
        u, v = (self.u, self.v) if self._flashes(image) else self.path(camera)
        if u or v:
            pixels = convolve(pixels, line(u, v, self.acceleration))
        moved = np.zeros((*pixels.shape[:2], 2), np.float32)
        if self._has_pass(image):
            moved += np.nan_to_num(image.passes["motion"] * np.float32(self.shutter))
        if self._flashes(image):
            moved += np.float32(camera.t_exp) * np.array([self.speed_u, self.speed_v], np.float32)
        return replace(image, pixels=_along(image, pixels, moved))

    def kernels(self, image: Image, camera: Camera) -> list[np.ndarray] | None:
        if self._has_pass(image) or self._flashes(image):
            return None
        u, v = self.path(camera)
        return [line(u, v, self.acceleration) if u or v else np.ones((1, 1), np.float32)]

    def _has_pass(self, image: Image) -> bool:
        return bool(self.shutter) and "motion" in image.passes

    def _flashes(self, image: Image) -> bool:
        """Whether the image runs on while a flash lights a part of the exposure alone."""
        return bool(self.speed_u or self.speed_v) and STROBED in image.made_by


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

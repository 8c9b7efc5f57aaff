"""Rows are exposed one after the other: row r shows the scene r · t_line later than row 0.

Where a point is by then follows from the pass ``motion`` (px until the next frame) and the frame rate, or from one
velocity (u, v) px/s of the whole image. An image without either is of a scene that stands still. Exact, for what
comes out from behind something too, are renderings of moments (interchange.moments).
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.filtering import BORDER, resample
from interchange.image import Image
from interchange.lamps.exposed import lit
from interchange.parameter import parameter


@dataclass(frozen=True)
class RollingShutter(Effect):
    stage = Stage.OPTICS
    order = 10
    source = "Meingast, Geyer, Sastry: Geometric models of rolling-shutter cameras. OmniVis 2005."
    identified_by = "Vertical edges of what moves lean by the row; what stands still is unchanged."
    confused_with = ("motion_blur", "camera_pose")
    separated_by = "the same scene standing still"
    achromatic = True
    carried_by = carried(line_time="sensor.line_time", frame_rate="sensor.frame_rate")

    line_time: float = parameter(0.0, "t_l", "s", 0, 10, "a row starts that much after the one above")
    frame_rate: float = parameter(0.0, "f_p", "1/s", 0, 1e6, "frames a second that pass motion stands for")
    u: float = parameter(0.0, "u", "px/s", -1e9, 1e9, "columns that the whole image moves")
    v: float = parameter(0.0, "v", "px/s", -1e9, 1e9, "rows that the whole image moves")

    @property
    def is_there(self) -> bool:
        return self.line_time > 0

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        motion = image.passes.get("motion")
        if motion is None and not (self.u or self.v):
            return image
        if motion is not None and np.nanmax(np.abs(motion), initial=0.0) * self.frame_rate > 0:
            lit(image)  # bands stay where they are, whatever moves
        height, width = image.pixels.shape[:2]
        column, row = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
        late = row * np.float32(self.line_time)
        velocity = np.broadcast_to(np.array([self.u, self.v], np.float32), (height, width, 2)).copy()
        if motion is not None:
            velocity += np.nan_to_num(motion) * np.float32(self.frame_rate)
        x, y = column - velocity[..., 0] * late, row - velocity[..., 1] * late
        for _ in range(3):  # the velocity is that of the point which arrives, where the image shows it
            there = cv2.remap(velocity, x, y, cv2.INTER_LINEAR, borderMode=BORDER)
            x, y = column - there[..., 0] * late, row - there[..., 1] * late
        return replace(image, pixels=resample(image.pixels, x, y))

"""How long, and how late by row, a frame is exposed, where that is not what the scene says of the camera."""

from dataclasses import dataclass, replace

from interchange.camera import Camera


@dataclass(frozen=True)
class Shutter:
    """``t_exp``: s that the shutter is open; ``line_time``: s that a row starts after the one above. None: the
    camera's own."""

    t_exp: float | None = None
    line_time: float | None = None

    def on(self, camera: Camera) -> Camera:
        if self.t_exp is not None:
            camera = replace(camera, t_exp=self.t_exp)
        if self.line_time is not None:
            camera = replace(camera, sensor=replace(camera.sensor, line_time=self.line_time))
        return camera

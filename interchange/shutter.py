"""How a frame is exposed: how long, how late by row, and by how many renderings."""

from dataclasses import dataclass, replace

from interchange.camera import Camera


@dataclass(frozen=True)
class Shutter:
    """``t_exp``: s that the shutter is open; ``line_time``: s that a row starts after the one above. None: the
    camera's own. ``moments``: renderings over the exposure that make up the image (interchange.moments)."""

    t_exp: float | None = None
    line_time: float | None = None
    moments: int = 1

    def on(self, camera: Camera) -> Camera:
        if self.t_exp is not None:
            camera = replace(camera, t_exp=self.t_exp)
        if self.line_time is not None:
            camera = replace(camera, sensor=replace(camera.sensor, line_time=self.line_time))
        return camera

"""What a client sets of a live camera: one record, replaced as a whole, so that no frame sees half a change."""

from dataclasses import dataclass, replace

from interchange.camera import Camera
from interchange.parameter import freeze, parameter
from interchange.problems import BrightfieldError
from interchange.sensor import Sensor
from realtime.virtual_camera.pixel_format import PixelFormat, formats


@dataclass(frozen=True)
class Settings:
    """``region`` (x, y, width, height): px of the sensor that are read out. ``triggered``: a frame a trigger, instead
    of ``frame_rate`` of them a second; triggers come from a timer every ``trigger_period`` s, or from software where
    that is 0."""

    format: PixelFormat
    region: tuple[int, int, int, int]
    t_exp: float = parameter(1e-2, "t_exp", "s", 1e-6, 1e3, "exposure time")
    gain_dB: float = parameter(0.0, "g", "dB", -60, 120, "gain before the converter")
    frame_rate: float = parameter(30.0, "f_p", "1/s", 1e-3, 1e5, "frames a second")
    triggered: bool = False
    trigger_period: float = parameter(
        0.0, "t_t", "s", 0, 1e3, "from trigger to trigger of the timer; 0: software"
    )

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def period(self) -> float:
        """s from frame to frame: a sensor that still collects light cannot begin the next frame."""
        timed = self.triggered and self.trigger_period > 0
        return max(self.trigger_period if timed else 1 / self.frame_rate, self.t_exp)

    @property
    def waits(self) -> bool:
        """For a trigger of software."""
        return self.triggered and self.trigger_period == 0

    def check(self, sensor: Sensor) -> "Settings":
        """Raises BrightfieldError where the sensor has no such region or format."""
        self.format.of(sensor)
        width, height = sensor.resolution
        x, y, w, h = self.region
        step = 2 if self.format.mosaic.is_bayer else 1
        if min(x, y) < 0 or min(w, h) < 1 or x + w > width or y + h > height:
            raise BrightfieldError(
                f"A region must lie on the sensor's {width} x {height} px; got {w} x {h} at ({x}, {y})."
            )
        if x % step or y % step:
            raise BrightfieldError(
                f"A region of {self.format.name} must begin at even pixels; got ({x}, {y})."
            )
        return self

    def on(self, camera: Camera) -> Camera:
        """The camera as it takes a frame: all of its sensor, of which ``region`` is read out."""
        sensor = replace(
            self.format.of(camera.sensor), gain_dB=self.gain_dB, frame_rate=0.0
        )  # blur by motion is of several renderings, not of the pass
        return replace(camera, sensor=sensor, t_exp=self.t_exp)


def settings_of(camera: Camera) -> Settings:
    """What the scene file says of the camera."""
    width, height = camera.sensor.resolution
    return Settings(
        formats(camera.sensor)[0],
        (0, 0, width, height),
        camera.t_exp,
        camera.sensor.gain_dB,
        camera.sensor.frame_rate or 30.0,
    )

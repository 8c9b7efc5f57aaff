"""A camera of a scene that is there now, used as ``cv2.VideoCapture`` is: ``read``, ``get``, ``set``, ``release``.

Every frame is drawn, exposed on the simulated sensor with its noise, numbered, stamped, and told the truth about.
"""

import threading
import time
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import TracebackType
from typing import Any

import numpy as np

from interchange.camera import Camera
from interchange.exposure import expose
from interchange.image import Image, check_passes
from interchange.moments import over_exposure
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from realtime.virtual_camera import properties
from realtime.virtual_camera.drawing import Draw, Drawing
from realtime.virtual_camera.frame import Frame, Truth
from realtime.virtual_camera.moving_scene import Moment, MovingScene
from realtime.virtual_camera.pace import Pace, Timing
from realtime.virtual_camera.pixel_format import formats, named
from realtime.virtual_camera.settings import Settings, settings_of
from realtime.virtual_camera.shutter_path import longest_path, renderings

MOMENTS = 8  # renderings an exposure, at most

PER_PIXEL = ("depth", "position", "normal", "object_id", "material_id")  # maps that a frame can have


class VirtualCamera:
    """``scene``: one that stands still, or a ``MovingScene``, which other cameras may look at too. ``camera``: its
    name; without one the only one.

    A scene that is not ``live`` has a clock of frames: frame n is taken at (n - 1) periods, ``read`` never waits, and
    the same calls give the same numbers. A live one goes by the clock on the wall: ``read`` waits for the next frame's
    time, as a camera does. ``samples`` a pixel (realtime.renderers.rasterizer); ``noise`` False gives the mean of many
    frames; ``seed`` another run of noise. ``maps`` are passes that each frame carries besides (``object_id``,
    ``depth``, ...). ``draw`` stands for the rasteriser. ``timeout`` s: how long ``read`` waits for a trigger.

    What the time line and belts move while the shutter is open is blurred, and leans where rows are exposed one after
    the other: up to ``moments`` renderings a pixel apart make the exposure (interchange.moments), as many as that
    takes; 1 is frozen.

    Methods may be called from any thread. BrightfieldError where the scene has no such camera, or it cannot be one.
    """

    def __init__(
        self,
        scene: Scene | MovingScene,
        camera: str = "",
        *,
        live: bool = False,
        samples: int = 4,
        noise: bool = True,
        seed: int = 0,
        maps: Sequence[str] = (),
        draw: Draw | None = None,
        timeout: float = 5.0,
        moments: int = MOMENTS,
        **settings: Any,
    ) -> None:
        if moments < 1:
            raise BrightfieldError(f"An exposure takes at least 1 rendering; got {moments}.")
        self.scene = scene if isinstance(scene, MovingScene) else MovingScene(scene, live=live)
        if unknown := set(check_passes(list(maps))) - set(PER_PIXEL):
            raise BrightfieldError(
                f"A frame can carry {', '.join(PER_PIXEL)}; got {', '.join(sorted(unknown))}."
            )
        record = self.scene.at(0.0).scene.camera(camera)
        self.name, self.sensor, self.maps = record.name, record.sensor, tuple(maps)
        self.noise, self.seed, self.timeout, self.moments = noise, seed, timeout, moments
        self._settings = settings_of(record)
        self._own = None if draw else Drawing(samples)
        self._draw: Draw = draw or self._own  # type: ignore[assignment]
        self._pace = Pace()
        self._triggers = 0
        self._lock, self._taking, self._changed = threading.RLock(), threading.Lock(), threading.Condition()
        self._open = True
        self._number, self._seconds = 0, 0.0
        self._taken: tuple[Truth, Settings, Moment] | None = None
        self._frame: Frame | None = None
        self.configure(**settings)

    # cv2.VideoCapture

    def read(self) -> tuple[bool, np.ndarray | None]:
        """The next frame as OpenCV has it: (H, W), or (H, W, 3) in B, G, R; uint8 or uint16. (False, None) after
        ``release``, and where no trigger came in time. BrightfieldError where the scene cannot be drawn."""
        with self._lock:
            return self.retrieve() if self.grab() else (False, None)

    def grab(self) -> bool:
        """Take the next frame: the moment is fixed, the picture is made by ``retrieve``."""
        with self._lock:
            with self._changed:  # a frame is of the settings before a change, or of those after it
                seconds = self._wait()
                if seconds is None:
                    return False
                self._number += 1
                number, settings = self._number, self._settings
            self._expose(number, seconds, settings)
            return True

    def _wait(self) -> float | None:
        """Until the next frame is due, or triggered; a change of settings holds at once. The scene's time of the
        frame: when it was due, by which all cameras of a scene agree, however late this machine is. None: it never
        came."""
        until = time.monotonic() + self.timeout
        while self._open:
            settings, now = self._settings, self.scene.elapsed()
            if settings.waits:
                if self._triggers:
                    self._triggers -= 1
                    return self._pace.took(now, now, settings.period) if self.scene.live else self._seconds
                left = until - time.monotonic()
                if left <= 0:
                    return None
            elif self.scene.live:
                due = self._pace.due(settings.period, now)
                left = due - now
                if left <= 0:
                    return self._pace.took(now, due, settings.period)
            else:
                return self._seconds
            self._changed.wait(left)
        return None

    def retrieve(self) -> tuple[bool, np.ndarray | None]:
        """The picture of the frame that ``grab`` took; the same one if asked again."""
        with self._lock:
            if not self._open or self._taken is None:
                return False, None
            return True, self.develop().bgr

    def get(self, prop: int) -> float:
        """A property by OpenCV's number (``cv2.CAP_PROP_EXPOSURE`` s, ``CAP_PROP_GAIN`` dB, ...); 0 for one that a
        live camera does not have. realtime.virtual_camera.properties lists them."""
        return properties.get(self, prop)

    def set(self, prop: int, value: float) -> bool:
        """Whether the property could be set so."""
        return properties.put(self, prop, value)

    def isOpened(self) -> bool:
        return self._open

    def getBackendName(self) -> str:
        return "BRIGHTFIELD"

    def release(self) -> None:
        """Wakes whoever waits for a frame."""
        with self._changed:
            self._open = False
            self._changed.notify_all()
        if self._own is not None:
            self._own.release()

    # what cv2.VideoCapture has not

    @property
    def settings(self) -> Settings:
        return self._settings

    def configure(self, **changes: Any) -> Settings:
        """Change settings by name (``t_exp=``, ``gain_dB=``, ``frame_rate=``, ``region=``, ``triggered=``,
        ``trigger_period=``, ``format=`` by name too), all or none; they hold from the next exposure on.
        BrightfieldError where one cannot be."""
        if isinstance(changes.get("format"), str):
            changes["format"] = named(changes["format"])
        if "region" in changes:
            changes["region"] = tuple(int(x) for x in changes["region"])
        with self._changed:
            before, self._settings = self._settings, replace(self._settings, **changes).check(self.sensor)
            if self._settings.waits and not before.waits:
                self._triggers = 0
            self._changed.notify_all()
            return self._settings

    @property
    def begun(self) -> int:
        """Number of the frame that was begun last, 0 before any; later ones have the settings that hold now."""
        with self._changed:
            return self._number

    @property
    def position(self) -> tuple[int, float]:
        """Number of the frame that was taken last (0: none yet), and the scene's s then."""
        with self._taking:  # a frame is taken, or it is not
            taken = self._taken
        return (taken[0].number, taken[0].seconds) if taken else (0, 0.0)

    @property
    def jpeg_quality(self) -> int:
        """What the scene file says of the camera's compression; 0: nothing. Transports that compress use it."""
        return self.sensor.jpeg_quality

    @property
    def formats(self) -> tuple[str, ...]:
        """Names of the pixel formats that the sensor can give."""
        return tuple(f.name for f in formats(self.sensor))

    def trigger(self) -> None:
        """One frame, where the camera is ``triggered``; each trigger gives one, in turn."""
        with self._changed:
            self._triggers += 1
            self._changed.notify_all()

    def _expose(self, number: int, seconds: float, settings: Settings) -> None:
        with self._lock, self._taking:
            moment = self.scene.at(seconds)
            stamp = time.time_ns()
            self._seconds += settings.period
            camera = settings.on(moment.scene.camera(self.name))
            path = self._path(moment, settings, camera)
            truth = Truth(
                number,
                stamp,
                seconds,
                moment.scene.time,
                moment.scene,
                camera,
                settings.region,
                moment.joints,
                moment.belts,
                moment.encoders,
                path,
                renderings(path, self.moments),
            )
            self._taken = truth, settings, moment

    def _path(self, moment: Moment, settings: Settings, camera: Camera) -> float:
        """px that the image moves from the first row's exposure to the end of the last one's."""
        if moment.near is None:
            return 0.0
        half = camera.t_exp / 2
        last = half + camera.sensor.line_time * (camera.sensor.resolution[1] - 1)
        begin, end = (
            (scene, settings.on(scene.camera(self.name))) for scene in (moment.near(-half), moment.near(last))
        )
        return longest_path(begin, end)

    def develop(self) -> Frame:
        """The frame that was taken last: drawn, exposed, read out."""
        with self._lock:
            if self._taken is None:
                raise BrightfieldError("A frame must be taken before it is developed; none was.")
            truth, settings, moment = self._taken
            if self._frame is None or self._frame.truth is not truth:
                self._frame = self._developed(truth, settings, moment)
            return self._frame

    def take(self) -> Frame | None:
        """``read``, with the truth: None where ``read`` says False."""
        with self._lock:
            return self.develop() if self.grab() else None

    def prepare(self) -> Frame:
        """Draw once, so that shaders are compiled before frames have a time to keep; the frame has number 0."""
        with self._lock:
            moment = self.scene.at(self._seconds)
            settings = self._settings
            camera = settings.on(moment.scene.camera(self.name))
            truth = Truth(0, time.time_ns(), 0.0, moment.scene.time, moment.scene, camera, settings.region)
            return self._developed(truth, settings, moment)

    def set_pose(self, world_from_camera: Any) -> None:
        """Put the camera (4, 4), rigid; None: where the file has it."""
        self.scene.set_camera_pose(self.name, world_from_camera)

    @property
    def timing(self) -> Timing:
        """How well exposures kept to their time so far."""
        return self._pace.timing

    def _radiance(self, truth: Truth, settings: Settings, near: Callable[[float], Scene]) -> Image:
        """Of an exposure of several renderings."""
        began = truth.seconds

        def scene_at(seconds: float) -> Scene:
            return truth.scene if seconds == began else near(seconds - began)

        return over_exposure(
            scene_at, lambda scene: settings.on(scene.camera(self.name)),
            lambda scene, camera, _, passes: self._draw(scene, camera, passes),
            began, 1.0, truth.renderings, self.maps,
        )  # fmt: skip

    def _developed(self, truth: Truth, settings: Settings, moment: Moment) -> Frame:
        if truth.renderings > 1 and moment.near is not None:
            image = self._radiance(truth, settings, moment.near)
        else:
            image = self._draw(truth.scene, truth.camera, self.maps)
        rng = np.random.default_rng([self.seed, zlib.crc32(self.name.encode()), truth.number])
        exposed = expose(image, truth.camera, rng=rng if self.noise else None).pixels
        if settings.format.channels == 3 and exposed.shape[2] == 1:
            exposed = np.repeat(exposed, 3, axis=2)
        x, y, w, h = settings.region
        part = (slice(y, y + h), slice(x, x + w))
        pixels: np.ndarray = exposed[part].astype(settings.format.dtype).reshape(settings.format.shape(w, h))
        maps = {name: np.ascontiguousarray(image.passes[name][part]) for name in self.maps}
        for array in (pixels, *maps.values()):
            array.setflags(write=False)
        return Frame(pixels, settings.format, truth, maps)

    def __enter__(self) -> "VirtualCamera":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

"""What a camera of the scene sees: its sensor's digital numbers, or radiance in false colour; with histogram, the
number under the cursor, and the path-traced image beside it."""

import time
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from imgui_bundle import hello_imgui, imgui
from imgui_bundle import icons_fontawesome_6 as icons

from composer.editor.offline_job import OfflineJob
from composer.editor.window import actions, theme
from composer.editor.window.display import Display, Look
from composer.editor.window.hidden import Hidden
from composer.editor.window.places import mark, mark_rect
from composer.editor.window.state import State
from composer.editor.window.toolbar import toggle
from interchange.camera import Camera
from interchange.image import Image, Quantity
from interchange.problems import BrightfieldError

BINS = 128
SECOND_PART = 220  # px of the bar: path tracing and the stream
OVERVIEW_FIRST = 4  # frames of a window that opens, before shaders of sensors' views compile
SAMPLES = (16, 64, 256, 1024)


@dataclass
class CameraView:
    state: State
    number: int = 0  # which of the views this is
    camera: str = ""
    mode: str = "sensor"  # or "radiance"
    noise: bool = True
    bright: bool = False  # digital numbers stretched and encoded for the eye
    zoom_in: bool = False
    split: float = 0.5
    samples: int = 64
    displays: dict[str, Display] = field(default_factory=dict)
    drawn: Any = None
    offline_drawn: Any = None
    live: Image | None = None  # radiance
    shown: Image | None = None
    offline: Image | None = None
    histogram: np.ndarray = field(default_factory=lambda: np.zeros((1, BINS), np.float32))
    caption: str = ""
    saturated: float = 0.0  # share of its values
    gain: float = 1.0
    stretch: float = 1.0
    full: bool = False
    problem: str = ""
    seed: int = 0
    exposing: tuple[Any, Future[Image]] | None = None
    hidden: Hidden = field(init=False)

    def __post_init__(self) -> None:
        self.hidden = Hidden(self.state)

    def gui(self) -> None:
        camera = self._choose()
        if camera is None:
            count, more = ("one", "another") if self.state.scene.cameras else ("no", "one")
            imgui.text_disabled(f"The scene has {count} camera.")
            imgui.text_disabled(f"Add {more} from the menu Add.")
            return
        self._bar(camera)
        self._picture(camera)
        self._offline(camera)
        self.hidden.update(camera)
        if self.problem:
            imgui.push_text_wrap_pos(0)
            imgui.text_colored(imgui.ImVec4(*theme.BAD), self.problem)
            imgui.pop_text_wrap_pos()
        if self.shown is not None and self.displays:
            self._image(camera)

    def _choose(self) -> Camera | None:
        cameras = self.state.scene.cameras
        if len(cameras) <= self.number and not (self.camera and cameras):
            self.drawn = self.shown = None
            return None
        names = [c.name for c in cameras]
        if self.number == 0 and self.state.shown_camera in names:
            self.camera, self.state.shown_camera = self.state.shown_camera, ""
        if self.camera not in names:
            self.camera = names[min(self.number, len(names) - 1)]
        return cameras[names.index(self.camera)]

    def _bar(self, camera: Camera) -> None:
        imgui.set_next_item_width(92)
        if imgui.begin_combo("##camera", camera.name.rsplit("/", 1)[-1]):
            for each in self.state.scene.cameras:
                if imgui.selectable(each.name.rsplit("/", 1)[-1], each.name == camera.name)[0]:
                    self.camera = each.name
            imgui.end_combo()
        imgui.same_line()
        if toggle("Sensor", self.mode == "sensor", "Digital numbers, as the camera gives them"):
            self.mode = "sensor"
        imgui.same_line(0, 2)
        if toggle("Radiance", self.mode == "radiance", "W/(m² sr) in false colour"):
            self.mode = "radiance"
        mark(f"radiance {self.number}")
        imgui.same_line(0, 8)
        if toggle(icons.ICON_FA_BRAILLE, self.noise, "Noise of the sensor"):
            self.noise = not self.noise
        imgui.same_line(0, 2)
        if toggle(icons.ICON_FA_SUN, self.bright, "Brightened for the eye; the numbers stay as they are"):
            self.bright = not self.bright
        imgui.same_line(0, 2)
        tip = "Red: where something else stands before the workpiece, which is what is selected now"
        if toggle(icons.ICON_FA_EYE_SLASH, bool(self.hidden.workpiece), tip):
            self.hidden.toggle()
        mark(f"hidden {self.number}")
        imgui.same_line(0, 2)
        if toggle(icons.ICON_FA_CROSSHAIRS, False, "Select this camera"):
            self.state.workspace.select([camera.name])
        if imgui.get_window_pos().x + imgui.get_window_width() - imgui.get_item_rect_max().x > SECOND_PART:
            imgui.same_line(0, 8)  # in a narrow view the rest has a line of its own
        job = self.state.job
        if job is not None and job.running and self.state.job_camera == camera.name:
            text = f"{job.done_samples} / {job.samples}" if job.done_samples else "starting"
            imgui.progress_bar(job.fraction, imgui.ImVec2(92, 0), text)
            imgui.same_line(0, 2)
            if imgui.button(f"{icons.ICON_FA_XMARK}##stop"):
                job.cancel()
        else:
            if imgui.button(f"{icons.ICON_FA_PLAY} Offline"):
                self._start(camera)
            mark(f"offline {self.number}")
            if imgui.is_item_hovered():
                imgui.set_tooltip("Render this view by path tracing, in a process of its own")
            imgui.same_line(0, 2)
            imgui.set_next_item_width(44)
            if imgui.begin_combo("##samples", str(self.samples), imgui.ComboFlags_.no_arrow_button):
                for count in SAMPLES:
                    if imgui.selectable(str(count), count == self.samples)[0]:
                        self.samples = count
                imgui.end_combo()
            if imgui.is_item_hovered():
                imgui.set_tooltip("Light paths a pixel")
        self._stream(camera)
        if self.offline is not None:
            imgui.same_line(0, 6)
            if imgui.button(f"{icons.ICON_FA_TRASH}##offline"):
                self.offline, self.offline_drawn = None, None
                self.displays.pop("offline", None)

    def _stream(self, camera: Camera) -> None:
        stream = self.state.stream
        live = stream is not None and stream.name == camera.name
        tip = "Stream this camera to vision software, as it is edited"
        if live and stream is not None:
            tip = "\n".join(["Streamed; click to stop", *stream.lines])
        imgui.same_line(0, 6)
        if toggle(icons.ICON_FA_TOWER_BROADCAST, live, tip):
            actions.stream(self.state, "" if live else camera.name)
        mark(f"stream {self.number}")

    # making pictures

    def _size(self, camera: Camera) -> Camera:
        """As large as it is shown while things move, in full when they rest."""
        width = camera.sensor.resolution[0]
        room = max(32, int(imgui.get_content_region_avail().x))
        return camera if self._rests or room >= width else camera.resized(room)

    @property
    def _rests(self) -> bool:
        """A view that opens shows a preview first."""
        return self.state.quiet and self.shown is not None

    def _picture(self, camera: Camera) -> None:
        state = self.state
        ready = state.full.ready
        if imgui.get_frame_count() < OVERVIEW_FIRST or ready is None or not ready.done():
            return
        used = self._size(camera)
        quiet = self._rests
        key = (
            state.scene_key,
            state.workspace.time,
            camera.name,
            self.mode,
            self.noise,
            self.bright,
            used.sensor.resolution,
            quiet,
        )
        if key == self.drawn or state.renderer is None or state.context is None:
            return
        before = state.context.detect_framebuffer()
        self.problem = ""
        try:
            blurred = used.lens.f_stop > 0 and used.lens.focus_distance > 0
            if quiet:
                made = self._in_full(key, used, 16 if blurred else 4)
            else:
                live = state.renderer.render(state.scene, used, samples=2 if blurred else 1)
                self.seed += 1
                made = live, self._exposed(live, self.seed)
            if made is None:
                return  # the window goes on; the preview stays
            self.live, self.shown = made
            self._show("live", self.shown, measure=True)
        except BrightfieldError as error:
            self.problem = str(error)
        finally:
            before.use()
        self.drawn, self.full, self.exposing = key, quiet, None

    def _in_full(self, key: Any, camera: Camera, samples: int) -> tuple[Image, Image] | None:
        """Radiance and what is shown of it, once they are made; two views of one camera share the first."""
        state = self.state
        seen = (state.scene_key, state.workspace.time, camera.name, camera.sensor.resolution, samples)
        image = state.full.radiance(seen, state.scene, camera, samples, imgui.get_frame_count())
        if image is None:
            return None
        if self.exposing is None or self.exposing[0] != key:
            self.seed += 1
            self.exposing = (
                key,
                state.full.exposed(partial(_exposed, image, self.mode, self.seed if self.noise else None)),
            )
        if not self.exposing[1].done():
            return None
        return image, self.exposing[1].result()

    def _exposed(self, image: Image, seed: int) -> Image:
        return _exposed(image, self.mode, seed if self.noise else None)

    def _show(self, name: str, image: Image, measure: bool = False) -> None:
        assert self.state.context is not None
        if name not in self.displays:
            self.displays[name] = Display(self.state.context)
        display = self.displays[name]
        if measure:
            self._measure(image)
        display.upload(image.pixels if image.pixels.shape[2] in (1, 3) else image.pixels[..., :3])
        plain = Look.SRGB if self.bright else Look.PLAIN
        stretch = self.stretch if self.bright else 1.0
        dn = image.quantity is Quantity.DN
        display.draw(plain if dn else Look.FALSE_COLOR, self.gain * stretch if dn else self.gain)

    def _measure(self, image: Image) -> None:
        """Histogram, gain and what is written below of what is shown: once, as frames are drawn more often."""
        if image.quantity is Quantity.DN and image.camera is not None:
            top = float(2**image.camera.sensor.bits_out - 1)
        else:
            top = float(np.percentile(image.pixels.max(axis=-1), 99.8)) or 1.0
        self.gain = 1 / top
        high = float(np.percentile(image.pixels[::4, ::4], 99.5))
        self.stretch = top / high if high > 0 else 1.0
        step = max(1, image.pixels.size // 600_000)
        sample = image.pixels.reshape(-1, image.pixels.shape[2])[::step]
        counts = [np.histogram(sample[:, c], BINS, (0, top * (1 + 1e-6)))[0] for c in range(sample.shape[1])]
        self.histogram = np.log1p(np.array(counts, np.float32))
        mean = float(image.pixels.mean())
        if image.quantity is Quantity.DN:
            self.caption = f"DN  0 … {top:.0f}   mean {mean:.0f}"
            self.saturated = float((image.pixels >= top).mean())
        else:
            self.caption, self.saturated = f"0 … {top:.4g} W/(m² sr)   mean {mean:.4g}", 0.0

    def _start(self, camera: Camera) -> None:
        if self.state.job is not None and self.state.job.running:
            self.state.tell("Another view is being rendered.", error=True)
            return
        self.state.job = OfflineJob(self.state.workspace.scene, camera, self.samples)
        self.state.job_camera = camera.name

    def _offline(self, camera: Camera) -> None:
        job = self.state.job
        if job is None or self.state.job_camera != camera.name:
            return
        if job.error and not job.running:
            self.problem = job.error
        key = (id(job), job.version, self.mode, self.noise, self.bright, self.gain, self.stretch)
        if job.image is None or key == self.offline_drawn or self.state.context is None:
            return
        self.offline_drawn = key
        before = self.state.context.detect_framebuffer()
        try:
            self.offline = self._exposed(job.image, self.seed)
            self._show("offline", self.offline)
        except BrightfieldError as error:
            self.problem = str(error)
        finally:
            before.use()

    # showing them

    def _image(self, camera: Camera) -> None:
        area = imgui.get_content_region_avail()
        below = 66.0
        width, height = camera.sensor.resolution
        scale = max(1e-3, min(area.x / width, (area.y - below) / height))
        w, h = width * scale, height * scale
        corner = imgui.get_cursor_screen_pos()
        x = corner.x + max(0.0, (area.x - w) / 2)
        low, high = (x, corner.y), (x + w, corner.y + h)
        draw = imgui.get_window_draw_list()
        live = self.displays.get("live")
        if live is None or not live.ready:
            return
        imgui.invisible_button("##image", imgui.ImVec2(max(area.x, 8), max(h, 8)))
        mark_rect(f"camera {self.number}", (*low, *high))
        hovered = imgui.is_item_hovered()
        offline = self.displays.get("offline") if self.offline is not None else None
        draw.add_image(live.texture, low, high)
        if offline is not None and offline.ready:
            self._slider(draw, offline, low, high)
        self.hidden.draw(draw, low, high)
        draw.add_rect(low, high, theme.color32((0, 0, 0, 1)))
        self._status(draw, low, camera)
        self._curve(x, w)
        if hovered:
            self._under_cursor(low, scale, w)

    def _slider(self, draw: Any, offline: Display, low: Any, high: Any) -> None:
        """Live on the left of the handle, path-traced on the right."""
        mouse = imgui.get_mouse_pos()
        x = low[0] + self.split * (high[0] - low[0])
        if imgui.is_item_active():
            self.split = float(np.clip((mouse.x - low[0]) / max(high[0] - low[0], 1), 0, 1))
        draw.add_image(offline.texture, (x, low[1]), high, (self.split, 0), (1, 1))
        draw.add_line((x, low[1]), (x, high[1]), theme.color32((1, 1, 1, 0.9)), 2)
        middle = (low[1] + high[1]) / 2
        draw.add_circle_filled((x, middle), 7, theme.color32((1, 1, 1, 0.95)))
        white = theme.color32((1, 1, 1, 0.9))
        draw.add_text((low[0] + 8, high[1] - 22), white, "real-time")
        draw.add_text((high[0] - 80, high[1] - 22), white, "path-traced")

    def _status(self, draw: Any, low: Any, camera: Camera) -> None:
        if not self.full:
            draw.add_text((low[0] + 8, low[1] + 6), theme.color32((1, 1, 1, 0.6)), "preview")

    def _curve(self, x: float, width: float) -> None:
        """The histogram, logarithmic, a curve a channel."""
        corner = imgui.get_cursor_screen_pos()
        height = 36.0
        draw = imgui.get_window_draw_list()
        low, high = (x, corner.y), (x + width, corner.y + height)
        draw.add_rect_filled(low, high, theme.color32((0.105, 0.11, 0.118, 1)), 3)
        top = float(self.histogram.max()) or 1.0
        colors = [(0.95, 0.40, 0.38, 0.9), (0.50, 0.85, 0.45, 0.9), (0.45, 0.62, 1.0, 0.9)]
        for c, counts in enumerate(self.histogram):
            rgba = colors[c] if len(self.histogram) > 1 else (0.85, 0.86, 0.88, 0.9)
            xs = low[0] + (np.arange(BINS) + 0.5) / BINS * width
            ys = high[1] - 2 - counts / top * (height - 5)
            points: list[Any] = [imgui.ImVec2(float(a), float(b)) for a, b in zip(xs, ys, strict=True)]
            draw.add_polyline(points, theme.color32(rgba), 1.3, 0)
        imgui.dummy(imgui.ImVec2(width, height))
        if self.hidden.text:
            imgui.text_disabled(self.hidden.text)
            return
        imgui.text_disabled(self.caption)
        if self.saturated > 0.001:
            imgui.same_line()
            imgui.text_colored(imgui.ImVec4(*theme.WARN), f"{100 * self.saturated:.1f} % saturated")

    def _under_cursor(self, low: Any, scale: float, width: float) -> None:
        mouse = imgui.get_mouse_pos()
        right = self.offline is not None and mouse.x > low[0] + self.split * width
        image = self.offline if right and self.offline is not None else self.shown
        if image is None:
            return
        h, w = image.pixels.shape[:2]
        column = int((mouse.x - low[0]) / width * w)
        row = int((mouse.y - low[1]) / (width * h / w) * h)
        if not (0 <= column < w and 0 <= row < h):
            return
        values = image.pixels[row, column]
        if image.quantity is Quantity.DN:
            numbers = "  ".join(f"{v:.0f}" for v in values)
            text = f"({column}, {row}) px    DN {numbers}"
        else:
            numbers = "  ".join(f"{v:.4g}" for v in values)
            text = f"({column}, {row}) px    {numbers} W/(m² sr)"
        imgui.set_tooltip(text + ("    path-traced" if right else "") + ("" if self.full else "    preview"))


def _exposed(image: Image, mode: str, seed: int | None) -> Image:
    """As a view shows it; without a ``seed`` the mean of many frames."""
    if mode == "radiance":
        return image
    from interchange.exposure import expose  # loaded beside the window (full_picture)

    return expose(image, rng=None if seed is None else np.random.default_rng(seed))


def keep_awake(state: State) -> None:
    """The window rests when nothing happens; not while a picture is still to be made, or a worker renders."""
    waiting = not state.quiet or (state.job is not None and state.job.running)
    hello_imgui.get_runner_params().fps_idling.fps_idle = 12.0 if waiting else 4.0
    if time.monotonic() - state.changed_at < 0.6 or state.full.busy(imgui.get_frame_count()):
        hello_imgui.request_refresh()

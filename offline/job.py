"""One frame of a batch, described by data alone, and rendered wherever that description is taken to."""

import hashlib
import json
import threading
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from interchange.camera import Camera
from interchange.formats.base import Options
from interchange.image import Image
from interchange.moments import over_exposure
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.shutter import Shutter
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings


@dataclass(frozen=True)
class FrameJob:
    """``digest``: the scene document's, so that nothing is rendered of a file that has changed since."""

    scene: str  # path
    digest: str
    camera: str  # prim path
    time: float  # time code
    out: str  # path of the EXR
    settings: CyclesSettings = field(default_factory=CyclesSettings)
    passes: tuple[str, ...] = ()
    per_light: bool = False
    width: int = 0  # px; 0 leaves the camera's own resolution
    next_time: float | None = None  # the time code after this one, for pass motion
    options: Options = field(default_factory=Options)
    shutter: Shutter = field(default_factory=Shutter)
    timeout: float | None = None  # s
    memory: int = 0  # bytes

    @cached_property
    def key(self) -> str:
        """SHA-256 of all that decides the image; the same for the same image on a machine."""
        about = asdict(self)
        for name in ("out", "scene", "timeout", "memory"):
            del about[name]
        for name in ("threads", "tile"):
            del about["settings"][name]
        return hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()

    def seen_by(self, scene: Scene) -> Camera:
        """The scene's camera, with the job's shutter and size."""
        camera = self.shutter.on(scene.camera(self.camera))
        return camera.resized(self.width) if self.width else camera

    def with_threads(self, threads: int) -> "FrameJob":
        """The job on that many processor threads, where it does not say how many."""
        if self.settings.threads:
            return self
        return replace(self, settings=replace(self.settings, threads=threads))


def is_done(job: FrameJob) -> bool:
    """Whether the job's file is there, whole, and of this very job."""
    from interchange.formats.exr import ATTRIBUTE
    from interchange.formats.exr_header import read_header

    path = Path(job.out)
    if not path.is_file():
        return False
    try:
        text = read_header(path).attributes.get(ATTRIBUTE)
        return isinstance(text, str) and json.loads(text)["made_by"].get("job") == job.key
    except (BrightfieldError, ValueError, KeyError, TypeError, AttributeError):
        return False  # a file that cannot be read is not a finished frame


class Bench:
    """What a process keeps between frames: the opened scene and the warm renderer."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.opened: tuple[Any, Any] | None = None
        self.renderer: Cycles | None = None

    def render(self, job: FrameJob) -> Image:
        from interchange.formats.document import open_scene

        with self.lock:
            key = (job.scene, job.digest, job.options)
            if self.opened is None or self.opened[0] != key:
                document = open_scene(job.scene, job.options)
                if document.digest != job.digest:
                    raise BrightfieldError(
                        f"The scene must be the one the batch was planned with; it has changed. ({job.scene})"
                    )
                self.opened = (key, document)
            document = self.opened[1]
            scene = document.scene(job.time)
            after = document.scene(job.next_time) if job.next_time is not None else None
            if after is not None and job.width:
                after = replace(after, cameras=tuple(c.resized(job.width) for c in after.cameras))
            if self.renderer is None:
                self.renderer = Cycles()
            self.renderer.timeout, self.renderer.memory = job.timeout, job.memory
            cycles = self.renderer
            if job.shutter.moments > 1:
                image = over_exposure(
                    document.scene, job.seen_by,
                    lambda s, c, k, p: cycles.render(s, c, replace(job.settings, seed=job.settings.seed + k), p),
                    job.time, document.codes_per_second, job.shutter.moments, job.passes,
                )  # fmt: skip
            else:
                image = cycles.render(
                    scene, job.seen_by(scene), job.settings, job.passes, job.per_light, after
                )
        return replace(image, made_by={**image.made_by, "job": job.key})


BENCH = Bench()  # one a process


def work(job: FrameJob) -> float:
    """Render, write beside and rename. Returns the seconds that the renderer took."""
    from interchange.formats import exr

    image = BENCH.render(job)
    Path(job.out).parent.mkdir(parents=True, exist_ok=True)
    exr.write(job.out, image)
    return float(image.made_by["seconds"]["all"])

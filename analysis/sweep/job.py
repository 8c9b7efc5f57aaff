"""One frame of a sweep, described by data alone, and made wherever that description is taken to."""

import hashlib
import json
import os
import threading
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from analysis.sweep.plan import PlannedDefect, Rendering
from interchange.camera import Camera
from interchange.formats.atomic import written_beside
from interchange.image import Image
from interchange.problems import BrightfieldError
from interchange.scene import Scene

KEPT = 15  # scenes of other times
VERSION = 1  # of what a frame's files hold


@dataclass(frozen=True)
class SweepJob:
    """``digest``: the scene document's. ``values``: everything that is set, by address, numbers in the declared units.
    ``files``: what names of ``values`` stand for, and their SHA-256."""

    scene: str  # path
    digest: str
    camera: str  # prim path
    time: float  # time code
    frame: int
    sample: int
    values: tuple[tuple[str, float | str], ...]
    defects: tuple[PlannedDefect, ...]
    objects: tuple[str, ...]
    rendering: Rendering
    seed: int
    noise: bool
    width: int
    writes: tuple[str, ...]
    folder: str
    bop_scene: int = 0
    threads: int = 0
    files: tuple[tuple[str, str], ...] = ()

    @property
    def out(self) -> str:
        """The frame's record, written last."""
        return str(Path(self.folder) / "frames" / f"{self.frame:06d}.json")

    @cached_property
    def key(self) -> str:
        """SHA-256 of all that decides the frame."""
        about = asdict(self)
        for name in ("scene", "folder", "threads"):
            del about[name]
        if not self.files:
            del about["files"]
        about["version"] = VERSION
        return hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()

    def with_threads(self, threads: int) -> "SweepJob":
        return self if self.threads else replace(self, threads=threads)


def read_record(job: SweepJob) -> dict[str, Any] | None:
    """What the frame's record says; None where there is none of this very job."""
    try:
        record = json.loads(Path(job.out).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return record if isinstance(record, dict) and record.get("job") == job.key else None


def is_done(job: SweepJob) -> bool:
    record = read_record(job)
    return record is not None and all((Path(job.folder) / f).is_file() for f in record["files"].values())


class Bench:
    """What a process keeps between frames: the opened scene and the warm renderers."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.opened: tuple[Any, Any] | None = None
        self.scenes: dict[float, Scene] = {}
        self.cycles: Any = None
        self.rasterizers: dict[tuple[str, int], Any] = {}

    def scene(self, job: SweepJob) -> Scene:
        from interchange.formats.document import open_scene

        if self.opened is None or self.opened[0] != (job.scene, job.digest):
            document = open_scene(job.scene)
            if document.digest != job.digest:
                raise BrightfieldError(
                    f"The scene must be the one the sweep was planned with; it has changed. ({job.scene})"
                )
            self.opened, self.scenes = ((job.scene, job.digest), document), {}
        if job.time not in self.scenes:
            self.scenes = dict(list(self.scenes.items())[-KEPT:])
            self.scenes[job.time] = self.opened[1].scene(job.time)
        return self.scenes[job.time]

    def live(self, threads: int = 0, use: str = "image") -> Any:
        """A rasteriser for each ``use``: one that draws single objects for their masks would make the one that draws
        images forget what it uploaded. A context of OpenGL belongs to one thread."""
        from realtime.renderers.rasterizer import Rasterizer

        key = (use, threading.get_ident())
        if key not in self.rasterizers:
            if threads:
                os.environ.setdefault("LP_NUM_THREADS", str(threads))  # Mesa's, read when it starts
            self.rasterizers[key] = Rasterizer()
        return self.rasterizers[key]

    def render(self, scene: Scene, camera: Camera, job: SweepJob) -> Image:
        passes = ("depth", "object_id")
        if job.rendering.name == "realtime":
            return self.live(job.threads).render(scene, camera, passes, samples=job.rendering.samples)
        from offline.renderers.cycles import Cycles
        from offline.settings import CyclesSettings

        if self.cycles is None:
            self.cycles = Cycles()
        settings = CyclesSettings(
            samples=job.rendering.samples,
            seed=job.seed,
            max_bounces=job.rendering.bounces,
            denoise=int(job.rendering.denoise),
            threads=job.threads,
        )
        return self.cycles.render(scene, camera, settings, passes)


@dataclass(frozen=True)
class TruthRenderer:
    """Started where a mask is first drawn."""

    bench: Bench
    threads: int

    def render(self, scene: Scene, camera: Camera, passes: Sequence[str], *, samples: int) -> Image:
        return self.bench.live(self.threads, "truth").render(scene, camera, passes, samples=samples)


BENCH = Bench()  # one a process


def work(job: SweepJob) -> float:
    """Render a frame, write its files and then its record. Returns the seconds that it took."""
    from analysis.sweep.frame import make

    with BENCH.lock:
        record = make(job, BENCH)
    path = Path(job.out)
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = written_beside(path)
    beside.write_text(json.dumps({**record, "job": job.key}), encoding="utf-8")
    os.replace(beside, path)
    return float(record["seconds"])


def of_another(folder: Path, jobs: Sequence[SweepJob]) -> int:
    """How many finished frames of the folder are none of these jobs'."""
    keys = {Path(job.out).name: job.key for job in jobs}
    count = 0
    for path in (folder / "frames").glob("[0-9]*.json"):
        try:
            key = json.loads(path.read_text(encoding="utf-8"))["job"]
        except (OSError, ValueError, KeyError, TypeError):
            continue  # half a record is nobody's
        count += key != keys.get(path.name)
    return count

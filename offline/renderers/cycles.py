"""Path tracing by Cycles: the right image, whatever the light does.

Light straight from the lamps is computed at every surface point by shadow rays and the exact BRDF of the
catalogue; reflected light follows paths whose weights are that BRDF as well, so the mean of the noise is the
radiance itself for every model (FEASIBILITY's closures are not needed). Lamps without extent leave no noise in
direct light.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from interchange.camera import Camera
from interchange.image import Image, check_passes
from interchange.lamps.exposed import banded, exposed, shutter_of
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from offline import visible_lamps
from offline.gathering import Gathering, pick
from offline.passes import assemble
from offline.process import Worker, WorkerDied
from offline.protocol import Job, Reply
from offline.settings import CyclesSettings
from offline.wide import bands, is_native, oversampling, wide_camera

TRUTH = {"depth", "position", "normal", "object_id", "material_id", "motion"}

PER_LIGHT = ("light", "light_indirect")  # arrays of a worker with one image a lamp


class Cycles:
    """Owns one worker process, warm between frames: what did not change from frame to frame is not sent again.

    ``timeout``: s that a frame may take, None for no limit; ``memory``: bytes that the worker may hold, 0 for no limit.
    A worker that crashes or exceeds a limit is started anew and the frame tried once more.
    """

    name = "cycles"

    def __init__(self, timeout: float | None = None, memory: int = 0) -> None:
        self.timeout, self.memory = timeout, memory
        self.worker: Worker | None = None
        self.restarts = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        if self.worker is not None:
            self.worker.close()
            self.worker = None

    def render(
        self,
        scene: Scene,
        camera: Camera,
        settings: CyclesSettings = CyclesSettings(),  # noqa: B008  frozen
        passes: Sequence[str] = (),
        per_light: bool = False,
        next_scene: Scene | None = None,
    ) -> Image:
        """Radiance (H, W, 3) float32, pixel means, with ``passes`` (interchange.image).

        ``per_light`` adds ``light:NAME`` for every lamp, and ``indirect:NAME`` where pass ``indirect`` is asked for.
        ``next_scene``: the next frame, which pass ``motion`` needs; its camera is the one of the same name. Raises
        BrightfieldError for what this renderer cannot draw and for a worker that fails twice.
        """
        began = time.perf_counter()
        asked = check_passes(list(passes))
        per_light = per_light or "light" in asked
        check(scene, asked, next_scene)
        made_for = shutter_of(scene, camera)
        scene, rows = exposed(scene, camera)
        wanted = list(asked)
        if rows and "direct" in asked:
            wanted.append("indirect")
        one_by_one = per_light or bool(rows)
        centres = bool(TRUTH & set(asked)) or any(x.visible for x in scene.lights)
        job = Job(replace(scene, cameras=()), camera, settings, centres, "lit" in asked, one_by_one)
        arrays, reply = self._arrays(job) if is_native(camera) else self._through_lens(job)
        visible_lamps.add(arrays, scene, camera)
        image_passes = assemble(arrays, scene, camera, wanted, one_by_one, next_scene)
        made_by: dict[str, Any] = {
            **made_for,
            "renderer": self.name,
            "version": reply.version,
            "settings": settings.as_dict(),
            "scene": scene.source,
            "scene_digest": scene.digest,
            "time": scene.time,
            "camera": camera.name,
            "seed": settings.seed,
            "seconds": {**reply.seconds, "all": time.perf_counter() - began},
            "brdf_residual": {m: 0.0 for m in scene.material_names},  # exact by construction
        }
        image = Image(
            pixels=arrays["pixels"],
            camera=camera,
            made_by=made_by,
            passes=image_passes,
            object_names=scene.object_names,
            material_names=scene.material_names,
        )
        return banded(image, rows, [*asked, *(["light"] if per_light else [])])

    def _arrays(self, job: Job) -> tuple[dict[str, np.ndarray], Reply]:
        reply = self._ask(job)
        arrays = {name: np.load(path) for name, path in reply.arrays.items()}
        for path in reply.arrays.values():
            Path(path).unlink()
        return arrays, reply

    def _through_lens(self, job: Job) -> tuple[dict[str, np.ndarray], Reply]:
        """What needs shadow rays by a wide pinhole image (``offline.wide``); what stands at pixel centres exactly."""
        camera = job.camera
        size = camera.sensor.resolution[::-1]
        fine, samples = oversampling(job.settings.samples, bool(job.settings.denoise))
        wide = wide_camera(camera, fine)
        spread = replace(job.settings, samples=samples)
        gathering, count = Gathering(wide, camera), len(job.scene.lights)
        lit = np.zeros((*size, count), np.float32)
        seconds: dict[str, float] = {}
        for first, band in bands(wide):
            arrays, reply = self._arrays(replace(job, camera=band, settings=spread, truth=False))
            if job.lit:
                pick(arrays.pop("lit"), wide, camera, first, lit)
            for kind in PER_LIGHT:
                planes = arrays.pop(kind, ())
                arrays |= {f"{kind} {k}": plane for k, plane in enumerate(planes)}
            gathering.add(arrays, first)
            for name, spent in reply.seconds.items():
                seconds[name] = seconds.get(name, 0.0) + spent
        means = gathering.means()
        result = {name: plane for name, plane in means.items() if not name.startswith(PER_LIGHT)}
        for kind in PER_LIGHT if job.per_light else ():
            each = [means[f"{kind} {k}"] for k in range(count)]
            result[kind] = np.stack(each) if each else np.zeros((0, *size, 3), np.float32)
        if job.lit:
            result["lit"] = lit
        if job.truth:
            dark = replace(
                job, scene=replace(job.scene, lights=()), lit=False, per_light=False, centres_only=True
            )
            result.update(self._arrays(dark)[0])
        return result, replace(reply, seconds=seconds)

    def _ask(self, job: Job) -> Reply:
        causes: list[str] = []
        for _ in range(2):
            try:
                if self.worker is None:
                    self.worker = Worker(self.memory)
                reply = self.worker.ask(job, self.timeout)
            except WorkerDied as death:
                causes.append(str(death))
                self.close()
                self.restarts += 1
                continue
            if reply.error:
                raise BrightfieldError(
                    f"Cycles could not render the frame at time {job.scene.time:g}: {reply.error}"
                )
            return reply
        raise BrightfieldError(
            f"Cycles failed twice on the frame at time {job.scene.time:g}: {causes[0]}; then {causes[1]}."
        )


def check(scene: Scene, passes: Sequence[str], next_scene: Scene | None) -> None:
    """Raise one error for everything in the scene that this renderer cannot draw."""
    wrong = [
        f'Material "{b.material.name}" must have a BRDF of the catalogue to be path-traced; it has a GLSL fragment.'
        f"{f' ({b.material.where})' if str(b.material.where) else ''}"
        for b in {b.material.name: b for b in scene.bodies if b.material.glsl}.values()
    ]
    if "motion" in passes and next_scene is None:
        wrong.append("Pass motion needs the next frame (next_scene).")
    names = [light.name for light in scene.lights]
    if len(set(names)) < len(names) and ({"lit", "light"} & set(passes)):
        wrong.append("Passes lit and light need lamps of different names.")
    if wrong:
        raise BrightfieldError(" ".join(wrong))

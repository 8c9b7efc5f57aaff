"""The real-time loop of the command line: every camera at every time code, finished frames skipped."""

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from interchange.camera import Camera
from interchange.formats import exr
from interchange.formats.document import Document
from interchange.image import check_passes
from interchange.moments import over_exposure
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.shutter import Shutter
from realtime.renderers.rasterizer import GIVES, Rasterizer

Told = Callable[[int, int, float | None], None]  # done, total, seconds left


def render_live(
    document: Document,
    cameras: Sequence[Camera],
    times: Sequence[float],
    name: Callable[[str, float], Path],
    samples: int,
    passes: Sequence[str],
    per_light: bool,
    width: int,
    shutter: Shutter,
    told: Told,
) -> list[Path]:
    """Rasterise every camera at every time code; frames that are there, of this very job, are skipped.

    Pass ``all`` stands for every pass that a rasteriser has, but one image a lamp.
    """
    if "all" in passes:
        passes = [p for p in GIVES if p != "light"]
    check_passes(list(passes))
    rasterizer = Rasterizer()
    total, done, made, began = len(cameras) * len(times), 0, [], time.monotonic()
    told(0, total, None)
    for time_code in times:
        scene = None
        for camera in cameras:
            out = name(camera.name, time_code)
            job = [
                document.digest,
                camera.name,
                time_code,
                samples,
                sorted(passes),
                per_light,
                width,
                asdict(shutter),
            ]
            key = hashlib.sha256(json.dumps(job).encode()).hexdigest()
            done += 1
            if is_finished(out, key):
                told(done, total, None)
                continue
            scene = scene or document.scene(time_code)
            after = document.scene(document.following(time_code)) if "motion" in passes else None
            seen = partial(_seen, name=camera.name, shutter=shutter, width=width)
            if shutter.moments > 1:
                image = over_exposure(
                    document.scene, seen, lambda s, c, _, p: rasterizer.render(s, c, p, samples=samples),
                    time_code, document.codes_per_second, shutter.moments, tuple(passes),
                )  # fmt: skip
            else:
                if after is not None and width:
                    after = replace(after, cameras=tuple(c.resized(width) for c in after.cameras))
                image = rasterizer.render(
                    scene, seen(scene), passes, per_light, samples=samples, next_scene=after
                )
            out.parent.mkdir(parents=True, exist_ok=True)
            exr.write(out, replace(image, made_by={**image.made_by, "job": key}))
            made.append(out)
            spent = time.monotonic() - began
            told(done, total, spent / len(made) * (total - done))
    return made


def _seen(scene: Scene, name: str, shutter: Shutter, width: int) -> Camera:
    camera = shutter.on(scene.camera(name))
    return camera.resized(width) if width else camera


def is_finished(file: Path, key: str) -> bool:
    if not file.is_file():
        return False
    try:
        return bool(exr.read(file).made_by.get("job") == key)
    except BrightfieldError:
        return False  # a file that cannot be read is not a finished frame

"""Rendering from the command line: which files a run makes, the real-time loop, and what is written beside a frame."""

import hashlib
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from interchange.camera import Camera
from interchange.formats import exr
from interchange.formats.document import Document
from interchange.formats.images import to_display, write_png
from interchange.image import Image
from interchange.problems import BrightfieldError
from realtime.renderers.rasterizer import Rasterizer

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
    told: Told,
) -> list[Path]:
    """Rasterise every camera at every time code; frames that are there, of this very job, are skipped."""
    rasterizer = Rasterizer()
    total, done, made, began = len(cameras) * len(times), 0, [], time.monotonic()
    told(0, total, None)
    for k, time_code in enumerate(times):
        scene = None
        for camera in cameras:
            out = name(camera.name, time_code)
            job = [document.digest, camera.name, time_code, samples, sorted(passes), per_light, width]
            key = hashlib.sha256(json.dumps(job).encode()).hexdigest()
            done += 1
            if is_finished(out, key):
                continue
            scene = scene or document.scene(time_code)
            after = document.scene(following(times, k)) if "motion" in passes else None
            now = scene.camera(camera.name)
            if width:
                now = now.resized(width)
                if after is not None:
                    after = replace(after, cameras=tuple(c.resized(width) for c in after.cameras))
            image = rasterizer.render(
                scene, now, passes=passes, per_light=per_light, samples=samples, next_scene=after
            )
            out.parent.mkdir(parents=True, exist_ok=True)
            exr.write(out, replace(image, made_by={**image.made_by, "job": key}))
            made.append(out)
            spent = time.monotonic() - began
            told(done, total, spent / len(made) * (total - done))
    told(total, total, 0.0)
    return made


def following(times: Sequence[float], k: int) -> float:
    """The time code after frame ``k``; the last frame takes the step before it."""
    if k + 1 < len(times):
        return times[k + 1]
    return 2 * times[k] - times[k - 1] if len(times) > 1 else times[k]


def is_finished(file: Path, key: str) -> bool:
    if not file.is_file():
        return False
    try:
        return bool(exr.read(file).made_by.get("job") == key)
    except BrightfieldError:
        return False  # a file that cannot be read is not a finished frame


def split_lamps(file: Path) -> list[Path]:
    """Write each lamp's layer of a frame as an image of its own: ``frame.Led00.exr`` beside ``frame.exr``."""
    image = exr.read(file)
    written = []
    for name, pixels in image.passes.items():
        if name.startswith("light:"):
            lamp = name.removeprefix("light:").rsplit("/", 1)[-1]
            out = file.with_suffix(f".{lamp}.exr")
            exr.write(out, Image(pixels, image.quantity, image.camera, {**image.made_by, "light": name}))
            written.append(out)
    return written


def write_preview(file: Path) -> Path:
    """A PNG beside a frame, for looking at."""
    out = file.with_suffix(".png")
    write_png(out, to_display(exr.read(file).pixels))
    return out


def progress_line(done: int, total: int, left: float | None, failed: int = 0) -> None:
    """One line that is rewritten on a terminal, and a line a frame elsewhere."""
    if total < 2:
        return
    rest = "" if left is None else f", {duration(left)} left"
    text = f"{done}/{total} frames{f', {failed} failed' if failed else ''}{rest}"
    if sys.stderr.isatty():
        print(f"\r{text:60}", end="\n" if done + failed >= total else "", file=sys.stderr, flush=True)
    else:
        print(text, file=sys.stderr, flush=True)


def duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"

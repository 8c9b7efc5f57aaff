"""Renderings by name: a fingerprint of all that decides one, under which it is kept on disk."""

import hashlib
import os
from collections.abc import Callable
from dataclasses import Field, fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from interchange.camera import Camera, Lens, Sensor
from interchange.problems import Where
from interchange.scene import Scene


def arrangement(scene: Scene, camera: Camera) -> str:
    """A name for all that decides a rendering but the lamps' intensities: SHA-256 of what is there."""
    lights = tuple(replace(x, intensity=(1.0, 1.0, 1.0)) for x in scene.lights)
    return fingerprint((scene.bodies, lights, drawn(camera)))


def drawn(camera: Camera) -> Camera:
    """With what decides a rendering alone: exposures, gains and all else of the lens and the sensor come after it."""
    lens, sensor = camera.lens, camera.sensor
    optics = Lens(
        lens.focal_length, lens.f_stop, lens.focus_distance, lens.distortion, lens.projection, lens.model
    )
    return replace(camera, t_exp=1.0, lens=optics, sensor=Sensor(sensor.resolution, sensor.pixel_pitch))


def fingerprint(thing: Any) -> str:
    sha = hashlib.sha256()
    _feed(sha, thing)
    return sha.hexdigest()


def _is_default(f: Field[Any], value: Any) -> bool:
    """What is as a new one would have it says nothing: a field that is added makes no rendering anew."""
    return type(value) is type(f.default) and not isinstance(value, np.ndarray) and bool(value == f.default)


def _feed(sha: Any, thing: Any) -> None:
    if isinstance(thing, Where):
        return
    if isinstance(thing, np.ndarray):
        sha.update(f"{thing.dtype}{thing.shape}".encode())
        sha.update(np.ascontiguousarray(thing).tobytes())
    elif is_dataclass(thing):
        sha.update(type(thing).__name__.encode())
        for f in fields(thing):
            if f.name not in ("source", "digest", "file") and not _is_default(f, getattr(thing, f.name)):
                sha.update(f.name.encode())
                _feed(sha, getattr(thing, f.name))
    elif isinstance(thing, dict):
        for key in sorted(thing):
            sha.update(str(key).encode())
            _feed(sha, thing[key])
    elif isinstance(thing, tuple | list):
        sha.update(str(len(thing)).encode())
        for part in thing:
            _feed(sha, part)
    else:
        sha.update(repr(thing.value if isinstance(thing, Enum) else thing).encode())


def kept_on_disk(file: Path, made: Callable[[], dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """What ``file`` holds; where there is none, what is ``made`` is written there first."""
    if not file.is_file():
        arrays = made()
        file.parent.mkdir(parents=True, exist_ok=True)
        beside = file.with_name(f".{file.stem}.{os.getpid()}.npz")
        np.savez(beside, **arrays)
        os.replace(beside, file)
    with np.load(file) as stored:
        return {name: stored[name] for name in stored.files}

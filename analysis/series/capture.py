"""Capture an illumination series of a scene: one image a lighting, into a folder, resumed where it stopped."""

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from analysis.series import folder as on_disk
from analysis.series.lightings import Lighting
from interchange.camera import Camera
from interchange.exposure import expose, responsivity
from interchange.formats import exr, images
from interchange.formats.atomic import written_beside
from interchange.image import Image, Quantity
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.sensor import Mosaic
from interchange.series import Series

Render = Callable[[Scene, Camera], Image]  # radiance
Told = Callable[[int, int, float | None], None]  # done, total, seconds left
PROBE = 48  # px: width of the images that the exposure is found with


def capture(
    scene: Scene,
    camera: Camera,
    lightings: Sequence[Lighting],
    folder: Path | str,
    render: Render,
    settings: dict[str, Any],
    digital: bool = False,
    exposure: float | None = None,
    seed: int | None = 0,
    plane: float = 0.0,
    told: Told = lambda done, total, left: None,
) -> Series:
    """Render ``scene`` under each lighting, its own lamps staying on, and write the series to ``folder``.

    EXR of radiance, or, ``digital``, 16 bit PNG of DN as the camera's sensor gives them: exposed for ``exposure`` s,
    by default such that the brightest image nearly fills the sensor; noise drawn by ``seed``, None for none.
    ``settings``: JSON-ready, what decides the renderer's images. Files that are there from the same job are kept.
    ``plane``: height, m, that near lamps are seen from. Returns the series as read. Raises BrightfieldError where the
    folder holds another job's series.
    """
    folder = Path(folder)
    if not lightings:
        raise BrightfieldError("A series must have one lighting or more.")
    job = {**settings, "digital": digital, "exposure": exposure, "seed": seed, "plane": plane}
    key = digest(scene, camera, lightings, job)
    suffix = "png" if digital else "exr"
    width = len(str(len(lightings) - 1))
    files = [f"images/{k:0{max(width, 3)}d}.{suffix}" for k in range(len(lightings))]
    before = _same_job(folder / on_disk.FILE, key)
    if digital and exposure is None:  # found once
        exposure = before.get("exposure") or auto_exposure(scene, camera, lightings, render)
    (folder / "images").mkdir(parents=True, exist_ok=True)
    quantity = Quantity.DN if digital else Quantity.RADIANCE
    made_by = {**job, "exposure": exposure, "scene": scene.source, "job": key}
    on_disk.write_plan(folder, files, lightings, camera, quantity, made_by, exposure or 1.0, plane)
    for k, (name, step) in enumerate(zip(files, lightings, strict=True)):
        if not (folder / name).is_file():
            image = render(_lit(scene, step), camera)
            _write(folder / name, image, camera, exposure, seed, k, digital)
        told(k + 1, len(files), None)
    return on_disk.read(folder)


def _write(
    path: Path, image: Image, camera: Camera, exposure: float | None, seed: int | None, k: int, digital: bool
) -> None:
    if not digital:
        beside = written_beside(path)
        exr.write(beside, replace(image, passes={}))
        os.replace(beside, path)
        return
    rng = None if seed is None else np.random.default_rng([seed, k])
    shot = expose(image, camera, exposure, rng=rng)
    images.write(path, shot.pixels.astype(np.uint16))


def _lit(scene: Scene, step: Lighting) -> Scene:
    return replace(scene, lights=(*scene.lights, *step.lights))


def auto_exposure(
    scene: Scene,
    camera: Camera,
    lightings: Sequence[Lighting],
    render: Render,
    share: float = 0.8,
    brightest: float = 0.001,
) -> float:
    """s: at which all but the share ``brightest`` of a small series' pixels stay below ``share`` of the full well."""
    small = camera.resized(min(PROBE, camera.sensor.resolution[0]))
    per_second = np.array(responsivity(camera.lens, camera.sensor))
    samples = []
    for step in lightings[:: max(1, len(lightings) // 36)]:
        charge = render(_lit(scene, step), small).pixels * per_second
        mono = camera.sensor.mosaic is Mosaic.MONO
        samples.append((charge.mean(axis=-1) if mono else charge.max(axis=-1)).ravel())
    electrons = np.concatenate(samples)
    top = float(np.quantile(electrons, 1 - brightest))
    if not top > 0:
        raise BrightfieldError("The series is dark: no lamp reaches what the camera sees.")
    return share * camera.sensor.full_well / top


def _same_job(path: Path, key: str) -> dict[str, Any]:
    """What an earlier run of this very job says of itself; nothing where there was none."""
    if not path.is_file():
        return {}
    try:
        before = dict(json.loads(path.read_text(encoding="utf-8"))["made_by"])
    except (ValueError, KeyError, TypeError):
        before = {}
    if before.get("job") != key:
        raise BrightfieldError(
            f"The folder must be empty or hold a part of this very series; {path} is of another scene, camera or "
            "setting."
        )
    return before


def digest(scene: Scene, camera: Camera, lightings: Sequence[Lighting], settings: dict[str, Any]) -> str:
    """SHA-256 of all that decides the images."""
    h = hashlib.sha256()
    if scene.digest:
        h.update(f"{scene.digest} {scene.time}".encode())
    else:
        for body in scene.bodies:
            m = body.material
            for array in (body.mesh.vertices, body.mesh.faces, body.mesh.normals, body.world_from_body):
                h.update(np.ascontiguousarray(array).tobytes())
            h.update(f"{body.name} {m.brdf} {m.emission} {m.opacity}".encode())
            for name, texture in sorted(m.maps.items()):
                h.update(name.encode() + np.ascontiguousarray(texture.pixels).tobytes())
            if m.normal_map is not None:
                h.update(np.ascontiguousarray(m.normal_map.pixels).tobytes())
    for light in (*scene.lights, *(x for step in lightings for x in step.lights)):
        h.update(f"{light.kind} {light.intensity} {light.radius} {light.width} {light.height}".encode())
        h.update(np.ascontiguousarray(light.world_from_light).tobytes())
    h.update(json.dumps(on_disk.camera_record(camera), sort_keys=True).encode())
    h.update(f"{camera.sensor} {camera.lens}".encode())
    h.update(json.dumps(settings, sort_keys=True, default=str).encode())
    return h.hexdigest()

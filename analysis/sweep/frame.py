"""A frame of a sweep: the scene with its numbers set, rendered, exposed, and written with its ground truth.

| file                       | holds                                                                              |
|----------------------------|------------------------------------------------------------------------------------|
| ``exr/000000.exr``         | radiance, depth, object ids                                                        |
| ``images/000000.png``      | DN of the camera                                                                   |
| ``bop/test/000000/...``    | the camera's image in 8 bits, depth, masks                                         |
| ``frames/000000.json``     | what made it and what it shows; written last                                       |
"""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from analysis.sweep.job import Bench, SweepJob, TruthRenderer
from analysis.sweep.placing import scene_of
from analysis.sweep.truth import Instance, instances
from interchange.exposure import expose
from interchange.formats import bop, exr, images


def make(job: SweepJob, bench: Bench) -> dict[str, Any]:
    """The frame's files in ``job.folder``; returns its record."""
    began = time.perf_counter()
    values = dict(job.values)
    scene, placed = scene_of(bench.scene(job), values, job.defects)
    camera = scene.camera(job.camera)
    camera = camera.resized(job.width) if job.width else camera
    image = bench.render(scene, camera, job)
    live = TruthRenderer(bench, job.threads)
    found = instances(live, scene, camera, image, job.objects, "bop" in job.writes)
    found += [Instance(d.name, d.kind, *p.truth(live, camera, image)) for d, p in placed]
    folder, name = Path(job.folder), f"{job.frame:06d}"
    made_by = {**image.made_by, "sweep_job": job.key, "values": values}
    files: dict[str, str] = {}
    if "exr" in job.writes:
        files["exr"] = f"exr/{name}.exr"
        _folder(folder / files["exr"])
        exr.write(folder / files["exr"], replace(image, made_by=made_by))
    rng = np.random.default_rng([job.seed, job.frame]) if job.noise else None
    shot = expose(image, camera, rng=rng)
    sensor = shot.camera.sensor if shot.camera else camera.sensor
    dn = shot.pixels.astype(np.uint8 if sensor.bits_out <= 8 else np.uint16)
    if {"png", "coco"} & set(job.writes):
        files["image"] = f"images/{name}.png"
        _folder(folder / files["image"])
        images.write(folder / files["image"], dn)
    about: dict[str, Any] = {}
    if "bop" in job.writes:
        eight = np.rint(shot.pixels * (255 / (2**sensor.bits_out - 1))).astype(np.uint8)
        written, about = bop.write_frame(
            folder / "bop", job.bop_scene, job.frame, eight, image.passes["depth"], camera, scene, found
        )
        files |= {k: f"bop/{v}" for k, v in written.items()}
    return {
        "frame": job.frame,
        "sample": job.sample,
        "camera": camera.name,
        "time": job.time,
        "size": list(camera.sensor.resolution),
        "values": values,
        "mean_dn": float(dn.mean()),
        "saturated_share": float((dn >= 2**sensor.bits_out - 1).mean()),
        "instances": [i.record() for i in found],
        "bop": about,
        "files": files,
        "renderer": image.made_by["renderer"],
        "seconds": time.perf_counter() - began,
    }


def _folder(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)

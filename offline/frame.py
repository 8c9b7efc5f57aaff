"""One frame inside the worker: which runs of Cycles a job takes, and the arrays they leave.

| array        | shape        | meaning                                                    |
|--------------|--------------|------------------------------------------------------------|
| ``pixels``   | (H, W, 3)    | radiance                                                   |
| ``direct``   | (H, W, 3)    | the part that came straight from lamps, and the own glow   |
| ``alpha``    | (H, W, 1)    | share of the pixel that shows a surface                    |
| ``truth``    | (H, W, 3)    | octahedral normal and 1 + body at the pixel centre         |
| ``position`` | (H, W, 3)    | world, at the pixel centre                                 |
| ``lit``      | (H, W, L)    | share of each lamp that is seen from there                 |
| ``light``    | (L, H, W, 3) | radiance by each lamp alone                                |
"""

import time
from pathlib import Path

import numpy as np

from offline import blender_render as blender
from offline.blender_stage import Stage
from offline.protocol import Job

ALL_LAMPS, NO_LAMP = -1, -2
RADIANCE, TRUTH, LIT, INDIRECT, DIRECT = range(5)  # modes of osl/surface.osl
EDGE_SAMPLES = 16  # of direct light alone, noisy at edges and in half-shadows only, and not denoised


def render(stage: Stage, job: Job, folder: Path) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    began = time.perf_counter()
    settings, lights = job.settings, job.scene.lights
    blender.prepare(settings)
    stage.update(job.scene, job.camera, defocus=True)
    salt = float(settings.seed % 16384 * 1024)
    common = {"last": settings.max_bounces, "grid": settings.lamp_grid, "salt": salt}
    stage.control(**common)
    path = folder / "pass.exr"
    spent = 0.0
    arrays: dict[str, np.ndarray] = {}

    def run(
        mode: int, only: int, samples: int, noise: float = 0.0, denoise: bool = False
    ) -> dict[str, np.ndarray]:
        nonlocal spent
        stage.task(mode, only)
        start = time.perf_counter()
        found = blender.trace(path, samples, noise, denoise)
        spent += time.perf_counter() - start
        return found

    def radiance(only: int) -> tuple[np.ndarray, np.ndarray]:
        """The image and its direct part. What is denoised is reflected light alone: direct light keeps its edges."""
        if not settings.denoise or settings.max_bounces == 0:
            found = run(RADIANCE, only, settings.samples, settings.noise)
            arrays["alpha"] = found["Alpha"]
            return found["Combined"], found["Emission"]
        found = run(DIRECT, only, settings.direct_samples or max(settings.samples, EDGE_SAMPLES))
        direct, arrays["alpha"] = found["Combined"], found["Alpha"]
        reflected = run(INDIRECT, only, settings.samples, settings.noise, denoise=True)["Combined"]
        return direct + np.maximum(reflected, 0), direct

    if job.centres_only:
        pass
    elif job.per_light:
        size = job.camera.sensor.resolution[::-1]
        glows = any(any(b.material.emission) or b.material.emission_map for b in job.scene.bodies)
        parts = [radiance(k) for k in range(len(lights))]
        arrays["light"] = np.stack([p for p, _ in parts]) if parts else np.zeros((0, *size, 3))
        bounced = [p - d for p, d in parts]
        arrays["light_indirect"] = np.stack(bounced) if bounced else np.zeros((0, *size, 3))
        if glows or not parts:
            parts.append(radiance(NO_LAMP))
        arrays["pixels"] = np.sum([p for p, _ in parts], axis=0)
        arrays["direct"] = np.sum([d for _, d in parts], axis=0)
    else:
        arrays["pixels"], arrays["direct"] = radiance(ALL_LAMPS)
    if job.truth or job.lit:
        stage.camera.update(job.camera, defocus=False)
    if job.truth:
        found = run(TRUTH, ALL_LAMPS, 1)
        arrays["truth"], arrays["position"] = found["Combined"], found["Position"]
    if job.lit:
        shares = [run(LIT, k, 1)["Combined"] for k in range(0, len(lights), 3)]
        arrays["lit"] = np.concatenate([*shares, np.zeros((*job.camera.sensor.resolution[::-1], 0))], axis=-1)
        arrays["lit"] = arrays["lit"][..., : len(lights)]
    return arrays, {"render": spent, "total": time.perf_counter() - began}

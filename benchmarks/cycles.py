"""Overhead and memory of the path tracer over a sweep: ``python benchmarks/cycles.py [FRAMES]``.

A camera moves around a scene of 100k triangles. Overhead is what a frame takes beyond Cycles' own render call: scene
transfer and update, passes, reading back. Then lamps, then a body move, at the same sizes.
"""

import sys
import time
from dataclasses import replace

import numpy as np

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.formats import gprims
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.scene import Body, Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings

SETTINGS = CyclesSettings(samples=8, max_bounces=2)


def at(x: float, y: float, z: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def scene() -> Scene:
    ground = Mesh(
        np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        np.tile([0.0, 0, 1], (4, 1)),
    )
    metal = Lafortune(diffuse=0.1, weight=((1.0, 1.0, 1.0),), C=((-0.98, -0.98, 0.99),), n=(25,))
    return Scene(
        (
            Body("/ground", ground, Material("paper", Lambert(0.6))),
            Body("/ball", gprims.sphere(0.3, 316), Material("metal", metal), at(0, 0, 0.3)),
        ),
        tuple(
            Light(f"/led{k}", LightKind.SPHERE, (1.0, 1, 1), at(0.8 - 0.8 * k, 0.3, 0.9)) for k in range(3)
        ),
    )


def with_lamp(base: Scene, k: int) -> Scene:
    first, *others = base.lights
    return replace(base, lights=(replace(first, world_from_light=at(0.01 * k, 0.3, 0.9)), *others))


def with_ball(base: Scene, k: int) -> Scene:
    ground, moving = base.bodies
    return replace(base, bodies=(ground, replace(moving, world_from_body=at(0.01 * k, 0, 0.3))))


def camera(k: int, width: int = 640, height: int = 480) -> Camera:
    eye = np.array([1.5 * np.cos(0.02 * k), 1.5 * np.sin(0.02 * k), 1.0])
    return Camera(
        "camera", look_at(eye, np.array([0, 0, 0.2])), Lens(25e-3), Sensor((width, height), (30e-6, 30e-6))
    )


def sweep(cycles: Cycles, name: str, frames: int, step) -> None:  # type: ignore[no-untyped-def]
    spent, calls, resident = [], [], []
    for k in range(frames):
        frame, view = step(k)
        began = time.perf_counter()
        image = cycles.render(frame, view, SETTINGS, ["depth", "object_id"])
        spent.append(time.perf_counter() - began)
        calls.append(image.made_by["seconds"]["render"])
        assert cycles.worker is not None
        resident.append(cycles.worker.resident / 2**20)
    warm = slice(min(3, frames - 1), None)
    total, inside = sum(spent[warm]), sum(calls[warm])
    third = max(1, frames // 3)
    print(
        f"{name:14s} {np.median(spent[warm]):.3f} s a frame, overhead {100 * (total - inside) / inside:.1f} %, "
        f"memory {np.mean(resident[third:2 * third]):.0f} -> {np.mean(resident[-third:]):.0f} MiB, "
        f"first frame {spent[0]:.2f} s"
    )  # fmt: skip


def main() -> None:
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    base = scene()
    print(f"{frames} frames of 640 x 480, {SETTINGS.samples} samples, 100k triangles, with depth and ids")
    with Cycles() as cycles:
        sweep(cycles, "moving camera", frames, lambda k: (base, camera(k)))
        sweep(cycles, "moving lamp", max(1, frames // 5), lambda k: (with_lamp(base, k), camera(0)))
        sweep(cycles, "moving body", max(1, frames // 5), lambda k: (with_ball(base, k), camera(0)))


if __name__ == "__main__":
    main()

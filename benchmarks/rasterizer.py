"""The rasteriser against pyrender (and PyVista, where it is installed): frames per second, CPU time, memory.

    python benchmarks/rasterizer.py [--frames 12] [--triangles 100000] [--long 1000]

A bumpy sphere on a floor, one Lafortune material of three lobes, three lamps that cast shadows, a camera that circles:
every frame another view, read back as floats (pyrender: 8 bit). ``live`` is samples=1. ``x4`` is four samples a pixel
with shading="pixel": lit once a pixel but at edges, which is what pyrender's multisampling does; ``x4, every sample
lit`` is the exact mean of four. ``moving``: the sphere turns, so that no shadow map can be kept (pyrender redraws its
own every frame in any case). CPU time is that of the process, the driver's threads included: on busy cores it says
more than the clock. Ratios are medians over pairs of frames that are drawn one after the other, so that what else
the machine does falls on both.
"""

import argparse
import os
import platform
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.frames import camera_from_gl, look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.scene import Body, Scene
from realtime.renderers.pyrender import offscreen
from realtime.renderers.rasterizer import Rasterizer

SIZES = ((640, 480), (1280, 720))
LAMPS = ((2.0, -2.0, 3.0), (-2.0, -1.0, 2.5), (0.0, 3.0, 2.0))
LOBES = Lafortune(
    (0.3, 0.3, 0.3),
    weight=((0.4,) * 3, (0.2,) * 3, (0.1,) * 3),
    C=((-0.97, -0.97, 0.9), (-0.8, -0.8, 0.7), (0.7, 0.7, 0.7)),
    n=(20, 5, 8),
)


def bumpy_sphere(triangles: int) -> Mesh:
    n = int(np.sqrt(triangles / 2))
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, n + 1), np.linspace(0, np.pi, n + 1), indexing="ij")
    r = 1 + 0.05 * np.sin(8 * u) * np.sin(9 * v)
    normals = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    a = (i * (n + 1) + j).reshape(-1, 1)
    faces = np.stack([np.hstack([a, a + 1, a + n + 1]), np.hstack([a + 1, a + n + 2, a + n + 1])], axis=1)
    return Mesh(r.reshape(-1, 1) * normals, faces.reshape(-1, 3).astype(np.int32), normals)


def scene(triangles: int) -> Scene:
    corners = np.array([[-3, -3, -1.1], [3, -3, -1.1], [3, 3, -1.1], [-3, 3, -1.1]], float)
    floor = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.tile([0.0, 0, 1], (4, 1)))
    lamps = []
    for i, place in enumerate(LAMPS):
        pose = look_at(np.array(place), np.zeros(3)) @ camera_from_gl
        lamps.append(
            Light(f"/lamp{i}", LightKind.SPHERE, (20.0,) * 3, pose, cone_angle=0.8, cone_softness=0.4)
        )
    bodies = (
        Body("/sphere", bumpy_sphere(triangles), Material("gloss", LOBES)),
        Body("/floor", floor, Material("matte", Lambert())),
    )
    return Scene(bodies, tuple(lamps))


def camera(resolution: tuple[int, int], step: int) -> Camera:
    angle = 0.05 * step
    pose = look_at(np.array([3.5 * np.cos(angle), 3.5 * np.sin(angle), 2.0]), np.array([0, 0, -0.2]))
    f = resolution[1] / 2 / np.tan(0.4) * 1e-5
    return Camera("camera", pose, Lens(f), Sensor(resolution, (1e-5, 1e-5)))


@dataclass(frozen=True)
class Timing:
    """Of the median frame, s."""

    wall: float
    cpu: float


def timing(draw: Callable[[int], object], frames: int) -> Timing:
    """The first two frames are left out."""
    rows = []
    for step in range(frames + 2):
        start = time.perf_counter(), time.process_time()
        draw(step)
        rows.append((time.perf_counter() - start[0], time.process_time() - start[1]))
    wall, cpu = np.median(rows[2:], axis=0)
    return Timing(float(wall), float(cpu))


def paired(
    ours: Callable[[int], object], theirs: Callable[[int], object], frames: int
) -> tuple[float, float]:
    """How many times as fast ours is, and how many times less CPU time it takes: medians over pairs of frames, the
    first left out."""
    rows = []
    for step in range(frames + 1):
        clocks = [(time.perf_counter(), time.process_time())]
        for draw in (ours, theirs):
            draw(step)
            clocks.append((time.perf_counter(), time.process_time()))
        first, second = np.diff(clocks, axis=0)
        rows.append(second / first)
    wall, cpu = np.median(rows[1:], axis=0)
    return float(wall), float(cpu)


def resident() -> float:
    """MB of memory that the process holds now (Linux)."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def processor() -> str:
    cores = f"{len(os.sched_getaffinity(0))} cores, load {os.getloadavg()[0]:.2f} before"
    names = [x for x in Path("/proc/cpuinfo").read_text().splitlines() if x.startswith("model name")]
    return f"{names[0].split(':')[1].strip() if names else platform.machine()}, {cores}"


def turned(still: Scene, step: int) -> Scene:
    c, s = np.cos(0.1 * step), np.sin(0.1 * step)
    pose = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    return replace(still, bodies=(replace(still.bodies[0], world_from_body=pose), *still.bodies[1:]))


@contextmanager
def pyrender_view(
    still: Scene, resolution: tuple[int, int], shadows: bool
) -> Iterator[Callable[[int], object]]:
    """Draws frame k."""
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    import pyrender

    drawn = pyrender.Scene(ambient_light=np.zeros(3), bg_color=np.zeros(4))
    for body in still.bodies:
        primitive = pyrender.Primitive(
            positions=body.mesh.vertices, normals=body.mesh.normals, indices=body.mesh.faces, mode=4,
            material=pyrender.MetallicRoughnessMaterial(baseColorFactor=np.ones(4) * 0.5),
        )  # fmt: skip
        drawn.add(pyrender.Mesh([primitive]), pose=body.world_from_body)
    for light in still.lights:
        drawn.add(
            pyrender.SpotLight(color=np.ones(3), intensity=20.0, innerConeAngle=0.5, outerConeAngle=0.8),
            pose=light.world_from_light,
        )
    K = camera(resolution, 0).K
    node = drawn.add(
        pyrender.IntrinsicsCamera(K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5, znear=0.1, zfar=20.0)
    )
    renderer = offscreen(*resolution)
    flags = pyrender.RenderFlags.SHADOWS_SPOT if shadows else pyrender.RenderFlags.NONE

    def draw(step: int) -> object:
        drawn.set_pose(node, camera(resolution, step).world_from_camera @ camera_from_gl)
        return renderer.render(drawn, flags=flags)

    try:
        yield draw
    finally:
        renderer.delete()


def pyvista_frames(still: Scene, resolution: tuple[int, int], frames: int) -> Timing | None:
    try:
        import pyvista  # type: ignore[import-not-found]  # where it is installed
    except ImportError:
        return None
    plotter = pyvista.Plotter(off_screen=True, window_size=list(resolution), lighting="none")
    for body in still.bodies:
        faces = np.column_stack([np.full(len(body.mesh.faces), 3), body.mesh.faces])
        surface = pyvista.PolyData(body.mesh.vertices, faces.ravel())
        surface.point_data.set_array(body.mesh.normals, "Normals")
        plotter.add_mesh(surface, smooth_shading=True)
    for light in still.lights:
        position = tuple(light.world_from_light[:3, 3])
        plotter.add_light(pyvista.Light(position=position, positional=True, cone_angle=45, intensity=0.6))
    plotter.enable_anti_aliasing("msaa", multi_samples=4)
    plotter.enable_shadows()

    def draw(step: int) -> object:
        pose = camera(resolution, step).world_from_camera
        plotter.camera_position = [pose[:3, 3], pose[:3, 3] + pose[:3, 2], (0, 0, 1)]
        plotter.render()
        return plotter.screenshot(return_img=True)

    result = timing(draw, frames)
    plotter.close()
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--triangles", type=int, default=100_000)
    parser.add_argument("--long", type=int, default=1000, help="frames over which memory is watched")
    arguments = parser.parse_args()
    still = scene(arguments.triangles)
    moving = [turned(still, step) for step in range(arguments.frames + 2)]
    rows: dict[str, list[Timing | None]] = {}
    ratios: list[str] = []
    with Rasterizer() as renderer:
        print(f"{processor()}, {renderer.gl}")
        faces = sum(len(b.mesh.faces) for b in still.bodies)
        print(f"{faces} triangles, 3 lamps with shadows, 3-lobe Lafortune, {arguments.frames} frames each")
        for size in SIZES:

            def ours(moves: bool, size: tuple[int, int] = size, **how: Any) -> Timing:
                return timing(
                    lambda k: renderer.render(moving[k] if moves else still, camera(size, k), **how),
                    arguments.frames,
                )

            few = max(3, arguments.frames // 3)
            for moves in (False, True):
                kind = ", moving" if moves else ""
                rows.setdefault(f"live{kind}", []).append(ours(moves, samples=1))
                rows.setdefault(f"x4{kind}", []).append(ours(moves, samples=4, shading="pixel"))
            rows.setdefault("x4, every sample lit", []).append(ours(False, samples=4))
            with pyrender_view(still, size, False) as draw:
                rows.setdefault("pyrender, MSAA 4, shadows off", []).append(timing(draw, few))
            with pyrender_view(still, size, True) as draw:
                rows.setdefault("pyrender, MSAA 4, shadows on", []).append(timing(draw, few))
                for moves in (False, True):

                    def four(k: int, moves: bool = moves, size: tuple[int, int] = size) -> object:
                        shown = moving[k] if moves else still
                        return renderer.render(shown, camera(size, k), samples=4, shading="pixel")

                    kind = "moving" if moves else "still"
                    wall, cpu = paired(four, draw, few)
                    ratios.append(f"{size[0]}x{size[1]} {kind} {wall:.1f} (CPU time {cpu:.1f})")
            rows.setdefault("PyVista, MSAA 4, shadows on", []).append(pyvista_frames(still, size, few))
        report(rows)
        print("x4, times as fast as pyrender with shadows: " + ", ".join(ratios))
        watch_memory(renderer, still, arguments.long)


def report(rows: dict[str, list[Timing | None]]) -> None:
    print("| | " + " | ".join(f"{w}x{h} frames/s | ms | CPU ms" for w, h in SIZES) + " |")
    print("|---" * (1 + 3 * len(SIZES)) + "|")
    for name, found in rows.items():
        cells = [
            f"{1 / t.wall:.1f} | {t.wall * 1e3:.0f} | {t.cpu * 1e3:.0f}" if t else "not installed | - | -"
            for t in found
        ]
        print(f"| {name} | " + " | ".join(cells) + " |")


def watch_memory(renderer: Rasterizer, still: Scene, frames: int) -> None:
    """Every frame another view and another place of the sphere, so that meshes stay and all else changes."""
    first = 0.0
    for step in range(frames):
        how: dict[str, Any] = {"samples": 4, "shading": "pixel"} if step % 10 == 0 else {"samples": 1}
        renderer.render(turned(still, step), camera((160, 120), step), **how)
        if step == min(50, frames // 2):
            first = resident()
    print(
        f"memory after {min(50, frames // 2)} of {frames} frames {first:.0f} MB, after the last {resident():.0f} MB"
    )


if __name__ == "__main__":
    main()

"""Frames per second of the rasteriser against pyrender (and PyVista, where it is installed), in one run.

    python -m benchmarks.rasterizer [--frames 12] [--triangles 100000]

A bumpy sphere on a floor, one Lafortune material of three lobes, three lamps that cast shadows, a camera that circles:
every frame another view, read back as floats (pyrender: 8 bit). ``live`` is samples=1; x4 is four samples a pixel,
as many as pyrender's multisampling has. ``moving``: the sphere turns, so that no shadow map can be kept.
"""

import argparse
import os
import platform
import time
from collections.abc import Callable
from dataclasses import replace

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

LAMPS = ((2.0, -2.0, 3.0), (-2.0, -1.0, 2.5), (0.0, 3.0, 2.0))
LOBES = Lafortune(
    0.3,
    weight=(0.4, 0.2, 0.1),
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


def fps(draw: Callable[[int], object], frames: int) -> float:
    """Of the median frame, the first two left out."""
    times = []
    for step in range(frames + 2):
        start = time.perf_counter()
        draw(step)
        times.append(time.perf_counter() - start)
    return float(1 / np.median(times[2:]))


def turned(still: Scene, step: int) -> Scene:
    c, s = np.cos(0.1 * step), np.sin(0.1 * step)
    pose = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    return replace(still, bodies=(replace(still.bodies[0], world_from_body=pose), *still.bodies[1:]))


def pyrender_frames(still: Scene, resolution: tuple[int, int], frames: int, shadows: bool) -> float:
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
        return fps(draw, frames)
    finally:
        renderer.delete()


def pyvista_frames(still: Scene, resolution: tuple[int, int], frames: int) -> float | None:
    try:
        import pyvista
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

    result = fps(draw, frames)
    plotter.close()
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--triangles", type=int, default=100_000)
    arguments = parser.parse_args()
    still = scene(arguments.triangles)
    moving = [turned(still, step) for step in range(arguments.frames + 2)]
    load = os.getloadavg()[0]
    with Rasterizer() as renderer:
        print(f"{platform.machine()}, {os.cpu_count()} cores, load {load:.2f} before, {renderer.gl}")
        print(
            f"{sum(len(b.mesh.faces) for b in still.bodies)} triangles, 3 lamps with shadows, 3-lobe Lafortune"
        )
        print(f"| frames/s, {arguments.frames} frames | 640x480 | 1280x720 |\n|---|---|---|")
        rows: dict[str, list[float | None]] = {}
        for resolution in ((640, 480), (1280, 720)):

            def view(step: int, size: tuple[int, int] = resolution) -> Camera:
                return camera(size, step)

            for name, draw in {
                "rasterizer, live": lambda k: renderer.render(still, view(k), samples=1),
                "rasterizer, live, moving": lambda k: renderer.render(moving[k], view(k), samples=1),
                "rasterizer, x4": lambda k: renderer.render(still, view(k), samples=4),
                "rasterizer, x4, moving": lambda k: renderer.render(moving[k], view(k), samples=4),
            }.items():
                rows.setdefault(name, []).append(fps(draw, arguments.frames))
            for shadows in (False, True):
                name = f"pyrender, MSAA 4, shadows {'on' if shadows else 'off'}"
                rows.setdefault(name, []).append(
                    pyrender_frames(still, resolution, max(3, arguments.frames // 3), shadows)
                )
            rows.setdefault("PyVista, MSAA 4, shadows on", []).append(
                pyvista_frames(still, resolution, max(3, arguments.frames // 3))
            )
    for name, values in rows.items():
        print(
            f"| {name} | " + " | ".join("not installed" if v is None else f"{v:.1f}" for v in values) + " |"
        )
    base = rows["pyrender, MSAA 4, shadows on"]
    for name in ("rasterizer, x4", "rasterizer, x4, moving"):
        ratios = [a / b if a and b else float("nan") for a, b in zip(rows[name], base, strict=True)]
        print(f"| {name} / pyrender with shadows | " + " | ".join(f"{r:.1f}" for r in ratios) + " |")


if __name__ == "__main__":
    main()

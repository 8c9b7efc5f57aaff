"""The chapter's figures of its simulator, from our own renders of the demo's station.

    python -m composer.gallery.simulator --out docs/simulator

Fig. 4: (a) the whole scene, (b) the camera's view with what the housing hides. Fig. 5: an assembly of Phong materials
under fixed light, seen by a moving camera. Fig. 6: one scene, two renderers, their difference. Fig. 7 is drawn by
`brightfield tune` (docs/tune.md). Gruna, Irgenfried: Reflectance modeling in machine vision. 2012, section 3.1.
"""

import argparse
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analysis.view.visibility import Visibility, visibility
from composer.demo.station import station
from composer.gallery.series import save
from interchange.brdf.lambert import Lambert
from interchange.brdf.phong import Phong
from interchange.camera import Camera
from interchange.effects.parts import with_bodies
from interchange.formats import gprims
from interchange.frames import look_at
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.scene import Body, Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from realtime.renderers.rasterizer import Rasterizer

DPI = 110
ASSETS = Path(__file__).parents[2] / "assets"
PART = "Part"
# diffuse albedo, lobe height 1/sr, exponent: of the part, the plate, the jaws
PHONG = {
    PART: Phong((0.12,) * 3, (1.6, 1.6, 1.55), 45.0),
    "Plate": Phong((0.05, 0.055, 0.07), (0.05,) * 3, 12.0),
    "JawLeft": Phong((0.25, 0.09, 0.05), (0.12,) * 3, 20.0),
    "JawRight": Phong((0.05, 0.12, 0.25), (0.12,) * 3, 20.0),
}


def housed(scene: Scene) -> Scene:
    """With a housing against foreign light: a lid 0.1 m above the table, whose opening is too narrow on one side."""
    dark = Material("Housing", Lambert((0.10, 0.10, 0.11)))
    walls = [
        ((0.0, 0.12, 0.10), (0.30, 0.10, 0.004)),
        ((0.0, -0.16, 0.10), (0.30, 0.10, 0.004)),
        ((0.115, -0.02, 0.10), (0.07, 0.18, 0.004)),
        ((-0.115, -0.02, 0.10), (0.07, 0.18, 0.004)),
    ]
    bodies = [Body("Housing", _box(size), dark, _at(place)) for place, size in walls]
    return replace(scene, bodies=(*scene.bodies, *bodies))


def figure_4(scene: Scene, path: Path, renderer: Any, width: int, samples: int) -> Visibility:
    """Returns what the camera sees of the part, and what hides the rest."""
    scene = housed(scene)
    camera = scene.camera("Oblique").resized(width)
    preview = Camera(
        "Preview", look_at(np.array([0.85, -0.95, 0.66]), np.array([-0.03, -0.12, 0.13])), camera.lens
    )
    preview = replace(preview, sensor=camera.sensor, clip=(0.01, 5))
    seen = visibility(renderer, scene, camera, [PART])
    shown = with_markers(scene)
    figure = Figure(figsize=(11, 4.3), dpi=DPI, layout="constrained")
    left, right = figure.subplots(1, 2)
    left.imshow(tone(renderer.render(shown, preview, samples=samples).pixels, 0.97))
    corners = np.array(
        [
            [-0.5, -0.5],
            [width - 0.5, -0.5],
            [width - 0.5, _height(camera) - 0.5],
            [-0.5, _height(camera) - 0.5],
        ]
    )
    at = preview.project(camera.world_from_camera[:3, 3][None])[0]
    ends = preview.project(_on_table(camera, corners))
    for end, following in zip(ends, np.roll(ends, -1, axis=0), strict=True):
        left.plot(*np.stack([at, end]).T, color="#ffd23f", linewidth=0.8)
        left.plot(*np.stack([end, following]).T, color="#ffd23f", linewidth=0.8)
    left.annotate("camera", at, color="#ffd23f", fontsize=8, xytext=(5, 3), textcoords="offset points")
    left.set_title("(a) the whole scene, the camera's field on the table", fontsize=10)
    picture = tone(renderer.render(scene, camera, samples=samples).pixels)
    picture = np.where(seen.mask[..., None], 0.35 * picture + 0.65 * np.array([0.9, 0.12, 0.1]), picture)
    right.imshow(picture)
    hidden = sum(seen.hidden.values())
    right.set_title(f"(b) camera view; red: the housing hides {100 * hidden:.0f} % of the part", fontsize=10)
    for axis in (left, right):
        axis.set_xlim(-0.5, width - 0.5)
        axis.set_ylim(_height(camera) - 0.5, -0.5)
        axis.set_axis_off()
    save(figure, path)
    return seen


def figure_5(frames: list[Scene], path: Path, renderer: Any, width: int, samples: int) -> list[np.ndarray]:
    """Returns the images, (H, W, 3) radiance each."""
    images = []
    for scene in frames:
        painted = phong(scene)
        camera = painted.camera("Oblique").resized(width)
        images.append(renderer.render(painted, camera, samples=samples).pixels)
    top = float(np.percentile(images, 99.5))
    figure = Figure(figsize=(11, 6.4), dpi=DPI, layout="constrained")
    axes = figure.subplots(3, 4)
    for axis, image, scene in zip(axes.flat, images, frames, strict=True):
        axis.imshow(np.clip(image / top, 0, 1) ** (1 / 2.2))
        axis.set_title(f"frame {scene.time:g}", fontsize=8)
        axis.set_axis_off()
    save(figure, path)
    return images


def figure_6(scene: Scene, path: Path, renderer: Any, width: int, samples: int, paths: int) -> float:
    """Returns the median of path-traced over real-time radiance where light comes straight from the lamps."""
    camera = scene.camera("Oblique").resized(width)
    live = renderer.render(scene, camera, ("direct",), samples=samples)
    with Cycles() as cycles:
        true = cycles.render(scene, camera, CyclesSettings(samples=paths, denoise=1), ("direct", "object_id"))
    top = float(np.percentile(true.pixels, 99.5))
    figure = Figure(figsize=(11, 2.9), dpi=DPI, layout="constrained")
    axes = figure.subplots(1, 3)
    for axis, image, name in ((axes[0], live, "real-time"), (axes[1], true, f"path-traced, {paths} a pixel")):
        axis.imshow(np.clip(image.pixels / top, 0, 1) ** (1 / 2.2))
        axis.set_title(name, fontsize=10)
    off = (true.pixels - live.pixels).mean(axis=2) / top
    shown = axes[2].imshow(off, cmap="RdBu_r", vmin=-0.1, vmax=0.1)
    axes[2].set_title("path-traced less real-time, of white", fontsize=10)
    figure.colorbar(shown, ax=axes[2], shrink=0.7).ax.tick_params(labelsize=7)
    for axis in axes:
        axis.set_axis_off()
    save(figure, path)
    lit = (true.passes["object_id"] >= 0) & (live.passes["direct"].mean(axis=2) > 0.02 * top)
    return float(np.median(true.passes["direct"].mean(axis=2)[lit] / live.passes["direct"].mean(axis=2)[lit]))


def phong(scene: Scene) -> Scene:
    for name, brdf in PHONG.items():
        scene = with_bodies(scene, name, _painted(Material(f"Phong{name}", brdf)))
    return scene


def _painted(material: Material) -> Any:
    return lambda body: replace(body, material=material)


def with_markers(scene: Scene) -> Scene:
    """With a small box for the camera and for each lamp, which light nothing and are seen in the preview alone."""
    marks = []
    for name, pose, size, glow in (
        *(
            (c.name, c.world_from_camera, (0.05, 0.05, 0.08), 0.25)
            for c in scene.cameras
            if c.name == "Oblique"
        ),
        *((x.name, x.world_from_light, (0.014,) * 3, 2.5) for x in scene.lights),
    ):
        material = Material(f"Mark{name}", Lambert((0.3, 0.3, 0.3)), emission=(glow, glow, 0.8 * glow))
        behind = np.eye(4)
        # the camera's box lies behind its lens, a lamp's around it: neither stands in its own light
        behind[2, 3] = -0.05 if name == "Oblique" else 0.012
        marks.append(Body(f"Mark{name}", _box(size), material, pose @ behind))
    return replace(scene, bodies=(*scene.bodies, *marks))


def tone(radiance: np.ndarray, quantile: float = 0.995) -> np.ndarray:
    top = float(np.quantile(radiance, quantile)) or 1.0
    return np.asarray(np.clip(radiance / top, 0, 1) ** (1 / 2.2))


def _on_table(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """(n, 3) m: where rays through pixels (n, 2) meet z = 0."""
    rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(camera.K).T
    rays = rays @ camera.world_from_camera[:3, :3].T
    start = camera.world_from_camera[:3, 3]
    return np.asarray(start - rays * (start[2] / rays[:, 2:]))


def _height(camera: Camera) -> int:
    return camera.sensor.resolution[1]


def _box(size: tuple[float, ...]) -> Mesh:
    box = gprims.box(1.0)
    return Mesh(box.vertices * np.array(size), box.faces, box.normals, box.uv)


def _at(place: tuple[float, float, float]) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = place
    return pose


def make(out: Path, width: int = 480, samples: int = 16, paths: int = 64) -> dict[str, float]:
    """All figures into ``out``. Returns numbers that stand in them."""
    out.mkdir(parents=True, exist_ok=True)
    frames = station(ASSETS)
    with Rasterizer() as renderer:
        seen = figure_4(frames[4], out / "figure4.png", renderer, width, samples)
        images = figure_5(frames, out / "figure5.png", renderer, width // 2, samples)
        ratio = figure_6(frames[4], out / "figure6.png", renderer, width, samples, paths)
    change = min(float(np.abs(a - b).mean() / a.mean()) for a, b in pairwise(images))
    return {"hidden": sum(seen.hidden.values()), "least_change": change, "direct_ratio": ratio}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/simulator"))
    parser.add_argument("--width", type=int, default=480, help="px of a large picture")
    options = parser.parse_args()
    print(make(options.out, options.width))


if __name__ == "__main__":
    main()

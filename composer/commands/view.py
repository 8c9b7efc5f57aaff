"""`brightfield view SCENE`: what a camera sees of a workpiece, for whoever sets it up.

Field of view, scale, depth of field and blur in numbers and as maps over the image; what stands before the workpiece is
marked red and told as a share of the surface that faces the camera.
"""

import argparse
import json
import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from composer.aligned import text
from composer.demo.pictures import exposure_for, shown
from composer.frames import choose_cameras
from composer.reading import add_reading_options, options_from
from interchange.camera import Projection
from interchange.formats.atomic import written_beside
from interchange.formats.document import open_scene
from interchange.problems import BrightfieldError

HELP = (
    "tell what a camera sees of a workpiece: field, mm per pixel, depth of field, blur, what a housing hides"
)
RED = np.array([255, 40, 30])


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE")
    parser.add_argument("--camera", metavar="PRIM", help="the camera (default: the only one)")
    parser.add_argument("--time", type=float, help="time code (default: the scene's first)")
    parser.add_argument(
        "--of", nargs="+", default=[], metavar="PRIM", help="bodies of the workpiece (default: all bodies)"
    )
    parser.add_argument(
        "--blur", type=float, default=1.0, metavar="PX", help="blur that is still sharp (default 1)"
    )
    parser.add_argument("--out", type=Path, help="a folder for view.json and the pictures")
    add_reading_options(parser)


def run(args: argparse.Namespace) -> int:
    from analysis.view.footprint import footprint
    from analysis.view.optics import depth_of_field, field_of_view
    from analysis.view.visibility import named, visibility
    from realtime.renderers.rasterizer import Rasterizer

    if not args.blur > 0:
        raise BrightfieldError(f"--blur must be greater than 0 px; got {args.blur:g}.")
    document = open_scene(args.scene, options_from(args))
    scene = document.scene(document.times[0] if args.time is None else args.time)
    (camera,) = choose_cameras(scene, [args.camera] if args.camera else [scene.camera().name])
    of = args.of or [b.name for b in scene.bodies]
    parts = {b.name for b in named(scene, of)}
    sharp = replace(camera, lens=replace(camera.lens, f_stop=0.0))
    with Rasterizer() as renderer:
        found = visibility(renderer, scene, camera, of)
        image = renderer.render(scene, sharp, ["depth", "position", "normal", "object_id"], samples=1)
        picture = renderer.render(scene, sharp)
    prints = footprint(image, camera)
    ids = np.nan_to_num(np.asarray(image.passes["object_id"], float).reshape(prints.across.shape), nan=-1)
    wanted = [k for k, name in enumerate(image.object_names) if name in parts]
    on = np.isin(ids, wanted)
    distance = float(np.median(image.passes["depth"].reshape(on.shape)[on])) if on.any() else 0.0
    about: dict[str, Any] = {"camera": camera.name, "workpiece": sorted(parts)}
    if on.any():
        view = field_of_view(camera, distance)
        about |= {
            "working_distance_mm": distance * 1e3,
            "field_of_view_deg": [float(x) for x in np.degrees(view.angles)],
            "field_of_view_mm": [x * 1e3 for x in view.size],
        }
        for name, values, unit in _maps(prints):
            low, middle, high = (float(x) for x in np.percentile(values[on], [5, 50, 95]))
            about[f"{name}_{unit}"] = {"5 %": low, "median": middle, "95 %": high}
    if (
        camera.lens.projection is Projection.PERSPECTIVE
        and camera.lens.f_stop > 0
        and camera.lens.focus_distance > 0
    ):
        limits = depth_of_field(camera, args.blur)
        about["sharp_mm"] = {"from": limits.near * 1e3, "to": limits.far * 1e3, "blur_px": args.blur}
        if on.any():
            about["sharp_share_of_pixels"] = float((prints.blur[on] <= args.blur).mean())
    about["share_of_facing_surface"] = {
        "seen": found.seen,
        "outside_the_field": found.outside,
        "hidden_by_itself": found.by_itself,
        **{f"hidden_by {name}": share for name, share in found.hidden.items()},
    }
    about["facing_mm²"] = found.facing * 1e6
    print(text(about))
    if args.out is not None:
        args.out.mkdir(parents=True, exist_ok=True)
        _write(args.out / "view.json", partial(_write_text, content=json.dumps(about, indent=2) + "\n"))
        exposure = exposure_for(picture.pixels)
        marked = shown(picture.pixels, exposure).astype(float)
        marked[found.mask] = 0.35 * marked[found.mask] + 0.65 * RED
        _write(args.out / "view.png", partial(_save, pixels=np.rint(marked).astype(np.uint8)))
        for name, values, unit in _maps(prints):
            if np.nanmax(np.where(on, values, np.nan), initial=0.0) > 0:
                title = f"{name.replace('_', ' ')}, {unit.replace('_', ' ')}"
                _write(
                    args.out / f"{name}.png", partial(_map, values=np.where(on, values, np.nan), title=title)
                )
        print(f"Written to {args.out}: view.json, view.png (red: hidden), a map of each quantity.")
    return 0


def _maps(prints: Any) -> list[tuple[str, np.ndarray, str]]:
    return [
        ("scale", prints.across * 1e3, "mm_per_px"),
        ("coarsest_scale", prints.longest * 1e3, "mm_per_px"),
        ("slant", np.degrees(prints.slant), "deg"),
        ("blur", prints.blur, "px"),
    ]


def _write(path: Path, write: Callable[[Path], Any]) -> None:
    beside = written_beside(path)
    write(beside)
    os.replace(beside, path)


def _write_text(path: Path, content: str) -> None:
    path.write_text(content, encoding="utf8")


def _save(path: Path, pixels: np.ndarray) -> None:
    from PIL import Image as Pillow

    Pillow.fromarray(pixels).save(path)


def _map(path: Path, values: np.ndarray, title: str) -> None:
    from matplotlib.figure import Figure

    height, width = values.shape
    figure = Figure(figsize=(8, 8 * height / width * 0.85 + 0.6), dpi=100, layout="constrained")
    axes = figure.add_subplot()
    low, high = np.nanpercentile(values, [1, 99])
    picture = axes.imshow(values, cmap="viridis", vmin=low, vmax=high)
    axes.set_title(title, fontsize=10)
    axes.set_xlabel("column, px", fontsize=8)
    axes.set_ylabel("row, px", fontsize=8)
    axes.tick_params(labelsize=7)
    figure.colorbar(picture, ax=axes, shrink=0.8, extend="both").ax.tick_params(labelsize=7)
    figure.savefig(path)

"""Whether the rasteriser draws the same images by another OpenGL driver, and how fast: a GPU against llvmpipe.

    python benchmarks/drivers.py draw out/gpu          # on one machine: images (NumPy's .npz) and frames/s
    python benchmarks/drivers.py draw out/llvmpipe     # on another, or with another driver
    python benchmarks/drivers.py compare out/gpu out/llvmpipe

Differences are |a - b| / (b + b̄ / 1000) with the second's mean radiance b̄: the median over pixels and channels, the
99 % quantile of the pixels' greatest. At an outline: at or next to another body, a fold or a step of depth; at a
shadow: to where some lamp's visibility changes, as the second sees it. Frames/s: the rasteriser's, read back as floats,
while a body turns and the camera circles; and a live camera's, exposed on its sensor with noise.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from driver_scenes import Shot, shots
from rasterizer import camera as circling
from rasterizer import processor, turned
from rasterizer import scene as bumpy

from interchange.image import Image
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer
from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.moving_scene import MovingScene

Size = tuple[int, int]  # px
SIZES: tuple[Size, ...] = ((640, 480), (1280, 720), (1920, 1080))
PLAIN, OUTLINE, SHADOW = 0, 1, 2
PLACES = {"at an outline": OUTLINE, "at a shadow": SHADOW, "elsewhere": PLAIN}
FAR = 0.01  # relative difference that is more than rounding


def draw(folder: Path, frames: int) -> None:
    """Every shot and the speeds, into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    failed: dict[str, str] = {}
    with Rasterizer() as rasterizer:
        about: dict[str, Any] = {
            "gl": rasterizer.gl,
            "version": rasterizer.context.info["GL_VERSION"],
            "processor": processor(),
        }
        print("\n".join(about.values()), flush=True)
        for shot in shots():
            began = time.perf_counter()
            try:
                drawn(rasterizer, shot, folder)
            except BrightfieldError as error:  # the other shots tell something too
                failed[shot.name] = str(error)
            print(failed.get(shot.name, f"{shot.name}: {time.perf_counter() - began:.1f} s"), flush=True)
    about |= {"failed": failed, "speeds": speeds(frames)}
    (folder / "about.json").write_text(json.dumps(about, indent=1))


def drawn(rasterizer: Rasterizer, shot: Shot, folder: Path) -> None:
    """One shot: the image, each lamp's own where asked for, and what lies at each pixel."""
    passes = ("depth", "normal", "object_id", "lit")
    image = rasterizer.render(
        shot.scene, shot.camera, passes, shot.per_light, samples=shot.samples, shading=shot.shading
    )
    arrays = {"image": image.pixels, "places": places(image)}
    arrays |= {name: alone for name, alone in image.passes.items() if name.startswith("light:")}
    np.savez_compressed(folder / f"{shot.name}.npz", **arrays)


def places(image: Image) -> np.ndarray:
    """(H, W) uint8: what lies at or next to each pixel."""
    passes = image.passes
    depth = np.nan_to_num(passes["depth"].astype(float), posinf=0.0)
    outline = steps(passes["object_id"].astype(float), 0.5)
    outline |= steps(np.nan_to_num(passes["normal"].astype(float)), 0.3) | steps(depth, 0.02 * depth.max())
    shadow = np.zeros_like(outline)
    for name, share in passes.items():
        if name.startswith("lit:"):
            shadow |= steps(share.astype(float), 1e-3)
    return np.where(spread(outline), OUTLINE, np.where(spread(shadow), SHADOW, PLAIN)).astype(np.uint8)


def steps(values: np.ndarray, least: float) -> np.ndarray:
    """(H, W) bool: pixels on either side of a step of more than ``least`` to the next row or column."""
    found = np.zeros(values.shape[:2], bool)
    for axis in (0, 1):
        step = np.abs(np.diff(values, axis=axis)) > least
        step = step.any(axis=2) if step.ndim == 3 else step
        for sides in ((0, 1), (1, 0)):
            found |= np.pad(step, [sides if k == axis else (0, 0) for k in (0, 1)])
    return found


def spread(mask: np.ndarray) -> np.ndarray:
    """The mask and the pixels around it."""
    padded = np.pad(mask, 1)
    h, w = mask.shape
    return np.asarray(np.any([padded[j : j + h, i : i + w] for j in range(3) for i in range(3)], axis=0))


def speeds(frames: int) -> dict[str, float]:
    """Frames/s by way and size, of the median frame."""
    still, found = bumpy(100_000), {}
    with Rasterizer() as rasterizer:
        for size in SIZES:
            for samples, shading in ((1, "sample"), (4, "pixel"), (16, "sample")):
                name = f"rasteriser, {size[0]}×{size[1]}, ×{samples}"
                found[name] = rate(drawing(rasterizer, still, size, samples, shading), frames)
    for size in SIZES:
        for samples in (1, 4):
            lens = circling(size, 0)
            sensor = replace(lens.sensor, responsivity=1e6, read_noise=7.0, black_level=64.0)
            fitted = replace(lens, name="/camera", t_exp=1e-3, sensor=sensor)
            moving = MovingScene(replace(still, cameras=(fitted,)))
            with VirtualCamera(moving, samples=samples, format="Mono8") as camera:
                name = f"camera, {size[0]}×{size[1]}, ×{samples}"
                found[name] = rate(reading(camera, moving, still, size), frames)
    return found


def drawing(
    rasterizer: Rasterizer, still: Scene, size: Size, samples: int, shading: str
) -> Callable[[int], object]:
    """Frame k."""
    return lambda k: rasterizer.render(turned(still, k), circling(size, k), samples=samples, shading=shading)


def reading(camera: VirtualCamera, moving: MovingScene, still: Scene, size: Size) -> Callable[[int], object]:
    """Frame k."""

    def frame(k: int) -> object:
        moving.set_body_pose("/sphere", turned(still, k).bodies[0].world_from_body)
        moving.set_camera_pose("/camera", circling(size, k).world_from_camera)
        return camera.read()

    return frame


def rate(frame: Callable[[int], object], frames: int) -> float:
    """Frames/s by the median frame, the first two left out."""
    seconds = []
    for k in range(frames + 2):
        began = time.perf_counter()
        frame(k)
        seconds.append(time.perf_counter() - began)
    return float(1 / np.median(seconds[2:]))


def compare(first: Path, second: Path) -> None:
    """Print the two tables."""
    a, b = (json.loads((folder / "about.json").read_text()) for folder in (first, second))
    print(f"{a['gl']} ({a['version']}) against {b['gl']} ({b['version']})\n")
    print(
        f"| image | median | 99 % | mean of the image | beyond {FAR:.0%} | {' | '.join(PLACES)} |\n|{'---|' * 8}"
    )
    for path in sorted(second.glob("*.npz")):
        if (first / path.name).exists():
            with np.load(first / path.name) as ours, np.load(path) as theirs:
                for name in (n for n in theirs.files if n != "places"):
                    label = path.stem + name.replace("image", "").replace("light:", ", ")
                    print(f"| {label} | {' | '.join(row(ours[name], theirs[name], theirs['places']))} |")
    print(f"\n| frames/s | {a['gl']} | {b['gl']} | ratio |\n|{'---|' * 4}")
    for name, ours in a["speeds"].items():
        print(f"| {name} | {ours:.1f} | {b['speeds'][name]:.1f} | {ours / b['speeds'][name]:.1f} |")
    for about in (a, b):
        for name, error in about["failed"].items():
            print(f"{about['gl']} did not draw {name}: {error}")


def row(ours: np.ndarray, theirs: np.ndarray, place: np.ndarray) -> list[str]:
    x, y = ours.astype(float), theirs.astype(float)
    relative = np.abs(x - y) / (np.abs(y) + np.abs(y).mean() / 1000 + 1e-30)
    worst = np.where(np.isfinite(relative), relative, np.inf).max(axis=2)
    far = [int((worst[place == number] > FAR).sum()) for number in PLACES.values()]
    middle, tail = np.median(relative), np.quantile(worst, 0.99)
    share = f"{sum(far)} of {worst.size}"
    return [f"{middle:.1e}", f"{tail:.1e}", f"{x.mean() / y.mean() - 1:+.1e}", share, *map(str, far)]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("do", choices=("draw", "compare"))
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--frames", type=int, default=20, help="of each speed")
    a = parser.parse_args()
    if len(a.folders) != (1 if a.do == "draw" else 2):
        parser.error("draw takes one folder, compare two")
    undrawn = [str(f) for f in a.folders if a.do == "compare" and not (f / "about.json").is_file()]
    if undrawn:
        parser.error(f"nothing was drawn into {' or '.join(undrawn)}")
    if a.do == "draw":
        draw(a.folders[0], a.frames)
    else:
        compare(*a.folders)


if __name__ == "__main__":
    main()

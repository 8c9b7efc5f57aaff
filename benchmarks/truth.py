"""How true the images are, in figures: both renderers, closed forms, and an engine that is not ours.

    python benchmarks/truth.py [--samples 64] [--out docs/truth.md]

Writes the table that stands in docs/truth.md. Some ten minutes on two cores.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.ndimage import binary_dilation

from analysis.agreement import Agreement, agreement, edges
from interchange.formats import exr
from interchange.formats.document import open_scene
from interchange.image import Image
from interchange.scene import Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from realtime.renderers.rasterizer import Rasterizer

BENCH = Path(__file__).parents[1] / "assets/bench_sample"
FRAMES = (("camera0_led0", 0, "Camera0"), ("camera0_led4", 4, "Camera0"),
          ("camera0_led5", 5, "Camera0"), ("camera1_led0", 15, "Camera1"))  # fmt: skip
PASSES = ("depth", "normal", "position", "object_id", "material_id", "direct", "indirect")


def row(name: str, result: Agreement) -> str:
    within = " | ".join(f"{100 * share:.1f} %" for share in result.within.values())
    return (
        f"| {name} | {100 * result.median:.2f} % | {100 * result.bias:+.2f} % | {within} | {result.pixels} |"
    )


def blocks(plane: np.ndarray, size: int) -> np.ndarray:
    h, w = (n // size for n in plane.shape[:2])
    return plane[: size * h, : size * w].reshape(h, size, w, size, -1).mean(axis=(1, 3))


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--samples", type=int, default=64)
    arguments.add_argument("--out", type=Path)
    args = arguments.parse_args()
    document = open_scene(BENCH / "scene.usda")
    against_mitsuba, against_each_other, closed = [], [], []
    with Cycles() as cycles:
        rasterizer = Rasterizer()
        for file, time, name in FRAMES:
            scene = document.scene(time)
            camera = scene.camera(name)
            ours = cycles.render(scene, camera, CyclesSettings(samples=args.samples), passes=PASSES)
            theirs = exr.read(BENCH / f"{file}.exr")
            seen = (ours.passes["object_id"] >= 0) & ~edges(ours, 3)
            against_mitsuba.append(row(f"{file}, all", agreement(ours, theirs, seen)))
            smooth = cycles.render(scene, camera, CyclesSettings(samples=args.samples, denoise=1))
            lit = seen & away_from_shadow(ours)
            against_mitsuba.append(row(f"{file}, all, denoised", agreement(smooth, theirs, seen)))
            against_mitsuba.append(row(f"{file}, lit, denoised", agreement(smooth, theirs, lit)))
            for size in (3, 8):
                whole = blocks(lit[..., None].astype(float), size)[..., 0] == 1
                pair = (Image(blocks(i.pixels, size)) for i in (smooth, theirs))
                against_mitsuba.append(
                    row(f"{file}, lit, means of {size} × {size} px", agreement(*pair, whole))
                )
            live = rasterizer.render(scene, camera, samples=64)
            direct = Image(ours.passes["direct"])
            against_each_other.append(row(file, agreement(live, direct, seen)))
            closed.append(closed_form(file, scene, ours, live, seen))
            print(
                *against_mitsuba[-5:],
                against_each_other[-1],
                closed[-1],
                sep="\n",
                flush=True,
            )
    text = page(args.samples, against_mitsuba, against_each_other, closed)
    if args.out:
        head = args.out.read_text().split("<!-- figures -->")[0] if args.out.exists() else ""
        args.out.write_text(f"{head}<!-- figures -->\n{text}")


def away_from_shadow(image: Image) -> np.ndarray:
    """(H, W) bool: pixels more than three from any that the lamp does not reach."""
    dark = image.passes["direct"].mean(axis=-1) <= 0
    return ~np.asarray(binary_dilation(dark, iterations=3))


def closed_form(file: str, scene: Scene, ours: Image, live: Image, seen: np.ndarray) -> str:
    """Direct light on the Lambertian table, where one lamp is on, against f · I cos / r² at the pixel's own point."""
    lamp = next(light for light in scene.lights if light.is_on)
    base = scene.material_names.index("/World/Materials/base")
    position = ours.passes["position"].astype(np.float64)
    to_lamp = lamp.world_from_light[:3, 3] - position
    distance = np.linalg.norm(to_lamp, axis=-1)
    cos = np.sum(to_lamp * ours.passes["normal"], axis=-1) / distance
    albedo = next(b.material.brdf for b in scene.bodies if b.material.name.endswith("base")).flat()[0]
    expected = albedo / np.pi * lamp.intensity[0] * cos / distance**2
    direct = ours.passes["direct"].mean(axis=-1)
    lit = seen & (ours.passes["material_id"] == base) & (direct > 0.98 * expected)  # shadows apart
    parts = [
        float(np.median(plane[lit] / expected[lit]) - 1) for plane in (direct, live.pixels.mean(axis=-1))
    ]
    return f"| {file} | {parts[0]:+.1e} | {parts[1]:+.1e} | {int(lit.sum())} |"


def page(samples: int, mitsuba: list[str], each_other: list[str], closed: list[str]) -> str:
    head = (
        "| frame | median difference | bias | within 1 % | within 2 % | pixels |\n|---|---|---|---|---|---|\n"
    )
    return "\n".join(
        [
            "## Against an engine that is not ours",
            "",
            f"The path tracer with {samples} samples a pixel against Mitsuba 3 with 256, all bounces; pixels up to "
            "three from an edge of a body are left out. Denoised: our reflected light, by Open Image "
            "Denoise. Lit: also more than three from a shadow.",
            "",
            head + "\n".join(mitsuba),
            "",
            "## Both renderers against each other",
            "",
            "The rasteriser (64 samples) against the path tracer's direct light, shadow edges included.",
            "",
            head + "\n".join(each_other),
            "",
            "## Against the closed form",
            "",
            "Median of radiance over ρ/π · I cos θ / r² minus one, on the lit part of the Lambertian table.",
            "",
            "| frame | path tracer | rasteriser | pixels |",
            "|---|---|---|---|",
            *closed,
            "",
        ]
    )


if __name__ == "__main__":
    main()

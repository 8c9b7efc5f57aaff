"""Blind cases for the diagnosis: what it finds in captures whose effect is drawn by lot and withheld.

    python benchmarks/diagnosis.py --out DIR [--seed N] [--only KIND ...] [--table docs/diagnosis.md]

The bench scene at half its size. Radiance comes from the rasteriser at 64 samples a pixel, the diagnosis has 16; the
effect is written here in another form than the catalogue's where there is one, and every case has calibration
errors drawn from the declared tolerances: registration, lamps, albedo, flat field, black level, fixed pattern.
Both images come from one renderer: these cases test the statistics, not the renderer.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from analysis.gap.diagnose import diagnose
from analysis.gap.diagnosis import record
from analysis.gap.radiance import Rendered, render_all
from analysis.gap.renderers import renderer
from interchange.formats import captures as captures_file
from interchange.formats import images
from interchange.formats.document import open_scene

BENCH = Path(__file__).parents[1] / "assets/bench_sample/scene.usda"
WIDTH, HEIGHT = 240, 180
TIMES = [*range(6), 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17]
EXPOSURE = {**dict.fromkeys(range(18), 1.0), **dict.fromkeys((6, 7, 8, 9, 13, 14), 0.5), 10: 0.25}

Field = np.ndarray
column, row = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
X, Y = (column - (WIDTH - 1) / 2) / (WIDTH / 2), (row - (HEIGHT - 1) / 2) / (WIDTH / 2)
R2 = (X**2 + Y**2) / (1 + (HEIGHT / WIDTH) ** 2)


def warped(E: Field, x: Field, y: Field) -> Field:
    x, y = x.astype(np.float32), y.astype(np.float32)
    return cv2.remap(E, x, y, cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REPLICATE)


def scaled(E: Field, s: Field | float) -> Field:
    cx, cy = (WIDTH - 1) / 2, (HEIGHT - 1) / 2
    return warped(E, cx + (column - cx) * s, cy + (row - cy) * s)


def two_blurs(E: Field, s: float) -> Field:
    return 0.7 * cv2.GaussianBlur(E, (0, 0), 0.75 * s) + 0.3 * cv2.GaussianBlur(E, (0, 0), 1.4 * s)


def per_channel(E: Field, scales: tuple[float, float, float]) -> Field:
    return np.stack([scaled(np.ascontiguousarray(E[..., k]), s) for k, s in enumerate(scales)], axis=-1)


def smeared(E: Field, length: float) -> Field:
    steps = np.linspace(-0.5, 0.5, 15) * length
    return np.mean([warped(E, column + 0.94 * t, row + 0.34 * t) for t in steps], axis=0)


# on electrons (H, W, 3); ``a`` is the severity
CHAIN: dict[str, Callable[[Field, float], Field]] = {
    "vignetting": lambda E, a: E * ((1 + R2 * 0.25) ** (-1.2 * a))[..., None],
    "veiling_glare": lambda E, a: (1 - 0.03 * a) * E + 0.03 * a * E.mean((0, 1)) * (1.08 - 0.16 * R2)[..., None],
    "exposure": lambda E, a: E * (1 + 0.03 * a),
    "response_curve": lambda E, a: E * (1 - 0.05 * a * E / 10500),
    "white_balance": lambda E, a: E * np.array([1 + 0.03 * a, 1, 1 - 0.025 * a]),
    "color_crosstalk": lambda E, a: E @ (np.eye(3) + 0.01 * a * np.array([[-6, 6, 0], [2, -5, 3], [0, 5, -5]])).T,
    "lateral_chromatic_aberration": lambda E, a: per_channel(E, (1 - 0.0025 * a, 1.0, 1 + 0.002 * a)),
    "defocus": lambda E, a: two_blurs(E, 0.55 * np.sqrt(a)),
    "motion_blur": lambda E, a: smeared(E, 1.8 * np.sqrt(a)),
    "lens_distortion": lambda E, a: scaled(E, 1 / (1 - 0.004 * a * R2)),
    "principal_point": lambda E, a: warped(E, column + 0.5 * a, row - 0.4 * a),
    "ghost": lambda E, a: E + 0.02 * a * E[::-1, ::-1],
    "smudge": lambda E, a: E * (1 - 0.12 * a * np.exp(-((column - 160) ** 2 + (row - 70) ** 2) / 900))[..., None],
    "stripes": lambda E, a: E * (1 + 0.02 * a * np.sin(2 * np.pi * row / 17))[..., None],
}  # fmt: skip
SCENE = ("light_intensity", "albedo", "ambient_light", "light_beam")
OUTSIDE = ("ghost", "smudge", "stripes")
PAIRS = (("vignetting", "black_level"), ("veiling_glare", "lateral_chromatic_aberration"))
KINDS = ("null", "null", "null", *CHAIN, *SCENE, "black_level", *("+".join(p) for p in PAIRS))


def scene_file(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "scene.usda"
    path.write_text(BENCH.read_text().replace("(480, 360)", f"({WIDTH}, {HEIGHT})"))
    return path


def make(kind: str, folder: Path, truth: list[Rendered], rng: np.random.Generator) -> None:
    """Write the captures of a case: ``kind`` names its effects; all else is drawn."""
    document = open_scene(scene_file(folder))
    effects = [] if kind == "null" else kind.split("+")
    a = float(rng.uniform(0.8, 1.6))
    flat = 1 + 0.003 * cv2.resize(rng.standard_normal((3, 4)), (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
    prnu = 1 + 0.004 * rng.standard_normal((2, HEIGHT, WIDTH, 3))
    lamps = {x.name: 1 + 0.005 * rng.standard_normal() for x in document.scene(6).lights}
    albedo = {n: 1 + 0.005 * rng.standard_normal(3) for n in document.scene(6).material_names}
    shift = 0.05 * rng.standard_normal((2, 2))
    offset = rng.standard_normal() + (6 * a if "black_level" in effects else 0)
    if "light_intensity" in effects:
        lamps["/World/LED4"] *= 1 + 0.06 * a
    if "albedo" in effects:
        albedo["/World/Materials/white"] *= 1 + 0.05 * a * np.array([1.0, 0.8, 0.6])
    entries = []
    for t, shown in zip(TIMES, truth, strict=True):
        scene = document.scene(t)
        name = "/World/Camera0" if t < 13 else "/World/Camera1"
        camera = scene.camera(name)
        ids = shown.passes["material_id"]
        L = np.zeros((HEIGHT, WIDTH, 3))
        for lamp, weight in shown.weights(scene).items():
            layer = lamps[lamp] * weight * shown.lamps[lamp]
            if "light_beam" in effects and weight.any():
                light = next(x for x in scene.lights if x.name == lamp)
                d = light.world_from_light[:3, 3] - np.nan_to_num(shown.passes["position"])
                axis = light.world_from_light[:3, 3] / np.linalg.norm(light.world_from_light[:3, 3])
                cos = np.clip((d @ axis) / np.linalg.norm(d, axis=-1), 0.05, 1)
                layer = layer * np.exp(-0.35 * a * (1 / cos - 1))[..., None]
            L += layer
        for k, material in enumerate(shown.scene.material_names):
            L[ids == k] *= albedo[material]
        if "ambient_light" in effects:
            L += 0.35 * a * np.array([0.8, 1.0, 1.25]) * shown.ambient
        E = camera.sensor.responsivity * EXPOSURE[t] * L
        which = 0 if t < 13 else 1
        E = warped(E.astype(np.float32), column + shift[which, 0], row + shift[which, 1])
        for effect in effects:
            if effect in CHAIN:
                E = CHAIN[effect](np.asarray(E, np.float32), a)
        E = np.maximum(E, 0) * flat[..., None]
        electrons = rng.poisson(E) * prnu[which] + camera.sensor.read_noise * rng.standard_normal(E.shape)
        dn = np.clip(np.rint(camera.sensor.black_level + offset + camera.sensor.K * electrons), 0, 4095)
        file = folder / f"{t:03d}.png"
        images.write(file, dn.astype(np.uint16))
        entries.append({"image": file.name, "camera": name, "time": t, "exposure": EXPOSURE[t]})
    head = {"scene": "scene.usda", "captures": entries}
    (folder / "captures.json").write_text(json.dumps(head))


def truth_of(out: Path) -> list[Rendered]:
    document = open_scene(scene_file(out / "truth"))
    views = []
    for t in TIMES:
        scene = document.scene(t)
        views.append(
            (scene, replace(scene.camera("/World/Camera0" if t < 13 else "/World/Camera1"), t_exp=1.0))
        )
    with renderer("realtime", 64) as (render, settings):
        return render_all(views, render, settings, out / "cache")


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--out", type=Path, required=True)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--only", nargs="*", default=list(KINDS))
    arguments.add_argument("--table", type=Path)
    args = arguments.parse_args()
    truth = truth_of(args.out)
    rows = []
    for k, kind in enumerate(args.only):
        folder = args.out / f"case{k:02d}_{args.seed}"
        make(kind, folder, truth, np.random.default_rng([args.seed, k]))
        began = time.monotonic()
        captures = captures_file.read(folder / "captures.json")
        with renderer("realtime", 16) as (render, settings):
            found = diagnose(
                captures, open_scene(captures.scene), render, settings, args.out / "cache", folder
            ).diagnosis
        (folder / "diagnosis.json").write_text(json.dumps(record(found)))
        said = " + ".join(f"{f.name} ({f.probability:.2f})" for f in found.effects) or "none"
        said += "".join(f"; unknown: {w}" for w, _ in found.unknown)
        g = found.gap
        rows.append(
            f"| {kind} | {said} | {g.before:.2f} → {g.after:.2f} | {100 * g.explained:.0f} % "
            f"| {time.monotonic() - began:.0f} |"
        )
        print(rows[-1], flush=True)
    if args.table:
        head = args.table.read_text().split("<!-- figures -->")[0] if args.table.exists() else ""
        title = "| truth | said | chi on held-out captures | closed | s |\n|---|---|---|---|---|\n"
        args.table.write_text(f"{head}<!-- figures -->\n{title}" + "\n".join(rows) + "\n")


if __name__ == "__main__":
    main()

"""Illumination series on rendered truth: defects, materials, normals; and the speed of the detector.

    python benchmarks/series.py [--out docs/series.md] [--only defects materials normals sphere speed] [--size 96]
        [--seeds 5] [--keep FOLDER]

Writes the tables that stand at the end of docs/series.md. ``--keep``: captures stay there and are taken up again.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from analysis.series.anomalies import Law, find_anomalies
from analysis.series.capture import capture
from analysis.series.clusters import adjusted_rand, k_means
from analysis.series.covariance import BLOCK, Estimator, distances, moments
from analysis.series.lafortune_features import lafortune_features
from analysis.series.lightings import Lighting, distant, dome, hemisphere, reflector
from analysis.series.mirror_sphere import highlights, lights_of_sphere, outline_of, sphere_of_outline
from analysis.series.near_stereo import near_photometric_stereo
from analysis.series.photometric_stereo import Method, angular_error, photometric_stereo
from analysis.series.scores import area_under_roc, detection
from analysis.series.specimens import Specimen, camera_above, circuit_board, fixture_relief, textured_plastic
from analysis.sphere import ball
from interchange.brdf.ggx import Ggx
from interchange.image import Image
from interchange.lamps.reflector import ReflectorDevice
from interchange.material import Material
from interchange.scene import Body, Scene
from interchange.series import Series
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from realtime.renderers.rasterizer import Rasterizer

MARK = "<!-- figures -->"


def series_of(specimen: Specimen, folder: Path, renderer: Rasterizer, seed: int) -> Series:
    """144 images of the reflector device, DN with noise."""
    return capture(
        specimen.scene,
        specimen.camera,
        reflector(ReflectorDevice()),
        folder,
        lambda scene, camera: renderer.render(scene, camera, samples=4),
        {"renderer": "rasterizer", "samples": 4},
        digital=True,
        seed=seed,
    )


def defects(keep: Path, size: int, seeds: int) -> list[str]:
    kinds = ("scratch", "stain", "groove", "dent")
    scores: dict[str, list[np.ndarray]] = {}
    with Rasterizer() as renderer:
        for seed in range(seeds):
            specimen = textured_plastic(size, seed)
            series = series_of(specimen, keep / f"plastic{size}_{seed}", renderer, seed)
            bad = specimen.truth > 0
            rows: dict[str, tuple[np.ndarray, np.ndarray]] = {}
            for estimator in (Estimator.SAMPLE, Estimator.SHRUNK, Estimator.TRIMMED):
                a = find_anomalies(series, 0.95, estimator)
                rows[f"RX, 144 images, {estimator}, χ²"] = a.delta, a.mask
            a = find_anomalies(series, 0.95, Estimator.TRIMMED, Law.EMPIRICAL)
            rows["RX, 144 images, trimmed, empirical"] = a.delta, a.mask
            a = find_anomalies(series, 0.95, Estimator.SAMPLE, least_area=6)
            rows["RX, 144 images, sample, χ², groups of 6 px or more"] = a.delta, a.mask
            singles = [find_anomalies(series.choose([k]), 0.95) for k in range(len(series))]
            aucs = [area_under_roc(bad, s.delta) for s in singles]
            for name, k in (
                ("best", int(np.argmax(aucs))),
                ("median", int(np.argsort(aucs)[len(aucs) // 2])),
            ):
                rows[f"single image, {name} of 144 by AUC"] = singles[k].delta, singles[k].mask
            mean = Series(series.images.mean(axis=0, keepdims=True), series.wi[:1])
            a = find_anomalies(mean, 0.95)
            rows["mean image"] = a.delta, a.mask
            for name, (delta, mask) in rows.items():
                scores.setdefault(name, []).append(scored(specimen.truth, delta, mask))
    lines = [
        "## Defects",
        "",
        f"Grained plastic, {size} px, 144 images of the reflector device with noise, γ = 0.95; means over {seeds} "
        f"plates. {', '.join(kinds)}: AUC against sound pixels / share found.",
        "",
        "| | precision | recall | false alarms | AUC | " + " | ".join(kinds) + " |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, rows in scores.items():
        m = np.mean(rows, axis=0)
        each = " | ".join(f"{m[4 + k]:.3f} / {m[8 + k]:.2f}" for k in range(4))
        lines.append(f"| {name} | {m[0]:.3f} | {m[1]:.3f} | {m[2]:.3f} | {m[3]:.3f} | {each} |")
    return lines


def scored(truth: np.ndarray, delta: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Precision, recall, false alarms, AUC; AUC of each kind against sound pixels; share found of each kind."""
    bad = truth > 0
    d = detection(bad, delta, mask)
    own = [(truth == k) | ~bad for k in range(1, 5)]
    each = [area_under_roc(bad[o], delta[o]) for o in own]
    found = [float(mask[truth == k].mean()) for k in range(1, 5)]
    return np.array([d.precision, d.recall, d.false_alarms, d.auc, *each, *found])


def materials(keep: Path, size: int, seeds: int) -> list[str]:
    rows: dict[str, list[tuple[float, float]]] = {}
    with Rasterizer() as renderer:
        for seed in range(seeds):
            specimen = circuit_board(size, seed)
            series = series_of(specimen, keep / f"board{size}_{seed}", renderer, seed)
            truth = specimen.truth
            inside = minimum_filter(truth, 3) == maximum_filter(truth, 3)
            lobes = lafortune_features(series)
            raw = np.moveaxis(series.grey, 0, -1)
            lobe_alone = lobes.additive - lobes.additive[..., :1] * [0, 1, 0]
            for name, x, standardise in (
                ("144 values as they are (the chapter's)", raw, False),
                ("144 values, standardised", raw, True),
                ("C_z, k_d, n as they are", lobes.features, False),
                ("C_z, k_d, n, standardised (the chapter's)", lobes.features, True),
                ("k_d, albedo, height, standardised", lobes.additive, True),
                ("k_d, albedo of the lobe alone, height, standardised", lobe_alone, True),
            ):
                labels = k_means(x, 4, seed, standardise).labels
                ari = adjusted_rand(labels, truth), adjusted_rand(labels[inside], truth[inside])
                rows.setdefault(name, []).append(ari)
    lines = [
        "## Materials",
        "",
        f"Circuit board, {size} px, 144 images, k-means with k = 4, {seeds} seeds (board, noise, starts). "
        "Adjusted Rand index, mean and standard deviation; inside: pixels whose 3 x 3 neighbourhood is of one "
        "material.",
        "",
        "| features | all pixels | inside |",
        "|---|---|---|",
    ]
    for name, found in rows.items():
        m, s = np.mean(found, axis=0), np.std(found, axis=0)
        lines.append(f"| {name} | {m[0]:.3f} ± {s[0]:.3f} | {m[1]:.3f} ± {s[1]:.3f} |")
    return lines


CAUSES = ("highlights", "shadows", "near light", "light calibration", "interreflection")
ANGLES = hemisphere(np.radians([25, 45]), 8)
NEAR = 0.08  # m
OFF = np.radians(2.0)  # rms of an axis, of what the directions to the lamps are known to


def stereo(keep: Path, size: int) -> list[str]:
    errors: dict[str, dict[str, float]] = {}
    with Cycles() as cycles:

        def images(on: frozenset[str]) -> tuple[Series, np.ndarray]:
            specimen = fixture_relief(size, gloss=0.06 if "highlights" in on else 0.0)
            steps: list[Lighting] = dome(ANGLES, NEAR) if "near light" in on else distant(ANGLES)
            if "shadows" not in on:
                steps = [
                    replace(s, lights=tuple(replace(x, casts_shadows=False) for x in s.lights)) for s in steps
                ]
            settings = CyclesSettings(samples=32, max_bounces=4)

            def render(scene: Scene, camera: object) -> Image:
                image = cycles.render(scene, specimen.camera, settings, ("direct",))
                pixels = image.pixels if "interreflection" in on else image.passes["direct"]
                return replace(image, pixels=pixels)

            name = "_".join(sorted(w.replace(" ", "") for w in on)) or "none"
            series = capture(
                specimen.scene,
                specimen.camera,
                steps,
                keep / f"stereo{size}_{name}",
                render,
                {**settings.as_dict(), "on": sorted(on)},
            )
            return series, specimen.normals

        cache: dict[frozenset[str], tuple[Series, np.ndarray]] = {}

        def error(on: frozenset[str], method: Method = Method.LEAST_SQUARES, near: bool = False) -> float:
            drawn = on - {"light calibration"}
            if drawn not in cache:
                cache[drawn] = images(drawn)
            series, truth = cache[drawn]
            if not near:  # taken for distant light that is everywhere the same
                h, w = series.shape
                E = series.irradiance[:, h // 2, w // 2] if series.irradiance.ndim == 3 else series.irradiance
                series = replace(
                    series, wi=series.directions.astype(np.float64), irradiance=E, positions=None
                )
            if "light calibration" in on:
                rng = np.random.default_rng(0)
                wi = series.wi + OFF * rng.normal(size=(len(series), 3))
                series = replace(series, wi=wi / np.linalg.norm(wi, axis=-1, keepdims=True))
            found = (
                near_photometric_stereo(series, method=method).normals
                if near
                else photometric_stereo(series, method)
            )
            return float(np.degrees(np.nanmean(angular_error(found.n, truth))))

        every = frozenset(CAUSES)
        none = error(frozenset())
        full = error(every)
        for cause in CAUSES:
            errors[cause] = {"alone": error(frozenset({cause})), "without": error(every - {cause})}
        robust = {m: error(every, m) for m in Method}
        solved = error(frozenset({"near light"}), near=True)
    lines = [
        "## Normals: causes of error",
        "",
        f"Mean angle in degrees between true and measured normals of a relief in a fixture, {size} px, "
        f"{len(ANGLES)} lamps, path-traced, least squares. Near light: lamps {NEAR * 1e3:.0f} mm away, taken for "
        f"distant. Light calibration: directions {np.degrees(OFF):.0f}° off, rms of an "
        f"axis. All causes off {none:.2f}°, all on {full:.2f}°.",
        "",
        "| cause | it alone | all but it | what switching it off gains |",
        "|---|---|---|---|",
    ]
    for cause, e in errors.items():
        lines.append(f"| {cause} | {e['alone']:.2f} | {e['without']:.2f} | {full - e['without']:+.2f} |")
    lines += ["", "| estimator, all causes on | mean error |", "|---|---|"]
    lines += [f"| {m} | {e:.2f} |" for m, e in robust.items()]
    lines += ["", f"Near light alone, with heights solved for: {solved:.2f}°."]
    return lines


def sphere(keep: Path) -> list[str]:
    """Directions from a rendered mirror sphere."""
    camera, radius = camera_above(256, 22e-3), 10e-3
    pose = np.diag([radius, radius, radius, 1.0])
    pose[2, 3] = radius
    steel = Material(
        "/steel", Ggx(diffuse=(0.0,) * 3, alpha_x=0.03, alpha_y=0.03, eta=(2.5,) * 3, k=(3.5,) * 3)
    )
    scene = Scene((Body("/ball", ball(), steel, pose),))
    angles = hemisphere(np.radians([15, 35, 55, 70]), 8)
    with Rasterizer() as renderer:
        series = capture(
            scene,
            camera,
            distant(angles),
            keep / "sphere",
            lambda s, c: renderer.render(s, c, samples=16),
            {"samples": 16},
        )
        shown = renderer.render(scene, camera, ("depth",), samples=1)
    mask = np.isfinite(shown.passes["depth"])
    found = sphere_of_outline(camera, outline_of(mask), radius)
    seen = lights_of_sphere(camera, found, highlights(series.grey, mask))
    off = np.degrees(angular_error(seen.wi, series.wi))
    return [
        "## Directions from a mirror sphere",
        "",
        f"{len(series)} lamps, polished ball of 20 mm, 256 px, outline from its mask: {off.mean():.2f}° mean, "
        f"{off.max():.2f}° worst (at 70° from the axis); one pixel at the middle is "
        f"{np.degrees(2 * 22e-3 / 256 / radius):.2f}°.",
    ]


def speed() -> list[str]:
    """RX on 144 images of 1 Mpx, against the products it needs."""
    rng = np.random.default_rng(0)
    lamps, pixels = 144, 1 << 20
    x = rng.standard_normal((lamps, pixels), np.float32)
    for k in range(1, lamps):  # images are alike
        x[k] += np.float32(0.5) * x[k - 1]
    x += 10

    def timed(work: Callable[[], object], times: int = 3) -> float:
        best = np.inf
        for _ in range(times):
            start = time.perf_counter()
            work()
            best = min(best, time.perf_counter() - start)
        return best

    w = np.asarray(rng.standard_normal((lamps, lamps)), np.float32)
    out = np.empty((lamps, BLOCK), np.float32)

    def whiten() -> None:
        for start in range(0, pixels, BLOCK):
            np.matmul(w, x[:, start : start + BLOCK], out=out)

    y = x.T.copy()
    general = timed(partial(np.matmul, x, y))
    symmetric = timed(lambda: x @ x.T)
    white = timed(whiten)
    background = moments(x)
    ours = timed(lambda: distances(x, moments(x)))
    first, second = timed(lambda: moments(x)), timed(lambda: distances(x, background))
    return [
        "## Speed",
        "",
        "RX on 144 images of 1 Mpx, float32, best of three, one run:",
        "",
        "| | s |",
        "|---|---|",
        f"| product X Xᵀ, as of any two matrices | {general:.2f} |",
        f"| the same, which BLAS knows to be symmetric | {symmetric:.2f} |",
        f"| product W X | {white:.2f} |",
        f"| mean and covariance | {first:.2f} |",
        f"| distances | {second:.2f} |",
        f"| RX | {ours:.2f} |",
        "",
        f"RX over the two products that it needs (X Xᵀ and W X): {ours / (general + white):.2f}; over X Xᵀ alone: "
        f"{ours / general:.2f}.",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, help="page at whose end the tables go")
    known = ("defects", "materials", "normals", "sphere", "speed")
    parser.add_argument("--only", nargs="+", choices=known, default=known)
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        keep = options.keep or Path(scratch)
        sections = {
            "defects": lambda: defects(keep, options.size, options.seeds),
            "materials": lambda: materials(keep, options.size, options.seeds),
            "normals": lambda: stereo(keep, 64),
            "sphere": lambda: sphere(keep),
            "speed": speed,
        }
        lines: list[str] = []
        for name in options.only:
            found = [*sections[name](), ""]
            print("\n".join(found), flush=True)
            lines += found
    if options.out is not None:
        head = options.out.read_text(encoding="utf8").split(MARK)[0]
        options.out.write_text(head + MARK + "\n" + "\n".join(lines).rstrip() + "\n", encoding="utf8")


if __name__ == "__main__":
    main()

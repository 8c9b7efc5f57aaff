"""Put measured BRDFs on every representation, and write the table of numbers stored against what is left over.

    python benchmarks/representations.py FOLDER [--out docs/representations.md]

For every .brdf file of the folder; what the columns mean stands in the head that is written above them.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from analysis.projection.expansions import spherical_harmonics, zernike
from analysis.projection.linear_basis import mixture
from analysis.projection.residual import Projection, by_cosine, residual
from analysis.projection.separable import separable
from analysis.projection.wavelets import wavelets
from interchange.brdf import Brdf
from interchange.brdf.lambert import Lambert
from interchange.formats.images import write_png
from interchange.formats.measurements import read
from interchange.reflectance import ReflectanceSamples

PARTS = 5
Project = Callable[[ReflectanceSamples], Projection]

HEAD = """# Representations of measured BRDFs: numbers stored, and what is left over

Made by `{command}` over
{count} files of Cornell's goniometer ({samples} samples each, BSD-2-Clause, from pbrt-v2), in three
bands (600 to 700, 500 to 600, 400 to 500 nm).

Numbers: stored a channel. Residual: rms of (model less data) cos theta_i over rms of data cos theta_i, mean of the
channels; the projections weigh alike. Held out: the same over samples that the projection did not see, five parts left
out in turn, drawn at random (one seed). To {limit}°: both directions at most so far from the normal, projections and
residuals over these alone. Seconds: one projection of all three channels on one core, all angles.

- These paints are a matte floor and a highlight that at 80° reaches up to a thousand times the floor. A few samples are
  most of the energy, and "held out" over all angles is mostly whether they were among those seen.
- Expansions over both hemispheres (harmonics, Zernike) follow a highlight slowly, ring below it and are cut off at 0
  (the black fields in the picture); beyond the measured 80° their albedo may exceed 1. For matte and velvety surfaces.
- Wavelets take on any sample that they are given and guess badly between incidences: a highlight moves with the light,
  and they blend it in place. Few of them ring.
- Half vector and difference hold the highlight still: one or two products of 28 numbers each foretell unseen samples
  to 65° best. The dip in the middle of the pictured highlight is what fitting the peak at 80° costs at 40°.
- acryl_blue's highlight is narrower than its samples are apart: no representation foretells those left out.
- A mixture of the other two paints is three numbers, and over all angles best at the unseen samples of garnet_red and
  krylon_blue: the other paints have shown it what grazing peaks look like.

![garnet_red as spheres: harmonics of degree 4 and 12, Zernike of order 8 and 16; normalised decomposition, separable of
rank 2, wavelets 100 and 1000](representations.png)
"""
LIMIT = 65
PICTURED = "garnet_red"
SHOWN = (
    "spherical harmonics, degree 4",
    "spherical harmonics, degree 12",
    "Zernike, order 8",
    "Zernike, order 16",
    "normalised decomposition",
    "separable SVD, rank 2",
    "spherical wavelets, 100 kept",
    "spherical wavelets, 1000 kept",
)


def representations(others: list[Brdf]) -> dict[str, Project]:
    """By a name for the table."""
    found: dict[str, Project] = {"Lambert": lambda s: mixture(s, (Lambert(0.5),))}
    for degree in (2, 4, 8, 12):
        found[f"spherical harmonics, degree {degree}"] = lambda s, d=degree: spherical_harmonics(s, d)
    for order in (2, 4, 8, 12, 16):
        found[f"Zernike, order {order}"] = lambda s, n=order: zernike(s, n)
    found["normalised decomposition"] = lambda s: separable(s, 1, normalised=True)
    for rank in (1, 2, 3, 5):
        found[f"separable SVD, rank {rank}"] = lambda s, k=rank: separable(s, k)
    for keep in (50, 100, 300, 1000):
        found[f"spherical wavelets, {keep} kept"] = lambda s, k=keep: wavelets(s, k)
    found["mixture of the other materials (SVD, rank 5)"] = lambda s: mixture(s, (Lambert(0.5), *others))
    return found


def held_out(project: Project, samples: ReflectanceSamples) -> float:
    part = np.random.default_rng(0).integers(0, PARTS, len(samples))
    guess = np.zeros_like(samples.f)
    for k in range(PARTS):
        model = project(samples.take(part != k)).brdf
        away = part == k
        guess[away] = model.evaluate(samples.wi[away], samples.wo[away])
    cos = samples.wi[:, 2:]
    return float(np.mean(rms(cos * (guess - samples.f)) / rms(cos * samples.f)))


def rms(x: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(x**2, axis=0))


def balls(models: list[Brdf], size: int = 128) -> np.ndarray:
    """(size, size len(models), 3) uint8: spheres under one distant lamp 40° off the view, sRGB-like."""
    y, x = np.mgrid[1 : -1 : size * 1j, -1 : 1 : size * 1j]
    inside = x * x + y * y < 0.98
    n = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0.02))], axis=-1)
    t = np.cross([0.0, 1.0, 0.0], n)
    t /= np.linalg.norm(t, axis=-1, keepdims=True)
    frame = np.stack([t, np.cross(n, t), n], axis=-2)
    wi, wo = (frame @ np.array(w) for w in ((-0.455, 0.455, 0.766), (0.0, 0.0, 1.0)))
    light = np.where(inside[..., None], np.maximum(wi[..., 2:], 0), 0)
    shown = np.concatenate([m.evaluate(wi, wo) * light for m in models], axis=1)
    return np.round(255 * np.clip(shown / 0.15, 0, 1) ** (1 / 2.2)).astype(np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", default="assets/measurements")
    parser.add_argument("--out", type=Path, help="the table; spheres of garnet_red beside it, as .png")
    asked = parser.parse_args()
    files = sorted(Path(asked.folder).glob("*.brdf"))
    data = {f.stem: by_cosine(ReflectanceSamples.from_measurement(read(f)).bands()) for f in files}
    tables = {name: separable(samples, 5).brdf for name, samples in data.items()}
    command = "python benchmarks/representations.py FOLDER --out docs/representations.md"
    count = sorted({len(s) for s in data.values()})
    head = HEAD.format(command=command, count=len(data), samples=", ".join(map(str, count)), limit=LIMIT)
    lines, picture = [head], np.zeros((1, 1, 3), np.uint8)
    for name, samples in data.items():
        others = [table for other, table in tables.items() if other != name]
        theta_i, theta_o = samples.theta
        near = samples.take(np.maximum(theta_i, theta_o) < np.radians(LIMIT + 0.5))
        lines += [
            f"## {name}",
            "",
            f"| representation | numbers | residual | held out | residual to {LIMIT}° | held out to {LIMIT}° | s |",
            "|---|---|---|---|---|---|---|",
        ]
        shown: list[Brdf] = []
        for title, project in representations(others).items():
            start = time.perf_counter()
            found = project(samples)
            seconds = time.perf_counter() - start
            cells = [
                residual(found.brdf, samples, cosine=True).mean(),
                held_out(project, samples),
                residual(project(near).brdf, near, cosine=True).mean(),
                held_out(project, near),
            ]
            if title in SHOWN:
                shown.append(found.brdf)
            text = " | ".join(f"{c:.3f}" for c in cells)
            lines.append(f"| {title} | {found.numbers} | {text} | {seconds:.2f} |")
            print(lines[-1], flush=True)
        picture = np.concatenate([balls(shown[:4]), balls(shown[4:])]) if name == PICTURED else picture
        lines.append("")
    if asked.out:
        asked.out.write_text("\n".join(lines))
        write_png(asked.out.with_suffix(".png"), picture)


if __name__ == "__main__":
    main()

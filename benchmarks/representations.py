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
from interchange.formats.measurements import read
from interchange.reflectance import ReflectanceSamples

PARTS = 5
Project = Callable[[ReflectanceSamples], Projection]

HEAD = """# Representations of measured BRDFs: numbers stored, and what is left over

Made by `{command}` over {count} files of Cornell's goniometer ({samples} samples each, BSD-2-Clause, pbrt-v2), in three
bands (600 to 700, 500 to 600, 400 to 500 nm).

Numbers: stored a channel. Residual: rms of (model less data) cos theta_i over rms of data cos theta_i, mean of the
channels; the projections weigh alike. Held out: the same over samples that the projection did not see, five parts left
out in turn, drawn at random (one seed). To {limit}°: both directions at most so far from the normal, projections and
residuals over these alone. Seconds: one projection of all three channels on one core, all angles.

"""
LIMIT = 65


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


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", default="assets/measurements")
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    files = sorted(Path(asked.folder).glob("*.brdf"))
    data = {f.stem: by_cosine(ReflectanceSamples.from_measurement(read(f)).bands()) for f in files}
    tables = {name: separable(samples, 5).brdf for name, samples in data.items()}
    command = "python benchmarks/representations.py FOLDER --out docs/representations.md"
    count = sorted({len(s) for s in data.values()})
    head = HEAD.format(command=command, count=len(data), samples=", ".join(map(str, count)), limit=LIMIT)
    lines = [head]
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
            text = " | ".join(f"{c:.3f}" for c in cells)
            lines.append(f"| {title} | {found.numbers} | {text} | {seconds:.2f} |")
            print(lines[-1], flush=True)
        lines.append("")
    if asked.out:
        asked.out.write_text("\n".join(lines))


if __name__ == "__main__":
    main()

"""How much of a null's gap is the other engine's own noise: captures of the bench sample against two simulations, this
program's and the radiance that the captures were made from.

    python benchmarks/reference_noise.py DIR [--cache DIR]        DIR: bench_sample, with null/ and truth/

Of each image of ``truth/``, over the pixels away from edges: mean χ² of the capture under either simulation (a gain and
an offset fitted, nothing else), and of the difference of both what neighbouring pixels have in common, and what two
channels have: a path tracer's noise is white over pixels and alike in all channels, an error of light is neither.
"""

import argparse
import os
import tempfile
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENCV_IO_ENABLE_OPENEXR", "1")

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition, conditions
from analysis.gap.light.radiance import render_all
from analysis.gap.noise.codes import with_steps
from analysis.gap.processed.overlap import with_files_bits
from analysis.gap.renderers import renderer
from interchange.formats import captures
from interchange.formats.document import open_scene

STEEP = 0.1  # of the mean signal, DN/px: an edge, and what is beside one


def rendered(sample: Path, cache: Path) -> list[Condition]:
    given = captures.read(sample / "null/captures.json")
    with renderer("offline") as (render, settings):
        found = with_steps(with_files_bits(conditions(given, open_scene(given.scene))))
        shown = render_all([(c.scene, c.camera) for c in found], render, settings, cache)
    return [replace(c, rendered=r) for c, r in zip(found, shown, strict=True)]


def chi2(mean: np.ndarray, dn: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(H, W, 3): (capture - a simulation - b)² / σ², a and b by least squares."""
    X = np.stack([dn.ravel(), np.ones(dn.size)])
    a, b = np.linalg.solve((X * weight.ravel()) @ X.T, (X * weight.ravel()) @ mean.ravel())
    return np.asarray((mean - a * dn - b) ** 2)


def compared(c: Condition, truth: np.ndarray) -> dict[str, float]:
    model = c.simulated()
    signal = model.dn - model.black
    radiance = c.shown.radiance(c.scene)
    there = truth * np.median(signal[radiance > 0] / radiance[radiance > 0]) + model.black
    variance = model.temporal / len(c.captures) + model.fixed
    dy, dx = np.gradient(model.dn, axis=(0, 1))
    steep = np.hypot(dx, dy).max(axis=2) > STEEP * signal.mean()
    edge = cv2.dilate(steep.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    ok = (c.usable(model) & ~edge)[..., None] & np.ones(3, bool)
    weight = np.where(ok, 1 / variance, 0.0)
    d = np.where(ok, (there - model.dn) / np.sqrt(variance), 0.0)
    n = float(ok.sum())
    beside = (d[:, 1:] * d[:, :-1]).sum() / (ok[:, 1:] & ok[:, :-1]).sum()
    return {
        "ours": float((chi2(c.mean, model.dn, weight) * weight).sum() / n),
        "theirs": float((chi2(c.mean, there, weight) * weight).sum() / n),
        "between": float((d**2).sum() / n),
        "neighbours": float(beside),
        "channels": float((d[..., 0] * d[..., 1]).sum() / ok[..., 0].sum()),
    }


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("sample", type=Path)
    p.add_argument("--cache", type=Path, help="where renderings are kept (default: made for this run)")
    args = p.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        by_name = {Path(c.name).stem: c for c in rendered(args.sample, args.cache or Path(folder))}
    print(
        "| image | χ², this program's simulation | χ², their radiance | between both | of it, neighbours | channels |"
    )
    print("|---|---|---|---|---|---|")
    for name, stem in (
        ("camera0_led0", "000"),
        ("camera0_led4", "004"),
        ("camera0_led5", "005"),
        ("camera1_led0", "015"),
    ):
        truth = cv2.imread(str(args.sample / "truth" / f"{name}.exr"), cv2.IMREAD_UNCHANGED)[..., ::-1]
        x = compared(by_name[stem], truth.astype(np.float64))
        print(
            f"| {name} | "
            + " | ".join(f"{x[k]:.3f}" for k in ("ours", "theirs", "between", "neighbours", "channels"))
            + " |"
        )


if __name__ == "__main__":
    main()

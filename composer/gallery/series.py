"""Figures 8 to 11 of Gruna, Irgenfried: Reflectance modeling in machine vision. 2012, from renders of our own
specimens; and normals and a fused image of the coin.

    python -m composer.gallery.series [--out docs/series] [--size 128] [--keep FOLDER]
"""

import argparse
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analysis.series.anomalies import find_anomalies
from analysis.series.capture import capture
from analysis.series.clusters import adjusted_rand, k_means
from analysis.series.fusion import fuse
from analysis.series.integration import heights
from analysis.series.lafortune_features import lafortune_features
from analysis.series.lightings import reflector
from analysis.series.photometric_stereo import Method, angular_error, photometric_stereo
from analysis.series.reflectance_functions import on_grid, reflectance_function
from analysis.series.specimens import Specimen, circuit_board, coin, textured_plastic
from composer.series_files import COLORS
from interchange.formats.atomic import written_beside
from interchange.formats.images import encode_srgb
from interchange.lamps.reflector import ReflectorDevice
from interchange.series import Series
from realtime.renderers.rasterizer import Rasterizer

DPI = 80


@dataclass(frozen=True, eq=False)
class Shown:
    specimen: Specimen
    series: Series


def captured(
    specimen: Specimen,
    folder: Path,
    renderer: Rasterizer,
    azimuths: int = 24,
    polar: int = 6,
    samples: int = 4,
) -> Shown:
    """Images of the reflector device in DN, with noise."""
    series = capture(
        specimen.scene,
        specimen.camera,
        reflector(ReflectorDevice(), azimuths, polar),
        folder,
        lambda scene, camera: renderer.render(scene, camera, samples=samples),
        {"renderer": "rasterizer", "samples": samples},
        digital=True,
    )
    return Shown(specimen, series)


def diffuse_light(series: Series) -> np.ndarray:
    """(H, W) for the screen: what light from all lamps' directions alike would show; every lamp stands for its share
    of the hemisphere."""
    theta = np.arccos(np.clip(series.directions[:, 2], -1, 1))
    image = np.tensordot(np.sin(theta), series.per_irradiance, axes=1)
    return tone(image)


def tone(image: np.ndarray) -> np.ndarray:
    """(H, W) in [0, 1]: sRGB-encoded, 99.5 % is white."""
    return np.asarray(encode_srgb(np.clip(image / np.percentile(image, 99.5), 0, 1)))


def figure_8(shown: Shown, path: Path) -> None:
    """(a) the coin under some lamps, (b) reflectance functions of four of its pixels, φ around, θ outwards."""
    series = shown.series
    theta, phi, lamps = on_grid(series)
    size = series.shape[0]
    places = {
        "A, field": (0.5, 0.73),
        "B, field": (0.76, 0.5),
        "C, edge of the rim": (0.5, 0.1),
        "D, beside the star": (0.335, 0.6),
    }
    figure = Figure(figsize=(11, 5.2), dpi=DPI, layout="constrained")
    halves: Any = figure.subfigures(1, 2, width_ratios=[1.15, 1])
    left, right = halves
    rows, columns = min(3, len(theta)), min(4, len(phi))
    axes = left.subplots(rows, columns, squeeze=False)
    top = np.percentile(series.per_irradiance, 99.5)
    for i, r in enumerate(np.linspace(0, len(theta) - 1, rows).round().astype(int)):
        for j, c in enumerate(np.linspace(0, len(phi), columns, endpoint=False).round().astype(int)):
            image = np.clip(series.per_irradiance[lamps[r, c]] / top, 0, 1)
            axes[i, j].imshow(encode_srgb(image), cmap="gray", vmin=0, vmax=1)
            axes[i, j].set_title(f"φ {np.degrees(phi[c]):.0f}°, θ {np.degrees(theta[r]):.0f}°", fontsize=8)
            _bare(axes[i, j])
    for (name, (u, v)), axis in zip(
        places.items(), right.subplots(2, 2, subplot_kw={"projection": "polar"}).flat, strict=True
    ):
        row, column = round(v * (size - 1)), round(u * (size - 1))
        values = reflectance_function(series, row, column).values[lamps]
        ring = np.concatenate([values, values[:, :1]], axis=1)
        around = np.append(phi, phi[0] + 2 * np.pi)
        mesh = axis.pcolormesh(around, np.degrees(theta), ring, cmap="inferno", shading="gouraud", vmin=0)
        axis.set_title(f"{name} ({column}, {row})", fontsize=9)
        axis.tick_params(labelsize=6)
        right.colorbar(mesh, ax=axis, shrink=0.7).ax.tick_params(labelsize=6)
        for spot in axes[:1, :1].flat:
            spot.plot(column, row, "+", color="red", markersize=5)
            spot.annotate(name[0], (column, row), color="red", fontsize=7)
    left.suptitle("(a) illumination series of a coin", fontsize=10)
    right.suptitle("(b) reflectance functions r(φ, θ), θ outwards in degrees", fontsize=10)
    save(figure, path)


def figure_9(shown: Shown, path: Path) -> None:
    """(a) plastic under diffuse light with its defects outlined, (b) RX at γ = 0.95."""
    found = find_anomalies(shown.series, 0.95)
    truth = shown.specimen.truth
    figure = Figure(figsize=(11, 4.2), dpi=DPI, layout="constrained")
    axes = figure.subplots(1, 3)
    axes[0].imshow(diffuse_light(shown.series), cmap="gray", vmin=0, vmax=1)
    colors = ("#e0403a", "#3d6fe0", "#35a853", "#f0a020")
    for k, (name, color) in enumerate(zip(shown.specimen.classes[1:], colors, strict=True), 1):
        axes[0].contour(truth == k, [0.5], colors=[color], linewidths=1)
        rows, columns = np.nonzero(truth == k)
        axes[0].annotate(f"({k}) {name}", (columns.min(), rows.min() - 2), color=color, fontsize=9)
    axes[0].set_title("(a) diffuse light, true defects", fontsize=10)
    axes[1].imshow(np.log10(found.delta), cmap="gray")
    axes[1].set_title("δ, log scale", fontsize=10)
    axes[2].imshow(found.mask, cmap="gray")
    axes[2].set_title("(b) RX, γ = 0.95", fontsize=10)
    for axis in axes:
        _bare(axis)
    save(figure, path)


def figures_10_and_11(shown: Shown, path: Path, scatter: Path) -> tuple[float, float]:
    """Materials of a circuit board by k-means, and the space of their Lafortune features. Returns the adjusted Rand
    indices of the 144 values and of the three features."""
    truth, classes = shown.specimen.truth, shown.specimen.classes
    raw = np.moveaxis(shown.series.grey, 0, -1)
    lobes = lafortune_features(shown.series)
    by_values = k_means(raw, 4, standardise=False).labels
    by_lobes = k_means(lobes.additive, 4).labels
    scores = adjusted_rand(by_values, truth), adjusted_rand(by_lobes, truth)
    figure = Figure(figsize=(11, 4.2), dpi=DPI, layout="constrained")
    axes = figure.subplots(1, 3)
    axes[0].imshow(diffuse_light(shown.series), cmap="gray", vmin=0, vmax=1)
    samples = sample_boxes(truth, max(3, truth.shape[0] // 24))
    for k, (row, column, side) in samples.items():
        box = np.array([[0, 0], [0, side], [side, side], [side, 0], [0, 0]]) - 0.5 + [column, row]
        axes[0].plot(*box.T, color=COLORS[k] / 255, linewidth=2, label=classes[k])
    axes[0].legend(fontsize=7, loc="lower right")
    axes[0].set_title("(a) diffuse light, samples", fontsize=10)
    for axis, labels, name, score in (
        (axes[1], by_values, f"(b) k-means of {raw.shape[2]} values", scores[0]),
        (axes[2], by_lobes, "(c) k-means of 3 features", scores[1]),
    ):
        axis.imshow(COLORS[matched(labels, truth)] / 255)
        axis.set_title(f"{name}: ARI {score:.3f}", fontsize=10)
    for axis in axes:
        _bare(axis)
    save(figure, path)
    _scatter(lobes.features, by_lobes, samples, classes, scatter)
    return scores


def _scatter(
    features: np.ndarray,
    labels: np.ndarray,
    samples: dict[int, tuple[int, int, int]],
    classes: Sequence[str],
    path: Path,
) -> None:
    names = ("$C_z$", "$k_d$", "n")
    figure = Figure(figsize=(11, 3.6), dpi=DPI, layout="constrained")
    axes = figure.subplots(1, 3)
    flat = features.reshape(-1, 3)
    centers = np.array([np.median(features[labels == k], axis=0) for k in range(labels.max() + 1)])
    for axis, (i, j) in zip(axes, ((0, 1), (0, 2), (1, 2)), strict=True):
        axis.scatter(flat[:, i], flat[:, j], s=1, color="#bbbbbb", rasterized=True)
        for k, (row, column, side) in samples.items():
            own = features[row : row + side, column : column + side].reshape(-1, 3)
            axis.scatter(own[:, i], own[:, j], s=5, color=COLORS[k] / 255, label=classes[k])
        axis.plot(centers[:, i], centers[:, j], "x", color="black", markersize=9, markeredgewidth=2)
        axis.set_xlabel(names[i])
        axis.set_ylabel(names[j])
        axis.set_xlim(*limits(flat[:, i], i))
        axis.set_ylim(*limits(flat[:, j], j))
        if j == 2:
            axis.set_yscale("log")
        axis.tick_params(labelsize=7)
    axes[0].legend(fontsize=7)
    figure.suptitle(
        "Fig. 11: Lafortune features; colours: samples of Fig. 10 (a); crosses: clusters' medians",
        fontsize=10,
    )
    save(figure, path)


def limits(values: np.ndarray, feature: int) -> tuple[float, float]:
    """An axis that shows nearly all: of C_z and k_d from 0, of n over the exponents that lobes have."""
    return (0.5, 200.0) if feature == 2 else (0.0, 1.15 * float(np.nanpercentile(values, 99)))


def sample_boxes(truth: np.ndarray, side: int) -> dict[int, tuple[int, int, int]]:
    """Of each class the first square of ``side`` px within it: row, column, side; smaller where none is as large."""
    found = {}
    for k in range(int(truth.max()) + 1):
        for s in range(side, 0, -1):
            views = np.lib.stride_tricks.sliding_window_view(truth == k, (s, s)).all(axis=(2, 3))
            if views.any():
                row, column = np.argwhere(views)[len(np.argwhere(views)) // 2]
                found[k] = (int(row), int(column), s)
                break
    return found


def matched(labels: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Cluster numbers as the class that they overlap most with, each class once."""
    from scipy.optimize import linear_sum_assignment

    count = max(int(labels.max()), int(truth.max())) + 1
    overlap = np.zeros((count, count))
    np.add.at(overlap, (labels.ravel(), truth.ravel()), 1)
    rows, columns = linear_sum_assignment(-overlap)
    table = np.zeros(count, np.int64)
    table[rows] = columns
    return table[labels]


def normals_and_fusion(shown: Shown, path: Path) -> float:
    """Normals, their error, heights, and the fused image of the coin. Returns the median error, degrees."""
    series = shown.series
    found = photometric_stereo(series, Method.RANKS)
    error = np.degrees(angular_error(found.n, shown.specimen.normals))
    z = heights(found.n, shown.specimen.camera.sensor.pixel_pitch[0]) * 1e3
    fused = fuse(series, 0.3)
    figure = Figure(figsize=(11, 3.4), dpi=DPI, layout="constrained")
    axes = figure.subplots(1, 5)
    axes[0].imshow(0.5 + 0.5 * found.n)
    axes[0].set_title("normals (ranks)", fontsize=9)
    median = float(np.nanmedian(error))
    picture = axes[1].imshow(error, vmin=0, vmax=15, cmap="magma")
    axes[1].set_title(f"error, °; median {median:.1f}", fontsize=9)
    figure.colorbar(picture, ax=axes[1], shrink=0.6).ax.tick_params(labelsize=6)
    picture = axes[2].imshow(z, cmap="viridis")
    axes[2].set_title("heights, mm", fontsize=9)
    figure.colorbar(picture, ax=axes[2], shrink=0.6).ax.tick_params(labelsize=6)
    axes[3].imshow(tone(series.per_irradiance[fused.best_single]), cmap="gray")
    axes[3].set_title("best single image", fontsize=9)
    axes[4].imshow(tone(fused.image), cmap="gray")
    axes[4].set_title("fused", fontsize=9)
    for axis in axes:
        _bare(axis)
    save(figure, path)
    return median


def make(
    out: Path, keep: Path, size: int = 128, azimuths: int = 24, polar: int = 6, samples: int = 4
) -> dict[str, float]:
    """All figures into ``out``; ``keep``: where captures lie. Returns numbers that stand in them."""
    out.mkdir(parents=True, exist_ok=True)
    with Rasterizer() as renderer:
        kept = {
            name: captured(make(size), keep / f"{name}{size}", renderer, azimuths, polar, samples)
            for name, make in (("coin", coin), ("plastic", textured_plastic), ("board", circuit_board))
        }
    figure_8(kept["coin"], out / "figure8.png")
    figure_9(kept["plastic"], out / "figure9.png")
    values, features = figures_10_and_11(kept["board"], out / "figure10.png", out / "figure11.png")
    error = normals_and_fusion(kept["coin"], out / "normals.png")
    return {"ari_values": values, "ari_features": features, "normals_deg": error}


def _bare(axis: Any) -> None:
    axis.set_xticks([])
    axis.set_yticks([])


def save(figure: Figure, path: Path) -> None:
    beside = written_beside(path)
    figure.savefig(beside)
    os.replace(beside, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/series"))
    parser.add_argument("--size", type=int, default=128, help="px of a specimen's side")
    parser.add_argument("--keep", type=Path, help="where captures stay")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        print(make(options.out, options.keep or Path(scratch), options.size))


if __name__ == "__main__":
    main()

"""The calibration on one page: a self-contained HTML file that a vision engineer reads in a minute."""

import base64
import html
import io
import os
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analysis.calibration.calibration import Calibration
from analysis.calibration.cross_validation import CrossValidation
from analysis.calibration.uncertainty import Field, projection_uncertainty

INK, GOOD, BAD = "#23303b", "#2f7d4f", "#b5382a"
ARROWS = 0.06  # of the image's width: length of the longest residual drawn


def write_report(path: Path, calibration: Calibration, validations: dict[str, CrossValidation]) -> None:
    """Write the page beside its place, and rename it there."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_text(page(calibration, validations), encoding="utf-8")
    os.replace(beside, path)


def page(calibration: Calibration, validations: dict[str, CrossValidation]) -> str:
    o = calibration.observations
    template = Template((Path(__file__).parent / "report.html").read_text(encoding="utf-8"))
    parts = []
    for c, name in enumerate(o.cameras):
        field = projection_uncertainty(calibration, c)
        title = f"<h2>{html.escape(name)}</h2>" if len(o.cameras) > 1 else ""
        parts.append(
            title
            + _parameters(calibration, c)
            + _picture(_maps(calibration, c, field, validations.get(name)))
        )
    return template.substitute(
        summary=_summary(calibration, validations),
        cameras="\n".join(parts),
        images=_picture(_bars(calibration)),
        outliers=_outliers(calibration),
    )


def summary_lines(
    calibration: Calibration, validations: dict[str, CrossValidation]
) -> list[tuple[str, bool]]:
    """What counts, in sentences; and whether each is good news."""
    o = calibration.observations
    lines = [
        (
            f"Reprojection rms {calibration.rms:.3f} px over {calibration.used_points} points in {len(o.views)} "
            f"images; noise of a coordinate σ = {calibration.sigma:.3f} px.",
            True,
        )
    ]
    for c, name in enumerate(o.cameras):
        field = projection_uncertainty(calibration, c)
        lines.append(
            (
                f"{name}: a point {1e3 * calibration.distance:.0f} mm away is projected to σ = "
                f"{np.nanmedian(field.sigma):.3f} px (median of the field), {np.nanmax(field.sigma):.3f} px at worst.",
                True,
            )
        )
        if name in validations:
            v = validations[name]
            verdict = (
                f"{name}: two halves of the images differ by {v.rms:.3f} px rms, {v.ratio:.1f} times what their "
                f"uncertainty predicts (p = {v.probability:.2g})"
            )
            tail = (
                ": they agree."
                if v.agrees
                else ": they disagree. The σ below are too small: try another lens model, a flatter board, sharper or "
                "more images."
            )
            lines.append((verdict + tail, v.agrees))
    if calibration.undetermined:
        lines.append(
            (
                f"The images do not fix {', '.join(calibration.undetermined)}; take a smaller lens model.",
                False,
            )
        )
    if o.missed:
        lines.append((f"The board was not found in {len(o.missed)} images: {_names(o.missed)}.", False))
    count = len(calibration.outliers)
    lines.append((f"{count} outliers left out." if count else "No outliers.", count == 0))
    return lines


def _names(files: tuple[str, ...]) -> str:
    return ", ".join(Path(f).name for f in files[:10]) + (" ..." if len(files) > 10 else "")


def _summary(calibration: Calibration, validations: dict[str, CrossValidation]) -> str:
    return "".join(
        f'<li class="{"good" if good else "bad"}">{html.escape(text)}</li>'
        for text, good in summary_lines(calibration, validations)
    )


def _parameters(calibration: Calibration, c: int) -> str:
    units = {"fx": "px", "fy": "px", "cx": "px", "cy": "px"}
    rows = []
    for name, value, sigma in calibration.parameters(c):
        unit = units.get(
            name, "rad" if name.startswith(("tau", "r_")) else "m" if name.startswith("t_") else ""
        )
        digits = int(np.clip(np.ceil(-np.log10(sigma)) + 1, 0, 9)) if 0 < sigma < np.inf else 3
        told = f"± {sigma:.{digits}f}" if np.isfinite(sigma) else "not determined"
        rows.append(f"<tr><td>{name}</td><td>{value:.{digits}f}</td><td>{told}</td><td>{unit}</td></tr>")
    half = -(-len(rows) // 2)
    tables = "".join(f"<table>{''.join(part)}</table>" for part in (rows[:half], rows[half:]) if part)
    return f'<div class="tables">{tables}</div>'


def _outliers(calibration: Calibration) -> str:
    found = calibration.outliers
    if not found:
        return "<p>None.</p>"
    rows = "".join(
        f"<tr><td>{html.escape(Path(x.image).name)}</td><td>{x.point}</td><td>({x.pixel[0]:.1f}, {x.pixel[1]:.1f})</td>"
        f"<td>{x.residual:.2f} px</td></tr>"
        for x in found[:40]
    )
    more = f"<p>... and {len(found) - 40} more.</p>" if len(found) > 40 else ""
    return f"<table><tr><th>image</th><th>point</th><th>at</th><th>off by</th></tr>{rows}</table>{more}"


def _maps(calibration: Calibration, c: int, field: Field, validation: CrossValidation | None) -> Figure:
    width, height = calibration.observations.resolutions[c]
    figure = Figure(figsize=(13, 0.8 + 2 * 5.4 * height / width), layout="constrained")
    axes = figure.subplots(2, 2)
    _residuals(axes[0, 0], calibration, c)
    _coverage(axes[0, 1], calibration, c)
    where = f"at {1e3 * field.distance:.0f} mm"
    _heat(
        figure,
        axes[1, 0],
        field.pixels,
        field.sigma,
        f"uncertainty of projection {where}, σ px",
        calibration,
        c,
    )
    if validation is None:
        axes[1, 1].axis("off")
        axes[1, 1].text(0.5, 0.5, "too few images for two halves", ha="center")
    else:
        length = np.linalg.norm(validation.difference, axis=-1)
        title = f"half of the images against the other {where}, px"
        _heat(figure, axes[1, 1], validation.pixels, length, title, calibration, c)
        step = 3
        p, d = validation.pixels[::step, ::step], validation.difference[::step, ::step]
        inside = validation.covered[::step, ::step]
        axes[1, 1].quiver(
            p[inside][:, 0], p[inside][:, 1], d[inside][:, 0], -d[inside][:, 1], color="white", width=0.002
        )
    for axis in axes.ravel():
        axis.set_xlim(-0.5, width - 0.5)
        axis.set_ylim(height - 0.5, -0.5)
        axis.set_aspect("equal")
    return figure


def _of_camera(calibration: Calibration, c: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    pairs = [
        (v, r)
        for v, r in zip(calibration.observations.views, calibration.residuals, strict=True)
        if v.camera == c
    ]
    return (
        np.concatenate([v.pixels for v, _ in pairs]),
        np.concatenate([r for _, r in pairs]),
        np.concatenate([v.used for v, _ in pairs]),
    )


def _residuals(axis: Any, calibration: Calibration, c: int) -> None:
    pixels, residual, used = _of_camera(calibration, c)
    largest = np.quantile(np.linalg.norm(residual[used], axis=-1), 0.99)
    scale = largest / (ARROWS * calibration.observations.resolutions[c][0])
    axis.quiver(
        pixels[:, 0], pixels[:, 1], residual[:, 0], residual[:, 1], np.where(used, 0.0, 1.0), cmap="coolwarm",
        angles="xy", scale_units="xy", scale=scale, width=0.0018,
    )  # fmt: skip
    axis.set_title(f"residuals, {1 / scale:.0f} times enlarged; red are outliers", fontsize=10)


def _coverage(axis: Any, calibration: Calibration, c: int) -> None:
    for view in calibration.observations.views:
        if view.camera == c:
            axis.plot(*view.pixels[view.used].T, ".", markersize=3)
    axis.set_title("where boards were seen, one colour an image", fontsize=10)


def _heat(
    figure: Figure,
    axis: Any,
    pixels: np.ndarray,
    values: np.ndarray,
    title: str,
    calibration: Calibration,
    c: int,
) -> None:
    """Colours on a logarithmic scale that is the same for all maps of a calibration."""
    low, high = 0.05 * calibration.sigma, 20 * calibration.sigma
    levels = np.geomspace(low, high, 25)
    shown = axis.contourf(pixels[..., 0], pixels[..., 1], np.clip(values, low, high), levels=levels, norm="log",
                          cmap="viridis")  # fmt: skip
    seen, _, used = _of_camera(calibration, c)
    axis.plot(*seen[used].T, ",", color="white", alpha=0.5)
    ticks = [
        t for t in (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10) if low <= t <= high
    ]
    bar = figure.colorbar(shown, ax=axis, ticks=ticks, shrink=0.9)
    bar.ax.set_yticklabels([f"{t:g}" for t in ticks])
    axis.set_title(title, fontsize=10)


def _bars(calibration: Calibration) -> Figure:
    views = calibration.observations.views
    figure = Figure(figsize=(13, 2.6), layout="constrained")
    axis = figure.subplots()
    rms = [
        float(np.sqrt((r[v.used] ** 2).sum(-1).mean())) if v.used.any() else 0.0
        for v, r in zip(views, calibration.residuals, strict=True)
    ]
    colours = [f"C{v.camera}" for v in views]
    axis.bar(range(len(views)), rms, color=colours)
    axis.axhline(calibration.rms, color=INK, linewidth=0.8)
    names = [Path(v.image).stem for v in views]
    every = max(1, len(names) // 40)
    axis.set_xticks(range(0, len(names), every), names[::every], rotation=90, fontsize=7)
    axis.set_ylabel("rms, px")
    axis.set_xlim(-0.6, len(views) - 0.4)
    return figure


def _picture(figure: Figure) -> str:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return f'<img src="data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}" alt="">'

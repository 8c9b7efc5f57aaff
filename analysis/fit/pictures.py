"""Plots of a fit as inline SVG and PNG, for the report: what was measured, what is fitted, where they part."""

import base64
import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from analysis.fit.fit import Fit, three
from analysis.fit.rank import Ranked
from analysis.fit.weighting import smallest
from interchange.formats import png
from interchange.formats.images import to_display

INK = {"R": "#c0392b", "G": "#2e8b57", "B": "#2c6fbb", "": "#333333"}
PLANE = np.radians(6)  # azimuth from the plane of incidence that still counts as in it


def incidence_groups(fit: Fit, most: int = 9) -> list[tuple[str, np.ndarray]]:
    """(label, rows) of at most ``most`` incidence angles, evenly out of all."""
    degrees = np.round(np.degrees(fit.samples.theta[0]))
    angles = np.unique(degrees)
    if len(angles) > most:
        edges = np.quantile(degrees, np.linspace(0, 1, most + 1))
        bins = np.clip(np.searchsorted(edges, degrees, side="right") - 1, 0, most - 1)
        return [(f"{degrees[bins == k].mean():.0f}°", np.flatnonzero(bins == k)) for k in np.unique(bins)]
    return [(f"{a:.0f}°", np.flatnonzero(degrees == a)) for a in angles]


def relative_azimuth(fit: Fit) -> np.ndarray:
    """Azimuth of the camera from the lamp's, rad in (-π, π]."""
    i, o = (np.arctan2(w[:, 1], w[:, 0]) for w in (fit.samples.wi, fit.samples.wo))
    return np.angle(np.exp(1j * (o - i)))


def in_plane(fit: Fit) -> str:
    """Measured dots and fitted lines in the plane of incidence, a panel for each incidence angle; SVG."""
    turn, theta_o = relative_azimuth(fit), fit.samples.theta[1]
    here = (np.abs(turn) < PLANE) | (np.abs(turn) > np.pi - PLANE) | (theta_o < PLANE)
    groups = [(label, rows[here[rows]]) for label, rows in incidence_groups(fit)]
    groups = [(label, rows) for label, rows in groups if len(rows) > 2]
    if not groups:
        return "<p>No incidence angle was measured in the plane of incidence.</p>"
    figure, axes = _grid(len(groups), 2.9, 2.3)
    f, floor = three(fit.samples.f), smallest(fit.samples)
    names = fit.samples.channels if fit.samples.f.shape[1] == 3 else ("",)
    line = np.radians(np.linspace(-88, 88, 353))
    for axis, (label, rows) in zip(axes, groups, strict=False):
        side = np.where(np.abs(turn[rows]) > np.pi / 2, 1.0, -1.0)
        lamp = float(np.mean(fit.samples.theta[0][rows]))
        wi = np.array([-np.sin(lamp), 0, np.cos(lamp)])
        fitted = fit.brdf.evaluate(wi, np.stack([np.sin(line), 0 * line, np.cos(line)], -1))
        for c, name in enumerate(names):
            ink = INK.get(name, INK[""])
            axis.plot(np.degrees(side * theta_o[rows]), f[rows, c], "o", ms=3, mfc="none", mec=ink, mew=0.8)
            axis.plot(np.degrees(line), fitted[:, c], "-", lw=1.2, color=ink)
        top = max(float(f[rows].max()), float(fitted.max()))
        axis.set_yscale("asinh", linear_width=floor)
        axis.set_ylim(min(0.0, float(f[rows].min())), 1.6 * top)
        axis.set_yticks(_decades(floor, top))
        axis.axvline(np.degrees(lamp), color="#bbb", lw=0.7, ls=":")
        axis.set_title(f"light at {label}", fontsize=8, loc="left")
    axes[0].set_ylabel("f, 1/sr", fontsize=8)
    if len(names) == 3:
        axes[0].legend([*_lines(axes[0])], names, fontsize=7, frameon=False, loc="upper left", handlelength=1)
    figure.supxlabel(
        "camera, degrees from the normal; positive: the mirror's side (dotted: mirror direction)", fontsize=8
    )
    return _svg(figure)


def _lines(axis: Any) -> list[Any]:
    return [line for line in axis.lines if line.get_linestyle() == "-"]


def _decades(floor: float, top: float) -> list[float]:
    low = int(np.floor(np.log10(max(floor, 1e-12))))
    powers = range(low, int(np.ceil(np.log10(max(top, 1e-9)))) + 1)
    return [0.0, *(10.0**p for p in powers[:: max(1, len(powers) // 5)])]


def residual_map(fit: Fit) -> str:
    """How far the fit is from each reading, over the hemisphere of exitance, a disk for each incidence angle; SVG."""
    floor, f = smallest(fit.samples), three(fit.samples.f)
    fitted = fit.brdf.evaluate(fit.samples.wi, fit.samples.wo)
    ratio = (np.arcsinh(fitted / (2 * floor)) - np.arcsinh(f / (2 * floor))).mean(axis=1)
    groups = incidence_groups(fit)
    figure, axes = _grid(len(groups), 1.9, 1.95)
    turn, theta_o = relative_azimuth(fit), np.degrees(fit.samples.theta[1])
    shown: Any = None
    for axis, (label, rows) in zip(axes, groups, strict=False):
        x, y = -theta_o[rows] * np.cos(turn[rows]), theta_o[rows] * np.sin(turn[rows])
        shown = axis.scatter(x, y, c=ratio[rows], s=9, cmap=_diverging(), vmin=-1, vmax=1, linewidths=0)
        for ring in (30, 60, 90):
            axis.add_patch(_circle(ring))
        lamp = float(np.degrees(np.mean(fit.samples.theta[0][rows])))
        axis.plot([lamp], [0], "x", color="black", ms=5, mew=0.8)
        axis.set(xlim=(-95, 95), ylim=(-95, 95), xticks=[], yticks=[], aspect="equal")
        axis.axis("off")
        axis.set_title(f"light at {label}", fontsize=8)
    bar = figure.colorbar(shown, ax=list(axes), shrink=0.7, ticks=[-1, -0.69, -0.41, 0, 0.41, 0.69, 1])
    bar.ax.set_yticklabels(["÷ 2.7", "÷ 2", "÷ 1.5", "equal", "× 1.5", "× 2", "× 2.7"], fontsize=7)
    return _svg(figure)


def ranking(ranked: Sequence[Ranked], metric: str, chosen: str) -> str:
    """Held-out and own errors of all models, the best on top; SVG."""
    done = [r for r in ranked if r.fit is not None][::-1]
    figure = Figure(figsize=(7.2, 0.45 + 0.23 * len(done)), layout="constrained")
    axis = figure.subplots()
    at = np.arange(len(done))
    held = [r.error(metric) for r in done]
    own = [r.fit.errors.rms[metric] if r.fit else 0.0 for r in done]
    axis.barh(at, held, color=["#2c6fbb" if r.model == chosen else "#b8c7d9" for r in done], height=0.7)
    axis.plot(own, at, "|", color="#222", ms=9, mew=1.4)
    names = [f"{r.model} {r.fit.lobes}" if r.fit and r.fit.lobes else r.model for r in done]
    axis.set_yticks(at, names, fontsize=8)
    if held and max(held) > 8 * min(held):
        axis.set_xscale("log")
    axis.set_xlabel(
        f"error of incidence angles that were held out ({metric}); mark: of those that were fitted",
        fontsize=8,
    )
    return _svg(figure)


def correlation(fit: Fit) -> str:
    """Correlation of the parameters; SVG."""
    names = [e.name for e in fit.estimates]
    size = min(0.22 * len(names) + 1.6, 7.0)
    figure = Figure(figsize=(size + 0.6, size), layout="constrained")
    axis = figure.subplots()
    shown = axis.imshow(fit.correlation, cmap=_diverging(), vmin=-1, vmax=1)
    axis.set_xticks(range(len(names)), names, rotation=90, fontsize=7)
    axis.set_yticks(range(len(names)), names, fontsize=7)
    axis.set_facecolor("#ddd")
    figure.colorbar(shown, ax=axis, shrink=0.7)
    return _svg(figure)


def picture(radiance: np.ndarray, exposure: float) -> str:
    """An <img> of radiance at one exposure."""
    data = base64.b64encode(png.encode(to_display(radiance, exposure))).decode()
    return f'<img width="{radiance.shape[1]}" height="{radiance.shape[0]}" alt="" src="data:image/png;base64,{data}">'


def _grid(count: int, width: float, height: float) -> tuple[Figure, list[Any]]:
    columns = min(count, 4 if width < 2.5 else 3)
    rows = -(-count // columns)
    figure = Figure(figsize=(columns * width, rows * height + 0.25), layout="constrained")
    axes = np.ravel(figure.subplots(rows, columns, squeeze=False))
    for axis in axes:
        axis.tick_params(labelsize=7)
    for axis in axes[count:]:
        axis.axis("off")
    return figure, list(axes)


def _circle(radius: float) -> Any:
    from matplotlib.patches import Circle

    return Circle((0, 0), radius, fill=False, color="#bbb", lw=0.6, zorder=0)


def _diverging() -> ListedColormap:
    """Blue where the fit is too dark, red where too bright, light grey where they agree."""
    t = np.linspace(-1, 1, 255)[:, None]
    blue, grey, red = (np.array(c) for c in ((0.13, 0.35, 0.75), (0.88, 0.88, 0.88), (0.78, 0.16, 0.12)))
    return ListedColormap(np.where(t < 0, grey + (blue - grey) * -t, grey + (red - grey) * t))


def _svg(figure: Figure) -> str:
    stream = io.StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None})
    text = stream.getvalue()
    return text[text.index("<svg") :]

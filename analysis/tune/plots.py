"""Pictures of a tuning: the search, slices, robustness, what was predicted and came, and what is found (Fig. 7)."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

from analysis.tune.algorithms.base import Algorithm
from analysis.tune.algorithms.template_match import Pattern
from analysis.tune.found import Blobs, Circle, Edges, Line
from analysis.tune.frames import Frame, pattern_of
from analysis.tune.scores import MEASURES
from analysis.tune.session import Session
from interchange.formats import images
from interchange.formats.atomic import written_beside

BLUE, RED, GREY = "#26548c", "#d73c1e", "0.6"
GREEN, ORANGE, PALE = (40, 170, 60), (235, 90, 20), (120, 135, 150)  # truth, found, found elsewhere
MOST = 6  # variations that are shown


def write_plots(folder: Path, session: Session) -> list[Path]:
    """search.png, slices.png, robustness.png, found.png and, with real images, prediction.png."""
    made: list[tuple[str, Callable[[Session], Figure]]] = [("search.png", search), ("slices.png", slices)]
    if session.dependence:
        made.append(("robustness.png", robustness))
    if session.real_frames:
        made.append(("prediction.png", prediction))
    written = []
    for name, draw in made:
        path = folder / name
        beside = written_beside(path)
        draw(session).savefig(beside)
        beside.replace(path)
        written.append(path)
    images.write_png(folder / "found.png", found_picture(session))
    return [*written, folder / "found.png"]


def search(session: Session) -> Figure:
    """The course of the search; with two objectives and more, the front of the first two."""
    t = session.tuning
    values = np.array([trial.values for trial in t.trials])
    figure = Figure(figsize=(7, 3.6), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    if len(t.objectives) == 1:
        high = MEASURES[t.objectives[0]].best == "high"
        best = np.maximum.accumulate(values[:, 0]) if high else np.minimum.accumulate(values[:, 0])
        axes.plot(values[:, 0], ".", color=GREY, ms=4, label="trial")
        axes.plot(best, color=BLUE, lw=1.2, label="best so far")
        axes.plot(0, values[0, 0], "s", color=RED, ms=5, label="declared defaults")
        axes.set_xlabel("trial", fontsize=8)
        axes.set_ylabel(_label(t.objectives[0]), fontsize=8)
    else:
        front = np.array(sorted(values[list(t.front)].tolist()))
        axes.plot(values[:, 0], values[:, 1], ".", color=GREY, ms=4, label="trial")
        line = "o-" if len(t.objectives) == 2 else "o"
        axes.plot(front[:, 0], front[:, 1], line, color=BLUE, ms=4, lw=1, label="Pareto front")
        axes.plot(values[0, 0], values[0, 1], "s", color=RED, ms=5, label="declared defaults")
        axes.plot(*values[t.chosen][:2], "*", color="k", ms=11, label="chosen")
        axes.set_xlabel(_label(t.objectives[0]), fontsize=8)
        axes.set_ylabel(_label(t.objectives[1]), fontsize=8)
    axes.set_title("search, on the frames tuned on", fontsize=10)
    _finish(axes)
    return figure


def slices(session: Session) -> Figure:
    """The first objective along every parameter through the chosen ones, the plateau shaded."""
    t = session.tuning
    count = max(1, len(session.slices))
    figure = Figure(figsize=(2.6 * min(count, 4) + 0.6, 2.6 * -(-count // 4)), dpi=110, layout="constrained")
    for k, s in enumerate(session.slices):
        axes = figure.add_subplot(-(-count // 4), min(count, 4), k + 1)
        bound = t.bounds[s.parameter]
        axes.axvspan(*s.plateau, color=BLUE, alpha=0.12, lw=0)
        axes.plot(s.values, s.scores, ".-", color=BLUE, lw=1, ms=4)
        axes.axvline(t.trials[t.chosen].parameters[s.parameter], color="k", lw=0.8)
        axes.axvline(t.trials[0].parameters[s.parameter], color=RED, lw=0.8, ls="--")
        if bound.log:
            axes.set_xscale("log")
        unit = "" if bound.unit == "1" else f", {bound.unit}"
        axes.set_xlabel(f"{s.parameter}{unit}", fontsize=8)
        if k % 4 == 0:
            axes.set_ylabel(_label(s.measure), fontsize=8)
        _finish(axes, legend=False)
    figure.suptitle("black: chosen, red: default, shaded: within 5 % of the chosen", fontsize=9)
    return figure


def robustness(session: Session) -> Figure:
    """The first objective of every frame over what was varied, with the chosen and the default parameters."""
    measure = session.tuning.objectives[0]
    names = list(session.dependence)[:MOST]
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(3.1 * columns + 0.6, 2.7 * rows), dpi=110, layout="constrained")
    held = np.zeros(len(session.frames), bool)
    held[session.held_out] = True
    for k, name in enumerate(names):
        axes = figure.add_subplot(rows, columns, k + 1)
        x = np.array([f.variation[name] for f in session.frames])
        axes.plot(x, session.default_scores[measure], "x", color=RED, ms=4, mew=0.8, label="defaults")
        axes.plot(
            x[~held], session.scores[measure][~held], "o", mfc="none", color=BLUE, ms=4, label="tuned on"
        )
        axes.plot(x[held], session.scores[measure][held], "o", color=BLUE, ms=4, label="held out")
        axes.set_xlabel(f"{name}   (rank correlation {session.dependence[name]:+.2f})", fontsize=7)
        if k % columns == 0:
            axes.set_ylabel(_label(measure), fontsize=8)
        _finish(axes, legend=k == 0)
    return figure


def prediction(session: Session) -> Figure:
    """Of every measure: held-out simulated frames, the interval that was stated, and what the real images gave."""
    count = len(session.predictions)
    figure = Figure(figsize=(1.75 * count + 0.5, 3.4), dpi=110, layout="constrained")
    rng = np.random.default_rng(0)
    for k, p in enumerate(session.predictions):
        axes = figure.add_subplot(1, count, k + 1)
        own = session.scores[p.measure][session.held_out]
        real = session.real_scores[p.measure]
        axes.plot(rng.uniform(-0.25, 0.25, len(own)), own, ".", color=GREY, ms=4)
        axes.plot([0, 0], [p.low, p.high], color=BLUE, lw=5, alpha=0.35, solid_capstyle="butt")
        axes.plot([-0.3, 0.3], [p.median, p.median], color=BLUE, lw=1.2)
        axes.plot(1 + rng.uniform(-0.2, 0.2, len(real)), real, "o", color=RED, ms=4)
        axes.set_xlim(-0.6, 1.6)
        axes.set_xticks([0, 1], ["stated", "real"], fontsize=8)
        axes.set_title(_label(p.measure), fontsize=8)
        axes.tick_params(labelsize=7)
        axes.grid(alpha=0.3, axis="y")
    share = session.predictions[0].coverage if session.predictions else 0.0
    figure.suptitle(f"grey: simulated, held out; bar: {100 * share:.0f} % of one more such image", fontsize=9)
    return figure


def found_picture(session: Session) -> np.ndarray:
    """(H, W, 3) uint8: truth (green) and what is found (orange) on a simulated, held-out frame and on a real one."""
    best = session.tuning.best
    patterns = session.frames[session.tuned_on[0]]
    roi = session.rules.roi
    panels = [drawn(best, session.frames[session.held_out[0]], patterns, roi)]
    if session.real_frames:
        panels.append(drawn(best, session.real_frames[0], patterns, roi))
    height = max(p.shape[0] for p in panels)
    whole = np.full((height, sum(p.shape[1] + 6 for p in panels) - 6, 3), 255, np.uint8)
    left = 0
    for p in panels:
        whole[: p.shape[0], left : left + p.shape[1]] = p
        left += p.shape[1] + 6
    return whole


def drawn(
    algorithm: Algorithm, frame: Frame, pattern_frame: Frame | None = None, roi: float = 8.0
) -> np.ndarray:
    """(H, W, 3) uint8: the frame, its truth, and what the algorithm finds in it; edges outside of the regions of
    interest, ``roi`` px about the true ones, are drawn pale."""
    zoom = max(1, round(640 / frame.image.shape[1]))
    top = max(float(np.percentile(frame.image, 99.5)), 1e-6)
    grey = np.clip(frame.image * (235 / top), 0, 255).astype(np.uint8)
    large = np.kron(grey, np.ones((zoom, zoom), np.uint8))
    picture = np.ascontiguousarray(np.repeat(large[..., None], 3, axis=2))

    def at(x: float, y: float) -> tuple[int, int]:
        return round(16 * (zoom * (x + 0.5) - 0.5)), round(16 * (zoom * (y + 0.5) - 0.5))

    def dots(points: np.ndarray, colour: tuple[int, int, int]) -> None:
        for x, y in points:
            cv2.circle(picture, at(x, y), 12, colour, -1, cv2.LINE_AA, 4)

    def shape(found: Any, colour: tuple[int, int, int]) -> None:
        if isinstance(found, Circle) and np.isfinite(found.radius):
            cv2.circle(picture, at(*found.middle), round(16 * zoom * found.radius), colour, 1, cv2.LINE_AA, 4)
        if isinstance(found, Line) and np.isfinite([*found.start, *found.end]).all():
            cv2.line(picture, at(*found.start), at(*found.end), colour, 1, cv2.LINE_AA, 4)

    def cross(middle: Any, colour: tuple[int, int, int]) -> None:
        if np.isfinite(middle).all():
            x, y = (v // 16 for v in at(*middle))
            cv2.drawMarker(picture, (x, y), colour, cv2.MARKER_CROSS, 12, 1, cv2.LINE_AA)

    if algorithm.finds is Edges and frame.truth.edges is not None:
        found = algorithm.run(frame.image)
        points = found.points if isinstance(found, Edges) else np.zeros((0, 2))
        of_interest = np.isfinite(frame.truth.edges.near(points, roi)[0])
        dots(points[~of_interest], PALE)
        dots(frame.truth.edges.points[::4], GREEN)
        dots(points[of_interest], ORANGE)
    elif algorithm.finds is Blobs and frame.truth.regions is not None:
        blobs = algorithm.run(frame.image)
        for labels, colour in ((frame.truth.regions, GREEN), (getattr(blobs, "labels", None), ORANGE)):
            if labels is not None:
                wide = np.kron((labels > 0).astype(np.uint8), np.ones((zoom, zoom), np.uint8))
                rims, _ = cv2.findContours(wide, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
                cv2.drawContours(picture, rims, -1, colour, 1)
    elif algorithm.finds in (Circle, Line):
        features = frame.truth.circles if algorithm.finds is Circle else frame.truth.lines
        for true in features.values():
            shape(true, GREEN)
            shape(algorithm.run(frame.image, true), ORANGE)
    elif pattern_frame is not None:
        for name, square in frame.truth.patterns.items():
            pattern, inner = pattern_of(pattern_frame, name)
            cross(square.middle, GREEN)
            near = Pattern(pattern.pixels, tuple(np.subtract(square.middle, inner)))
            place = algorithm.run(frame.image, near)
            if place is not None:
                cross(np.add(place.middle, inner), ORANGE)  # type: ignore[union-attr]
    return picture


def _label(measure: str) -> str:
    unit = MEASURES[measure].unit
    return measure.replace("_", " ") + ("" if unit == "1" else f", {unit}")


def _finish(axes: Any, legend: bool = True) -> None:
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)
    if legend:
        axes.legend(fontsize=7)

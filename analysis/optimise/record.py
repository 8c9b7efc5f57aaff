"""What a search for a set-up writes: optimise.json, trials.csv, front.png, course.png, winner.png, winner.usda."""

import csv
import io
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analysis.optimise.search import Searched, Trial
from analysis.optimise.session import Optimised
from analysis.tune.record import write_json, write_text
from interchange.camera import Camera
from interchange.formats import images
from interchange.formats.atomic import written_beside
from interchange.formats.document import Document
from interchange.image import Image
from interchange.problems import Problem
from interchange.scene import Scene

BLUE, RED, GREY = "#26548c", "#d73c1e", "0.6"
SHOWN = 480  # px: width of a picture of a set-up


def write(
    folder: Path, done: Optimised, document: Document, picture: Callable[[Scene, Camera], Image]
) -> list[Problem]:
    """Each file beside its place and renamed; returns what the scene's file could not carry."""
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "optimise.json", record(done))
    write_text(folder / "trials.csv", table(done))
    for name, draw in (("front.png", front), ("course.png", course)):
        beside = written_beside(folder / name)
        draw(done).savefig(beside)
        beside.replace(folder / name)
    images.write_png(folder / "winner.png", before_and_after(done, picture))
    return write_scene(folder / "winner.usda", done, document)


def write_scene(path: Path, done: Optimised, document: Document) -> list[Problem]:
    """The winner as a scene: the file that was read, with what the set-up changes."""
    from interchange.formats.usd_changes import Frame, author_changes
    from interchange.formats.usd_edit_values import set_camera

    stage = document.stage
    new = done.scene
    lost = author_changes(stage, [Frame(document.times[0], done.base, new)])
    for before, after in zip(done.base.cameras, new.cameras, strict=True):
        if before is not after:
            set_camera(stage, before, after, None)  # the exposure time, which a correction of a scene leaves
    document.save(path)
    if not stage.GetRootLayer().anonymous:
        stage.Reload()  # the file that was read stays what it is, in memory too
    return lost


def record(done: Optimised) -> dict[str, Any]:
    plan = done.plan
    names = list(plan.objectives)

    def told(trial: Trial | None) -> dict[str, Any] | None:
        if trial is None:
            return None
        values = dict(zip(names, trial.values, strict=True))
        return {"values": values, **({"broken": trial.broken} if trial.broken else {})}

    def search(s: Searched, volume: np.ndarray) -> dict[str, Any]:
        return {
            "method": s.method,
            "trials": len(s.trials),
            "keep_the_limits": s.feasible,
            "broken": dict(Counter(t.broken for t in s.trials if t.broken)),
            "hypervolume": float(volume[-1]),
            "front": [{"trial": i, **(told(s.trials[i]) or {})} for i in s.front],
        }

    return {
        "plan": plan.file.name,
        "objectives": {
            n: {"unit": m.unit, "best": m.best, "meaning": m.meaning} for n, m in plan.objectives.items()
        },
        "search": search(done.found, done.volumes[0]),
        "random": search(done.random, done.volumes[1]),
        "as_it_stands": told(done.as_it_stands),
        "candidates": [
            {
                "trial": c.trial,
                "parameters": c.live.parameters,
                "realtime": told(c.live),
                "path_traced": told(c.confirmed),
            }
            for c in done.candidates
        ],
        "winner": {
            "trial": done.candidates[done.winner].trial,
            "parameters": done.candidates[done.winner].live.parameters,
            "units": {a.address: plan.units[a.address] for a in plan.axes},
        },
    }


def table(done: Optimised) -> str:
    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    axes = [a.address for a in done.plan.axes]
    out.writerow(["search", "trial", *axes, *done.plan.objectives, "broken"])
    for s in (done.found, done.random):
        for i, t in enumerate(s.trials):
            out.writerow([s.method, i, *(t.parameters[a] for a in axes), *t.values, t.broken])
    return text.getvalue()


def front(done: Optimised) -> Figure:
    """The Pareto front: each pair of objectives, trials of both searches, what path tracing says of the best few."""
    names = list(done.plan.objectives)
    pairs = [(i, j) for i in range(len(names)) for j in range(i + 1, len(names))] or [(0, 0)]
    pairs = pairs[:6]
    columns = min(3, len(pairs))
    rows = -(-len(pairs) // columns)
    figure = Figure(figsize=(4.4 * columns + 0.4, 3.6 * rows), dpi=110, layout="constrained")
    for k, (i, j) in enumerate(pairs):
        axes = figure.add_subplot(rows, columns, k + 1)
        for s, colour, mark in ((done.random, RED, "x"), (done.found, BLUE, ".")):
            kept = np.array([_point(t, i, j, n) for n, t in enumerate(s.trials) if not t.broken]).reshape(
                -1, 2
            )
            axes.plot(kept[:, 0], kept[:, 1], mark, color=colour, ms=4, alpha=0.35, mew=0.8)
            own = np.array(sorted(_point(s.trials[n], i, j, n) for n in s.front)).reshape(-1, 2)
            label = "random search" if s is done.random else s.method.upper()
            line = "-" if len(names) == 2 else ""
            axes.plot(own[:, 0], own[:, 1], f"o{line}", color=colour, ms=4, lw=1, label=f"{label}: front")
        if not done.as_it_stands.broken:
            axes.plot(
                *_point(done.as_it_stands, i, j, 0), "s", color="k", mfc="none", ms=7, label="as it stands"
            )
        for c in done.candidates:
            if c.confirmed is not None and not c.confirmed.broken:
                a, b = _point(c.live, i, j, c.trial), _point(c.confirmed, i, j, c.trial)
                axes.annotate("", b, a, arrowprops={"arrowstyle": "->", "color": "0.3", "lw": 0.8})
                axes.plot(*b, "D", color="0.3", ms=4)
        own_winner = done.candidates[done.winner]
        axes.plot(*_point(own_winner.confirmed or own_winner.live, i, j, own_winner.trial), "*", color="k", ms=12,
                  label="winner" + (", path-traced" if own_winner.confirmed else ""))  # fmt: skip
        axes.set_xlabel(_label(done, i) if i != j else "trial", fontsize=8)
        axes.set_ylabel(_label(done, j), fontsize=8)
        if i != j and list(done.plan.objectives.values())[i].log:
            axes.set_xscale("log")
        if list(done.plan.objectives.values())[j].log:
            axes.set_yscale("log")
        axes.tick_params(labelsize=7, which="both")
        axes.grid(alpha=0.3, which="both")
        if k == 0:
            axes.legend(fontsize=7)
    return figure


def course(done: Optimised) -> Figure:
    """Hypervolume over trials of the search and of random search."""
    figure = Figure(figsize=(6, 3.2), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    for s, volume, colour in ((done.found, done.volumes[0], BLUE), (done.random, done.volumes[1], RED)):
        label = "random search" if s is done.random else s.method.upper()
        axes.step(np.arange(1, len(volume) + 1), volume, color=colour, where="post",
                  label=f"{label}, {s.feasible} of {len(volume)} keep the limits")  # fmt: skip
    axes.set_xlabel("trials", fontsize=8)
    axes.set_ylabel("hypervolume", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7)
    return figure


def before_and_after(done: Optimised, picture: Callable[[Scene, Camera], Image]) -> np.ndarray:
    """(h, w, 3) uint8: what the camera sees as the scene stands, and in the winner; DN, each over its full scale."""
    from interchange.exposure import expose

    panels = []
    for scene in (done.base, done.scene):
        camera = scene.camera(done.plan.camera)
        camera = camera.resized(min(SHOWN, camera.sensor.resolution[0]))
        shot = expose(picture(scene, camera), camera)
        top = 2 ** (shot.camera or camera).sensor.bits_out - 1
        grey = images.encode_srgb(np.clip(shot.pixels / top, 0, 1))
        panels.append(np.rint(255 * np.broadcast_to(grey, (*grey.shape[:2], 3))).astype(np.uint8))
        panels.append(np.full((panels[0].shape[0], 6, 3), 255, np.uint8))
    high = max(p.shape[0] for p in panels)
    return np.hstack([np.pad(p, ((0, high - p.shape[0]), (0, 0), (0, 0))) for p in panels[:3]])


def _point(trial: Trial, i: int, j: int, number: int) -> tuple[float, float]:
    return (trial.values[i] if i != j else float(number), trial.values[j])


def _label(done: Optimised, k: int) -> str:
    name, measure = list(done.plan.objectives.items())[k]
    return (
        name.replace("_", " ")
        + ("" if measure.unit == "1" else f", {measure.unit}")
        + (" (high is best)" if measure.best == "high" else " (low is best)")
    )

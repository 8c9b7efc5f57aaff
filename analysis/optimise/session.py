"""A plan carried out: searched with real-time images beside random search, the best few confirmed by path tracing."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from analysis.optimise.plan import Plan
from analysis.optimise.search import (
    Judge,
    Searched,
    Trial,
    best_of,
    hypervolumes,
    judged_once,
    loss,
    nothing_keeps,
    search,
    start,
)  # fmt: skip
from analysis.optimise.setting import scene_of
from analysis.optimise.view import Render
from analysis.tune.kept import Kept, key_of
from analysis.tune.search import nearest_ideal, pareto
from interchange.camera import Camera
from interchange.image import Image
from interchange.scene import Scene

PASSES = ("depth", "position", "normal", "object_id")


@dataclass(frozen=True, eq=False)
class Candidate:
    """A set-up of the front: which trial it was, and what path tracing says of it, None where it was not asked."""

    trial: int
    live: Trial
    confirmed: Trial | None


@dataclass(frozen=True, eq=False)
class Optimised:
    """``volumes``: hypervolume of the search and of random search after each trial; ``as_it_stands``: the set-up that
    the scene has; ``winner``: index of one of the candidates."""

    plan: Plan
    base: Scene
    found: Searched
    random: Searched
    volumes: tuple[np.ndarray, np.ndarray]
    as_it_stands: Trial
    candidates: tuple[Candidate, ...]
    winner: int

    @property
    def scene(self) -> Scene:
        """The winner's."""
        return scene_of(self.plan, self.base, self.candidates[self.winner].live.parameters)[0]


def optimise(
    plan: Plan,
    base: Scene,
    rasterizer: Any,
    cycles: Callable[[], AbstractContextManager[Any]],
    told: Callable[[str, int, int], None] = lambda what, done, total: None,
    keep: Path | None = None,
) -> Optimised:
    """``rasterizer``: open; ``cycles`` gives a path tracer for as long as it is needed. ``keep``: the folder from which
    one that was broken off goes on. Raises BrightfieldError where no set-up keeps the limits."""
    judge = Judge(plan, base, rasterizer)
    live = drawn(rasterizer, plan.samples)
    found = search(
        judge, live, plan.method, plan.seed, lambda n, m: told(plan.method, n, m), _in(keep, plan.method)
    )
    random = search(
        judge, live, "random", plan.seed + 1, lambda n, m: told("random search", n, m), _in(keep, "random")
    )
    if not found.front:
        raise nothing_keeps(plan, found)
    chosen = best_of(plan, found.trials, found.front, max(plan.confirm, 1))
    candidates = [Candidate(i, found.trials[i], None) for i in chosen]
    if plan.confirm:
        key = key_of(plan.text, base.digest, plan.width, plan.paths)
        kept = Kept(_in(keep, "path_traced"), key)
        with cycles() as tracer:
            confirmed = []
            for k, c in enumerate(candidates):
                told("path tracing", k, len(candidates))
                own, render = c.live.parameters, traced(tracer, plan.paths)
                trial = judged_once(kept, k, own, partial(judge.trial, own, render, 2))
                confirmed.append(Candidate(c.trial, c.live, trial))
            told("path tracing", len(candidates), len(candidates))
            candidates = confirmed
    volumes = hypervolumes(plan, [found, random])
    return Optimised(
        plan, base, found, random, (volumes[0], volumes[1]), judge.trial(start(plan, base), live),
        tuple(candidates), winner_of(plan, candidates),
    )  # fmt: skip


def _in(folder: Path | None, name: str) -> Path | None:
    return None if folder is None else folder / f"{name}.jsonl"


def winner_of(plan: Plan, candidates: Sequence[Candidate]) -> int:
    """By what path tracing says, where it was asked: of those that still keep the limits the nearest to the ideal; all
    that do not is told by the first."""
    measures = list(plan.objectives.values())
    judged = [c.confirmed or c.live for c in candidates]
    kept = [i for i, t in enumerate(judged) if not t.broken]
    if not kept:
        return 0
    losses = np.array([[loss(m, v) for m, v in zip(measures, judged[i].values, strict=True)] for i in kept])
    return kept[nearest_ideal(losses, pareto(losses))]


def drawn(rasterizer: Any, samples: int) -> Render:
    def render(scene: Scene, camera: Camera, seed: int) -> Image:
        return rasterizer.render(scene, camera, PASSES, samples=samples)

    return render


def traced(cycles: Any, samples: int) -> Render:
    from offline.settings import CyclesSettings

    def render(scene: Scene, camera: Camera, seed: int) -> Image:
        return cycles.render(scene, camera, CyclesSettings(samples=samples, seed=seed), PASSES)

    return render

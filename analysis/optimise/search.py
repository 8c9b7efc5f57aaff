"""The search for a set-up: Optuna over the plan's axes with real-time images, and random search with the same budget.

Set-ups that break a limit count as trials of either search; they tell the sampler what to avoid and are never chosen.
What a search has found is compared by hypervolume: the share of the box between the ideal and the nadir point of both
searches' fronts that its front dominates (Zitzler, Thiele 1999), measures that spread over magnitudes by their
logarithms.

Deb et al.: A fast and elitist multiobjective genetic algorithm, NSGA-II. IEEE Trans. Evol. Comp. 2002. Ozaki et al.:
Multiobjective tree-structured Parzen estimator. JAIR 2022.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from analysis.optimise.limits import broken_before, broken_by_image
from analysis.optimise.measures import Measure
from analysis.optimise.plan import Plan
from analysis.optimise.setting import scene_of
from analysis.optimise.view import Render, Unseen, View
from analysis.sweep.laws import Choice, LogUniform
from analysis.sweep.sampling import Axis
from analysis.sweep.surface import OffSurface
from analysis.tune.kept import Kept, key_of
from analysis.tune.search import nearest_ideal, pareto
from analysis.tune.wireframe import Wires
from interchange.problems import BrightfieldError
from interchange.scene import Scene

MARGIN = 0.1  # of a front's extent, by which the box of the hypervolume goes beyond its nadir
ANGLE = float(np.radians(30))  # faces that meet at less are one smooth surface


@dataclass(frozen=True, eq=False)
class Trial:
    """``values`` of the objectives in the plan's order, NaN where a limit is ``broken`` ("" for none)."""

    parameters: dict[str, float]
    values: tuple[float, ...]
    broken: str = ""


@dataclass(frozen=True, eq=False)
class Searched:
    """``front``: indices of trials that keep the limits and that none beats in all objectives;
    ``resumed``: how many trials an earlier run had made."""

    method: str
    trials: tuple[Trial, ...]
    front: tuple[int, ...]
    resumed: int = 0

    @property
    def feasible(self) -> int:
        return sum(not t.broken for t in self.trials)


class Judge:
    """Judges set-ups of a plan, keeping what stays the same from one to the next."""

    def __init__(self, plan: Plan, base: Scene, live: Any) -> None:
        self.plan, self.base, self.live, self.wires = plan, base, live, Wires(ANGLE)

    def trial(self, parameters: Mapping[str, float], render: Render, runs: int = 1) -> Trial:
        plan = self.plan
        none = (float("nan"),) * len(plan.objectives)
        try:
            scene, defective = scene_of(plan, self.base, parameters)
            broken = broken_before(plan, scene, self.live)
            if broken:
                return Trial(dict(parameters), none, broken)
            view = self.view(scene, render, defective, runs)
            broken = broken_by_image(plan, view)
            if broken:
                return Trial(dict(parameters), none, broken)
            return Trial(dict(parameters), tuple(m.of(view) for m in plan.objectives.values()))
        except (Unseen, OffSurface) as reason:
            return Trial(dict(parameters), none, str(reason).rstrip("."))

    def view(self, scene: Scene, render: Render, defective: Scene | None = None, runs: int = 1) -> View:
        camera = scene.camera(self.plan.camera)
        camera = camera.resized(self.plan.width) if self.plan.width else camera
        return View(scene, camera, self.plan.part, render, self.live, self.wires, defective, runs)


def search(
    judge: Judge,
    render: Render,
    method: str,
    seed: int,
    told: Callable[[int, int], None] | None = None,
    keep: Path | None = None,
) -> Searched:
    """``method``: "tpe", "nsga2" or "random". The same arguments give the same trials. ``keep``: the file from which a
    search that was broken off goes on."""
    import optuna

    plan = judge.plan
    measures = list(plan.objectives.values())
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    done: list[Trial] = []

    warm = max(8, plan.trials // 6)
    sampler: Any
    if method == "random":
        sampler = optuna.samplers.RandomSampler(seed=seed)
    elif method == "nsga2":
        population = max(8, min(24, plan.trials // 5))
        sampler = optuna.samplers.NSGAIISampler(seed=seed, population_size=population)
    else:
        sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, n_startup_trials=warm)
    directions: list[Any] = ["minimize"] * len(measures)
    study = optuna.create_study(directions=directions, sampler=sampler)
    if method != "random":
        study.enqueue_trial(start(plan, judge.base))

    about = (plan.text, judge.base.digest, plan.trials, plan.width, plan.samples, method, seed)
    kept = Kept(keep, key_of(*about))

    def attempt(trial: Any) -> tuple[float, ...]:
        parameters = {a.address: _suggest(trial, a) for a in plan.axes}
        found = judged_once(kept, len(done), parameters, lambda: judge.trial(parameters, render))
        done.append(found)
        trial.set_constraint("limits", 1.0 if found.broken else -1.0)
        if told is not None:
            told(len(done), plan.trials)
        if found.broken:
            return tuple(loss(m, m.worst) for m in measures)
        return tuple(loss(m, v) for m, v in zip(measures, found.values, strict=True))

    study.optimize(attempt, n_trials=plan.trials)
    return Searched(method, tuple(done), front_of(measures, done), kept.answered)


def judged_once(kept: Kept, number: int, parameters: dict[str, float], judge: Callable[[], Trial]) -> Trial:
    """The trial that was kept under this number with these parameters, else what ``judge`` says, which is kept."""
    known = kept.result(number, parameters)
    if known is not None:
        return Trial(parameters, tuple(known["values"]), known["broken"])
    found = judge()
    kept.keep(parameters, {"values": found.values, "broken": found.broken})
    return found


def front_of(measures: Sequence[Measure], trials: Sequence[Trial]) -> tuple[int, ...]:
    kept = [i for i, t in enumerate(trials) if not t.broken]
    if not kept:
        return ()
    losses = np.array([[loss(m, v) for m, v in zip(measures, trials[i].values, strict=True)] for i in kept])
    return tuple(kept[i] for i in pareto(losses))


def loss(measure: Measure, value: float) -> float:
    """The lower the better; the logarithm of what spreads over magnitudes."""
    x = float(np.log(max(value, 1e-12))) if measure.log else value
    return -x if measure.best == "high" else x


def start(plan: Plan, base: Scene) -> dict[str, float]:
    """The set-up that the scene has, within the bounds: the first trial."""
    from analysis.sweep.address import knob

    found = {}
    for axis in plan.axes:
        now = knob(base, axis.address).value
        if isinstance(axis.law, Choice):
            found[axis.address] = min(axis.law.values, key=lambda v, now=now: abs(v - now))  # type: ignore[misc]
        else:
            low, high = (float(x) for x in axis.law.quantile(np.array([0.0, 1.0])))
            found[axis.address] = min(max(now, low), high)
    return found


def best_of(plan: Plan, trials: Sequence[Trial], front: Sequence[int], count: int) -> list[int]:
    """Of the front: the one nearest to the ideal, then each time the one farthest from those taken."""
    measures = list(plan.objectives.values())
    losses = np.array([[loss(m, v) for m, v in zip(measures, trials[i].values, strict=True)] for i in front])
    spread = np.ptp(losses, axis=0)
    scaled = (losses - losses.min(axis=0)) / np.where(spread > 0, spread, 1)
    taken = [nearest_ideal(losses, range(len(front)))]
    while len(taken) < min(count, len(front)):
        away = np.min(np.linalg.norm(scaled[:, None] - scaled[taken][None], axis=-1), axis=1)
        away[taken] = -1
        taken.append(int(np.argmax(away)))
    return [front[i] for i in taken]


def hypervolumes(plan: Plan, searches: Sequence[Searched]) -> list[np.ndarray]:
    """Of each search, after each of its trials (n,): the share of the box between ideal and nadir of all their fronts
    that is dominated. Zeros where nothing keeps the limits."""
    measures = list(plan.objectives.values())

    def losses(s: Searched, which: Sequence[int]) -> np.ndarray:
        rows = [[loss(m, v) for m, v in zip(measures, s.trials[i].values, strict=True)] for i in which]
        return np.array(rows).reshape(-1, len(measures))

    fronts = np.concatenate([losses(s, s.front) for s in searches])
    if not len(fronts):
        return [np.zeros(len(s.trials)) for s in searches]
    best, worst = fronts.min(axis=0), fronts.max(axis=0)
    if (
        len(measures) == 1
    ):  # whose front is a point: the box reaches to the worst set-up that keeps the limits
        kept = [losses(s, [i for i, t in enumerate(s.trials) if not t.broken]) for s in searches]
        worst = np.concatenate(kept).max(axis=0)
    worst = np.where(worst > best, worst + MARGIN * (worst - best), best + 1)
    found = []
    for s in searches:
        course, now = np.zeros(len(s.trials)), 0.0
        front = np.zeros((0, len(measures)))
        for i, t in enumerate(s.trials):
            if not t.broken:
                scaled = (losses(s, [i]) - best) / (worst - best)
                if (scaled < 1).all() and not (front <= scaled).all(axis=1).any():
                    front = np.concatenate([front, scaled])
                    front = front[pareto(front)]
                    now = hypervolume(front)
            course[i] = now
        found.append(course)
    return found


def hypervolume(front: np.ndarray) -> float:
    """Of the part of the box up to (1, ..., 1) that rows of ``front`` (n, k) dominate: slices along the last loss."""
    if front.shape[1] == 1:
        return float(max(1 - front.min(), 0.0)) if len(front) else 0.0
    rows = front[np.argsort(front[:, -1], kind="stable")]
    ends = np.append(np.minimum(rows[1:, -1], 1.0), 1.0)
    volume = 0.0
    for k, end in enumerate(ends):
        if end > rows[k, -1]:
            volume += (end - rows[k, -1]) * hypervolume(rows[: k + 1, :-1])
    return volume


def _suggest(trial: Any, axis: Axis) -> float:
    if isinstance(axis.law, Choice):
        return float(trial.suggest_categorical(axis.address, list(axis.law.values)))
    low, high = (float(x) for x in axis.law.quantile(np.array([0.0, 1.0])))
    return float(trial.suggest_float(axis.address, low, high, log=isinstance(axis.law, LogUniform)))


def nothing_keeps(plan: Plan, searched: Searched) -> BrightfieldError:
    """What is told where no set-up keeps the limits."""
    from collections import Counter

    told = ", ".join(f"{why}: {n}" for why, n in Counter(t.broken for t in searched.trials).most_common())
    return BrightfieldError(
        f"One set-up or more must keep the limits; none of {len(searched.trials)} did ({told}). ({plan.file})"
    )

"""The search for parameters: Optuna over what an algorithm declares, on some frames of a series, judged on the others.

One measure is optimised by TPE; two and more give a Pareto front, of which the chosen one is nearest to the ideal
point, each measure scaled to its spread over the front. The declared defaults are always tried first.

Bergstra, Bardenet, Bengio, Kégl: Algorithms for hyper-parameter optimization. NIPS 2011. Akiba et al.: Optuna: A
next-generation hyperparameter optimization framework. KDD 2019.
"""

import hashlib
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from analysis.tune.algorithms.base import Algorithm
from analysis.tune.frames import Frame
from analysis.tune.kept import Kept, key_of
from analysis.tune.scores import MEASURES, Rules, measures_of, score
from interchange.parameter import Kind, parameters, settings
from interchange.problems import BrightfieldError, did_you_mean

WIDE = 30.0  # bounds whose ratio is more than that are searched in logarithms


@dataclass(frozen=True)
class Bound:
    low: float
    high: float
    whole: bool = False
    unit: str = "1"
    symbol: str = ""
    meaning: str = ""

    @property
    def log(self) -> bool:
        return not self.whole and self.low > 0 and self.high / self.low > WIDE


@dataclass(frozen=True, eq=False)
class Trial:
    """``values``: the objectives on the frames tuned on; ``scores``: every measure there, means over the frames."""

    parameters: dict[str, float]
    values: tuple[float, ...]
    scores: dict[str, float]


@dataclass(frozen=True, eq=False)
class Tuning:
    """``trials`` in order, the first with the defaults; ``front``: indices of those that none beats in every
    objective; ``chosen``: one of them; ``resumed``: how many trials an earlier run had made."""

    algorithm: type[Algorithm]
    objectives: tuple[str, ...]
    bounds: dict[str, Bound]
    trials: tuple[Trial, ...]
    front: tuple[int, ...]
    chosen: int
    resumed: int = 0

    @property
    def best(self) -> Algorithm:
        return self.algorithm(**self.trials[self.chosen].parameters)

    @property
    def default(self) -> Algorithm:
        return self.algorithm(**self.trials[0].parameters)


def bounds_of(
    algorithm: type[Algorithm], given: Mapping[str, tuple[float, float]] | None = None
) -> dict[str, Bound]:
    """What is searched: the declared bounds, narrowed to those ``given``; equal ones hold a parameter fixed.

    Raises BrightfieldError for a name that is not declared and for bounds beyond the declared ones.
    """
    given = given or {}
    bounds = {}
    for name, about in parameters(algorithm).items():
        if about.kind is not Kind.FLOAT or about.per_lobe:
            raise BrightfieldError(f"{algorithm.__name__}.{name} must be one number to be tuned.")
        bounds[name] = Bound(about.low, about.high, False, about.unit, about.symbol, about.meaning)
    for name, rule in settings(algorithm).items():
        bounds[name] = Bound(rule.low, rule.high, True, "1", rule.symbol, rule.meaning)
    for name, (low, high) in given.items():
        if name not in bounds:
            raise BrightfieldError(
                f'{algorithm.__name__} has no parameter "{name}".{did_you_mean(name, bounds)} It has '
                f"{', '.join(bounds)}."
            )
        b = bounds[name]
        if not b.low <= low <= high <= b.high:
            raise BrightfieldError(
                f"Bounds of {name} must rise within [{b.low:g}, {b.high:g}]; got {low:g} to {high:g}."
            )
        bounds[name] = Bound(low, high, b.whole, b.unit, b.symbol, b.meaning)
    if not bounds:
        raise BrightfieldError(f"{algorithm.__name__} must declare one parameter or more to be tuned.")
    return bounds


def tune(
    algorithm: type[Algorithm],
    frames: Sequence[Frame],
    objectives: Sequence[str],
    rules: Rules,
    trials: int = 100,
    seed: int = 0,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    worst: float = 1.0,
    told: Callable[[int, int], None] | None = None,
    keep: Path | None = None,
) -> Tuning:
    """``objectives``: names of ``MEASURES``; ``worst``: share of the frames, the worst ones, whose mean is optimised
    (1 is the mean of all). The same arguments give the same trials. ``keep``: the file from which a search that was
    broken off goes on. Raises BrightfieldError."""
    import optuna

    check_objectives(algorithm, objectives)
    if not 0 < worst <= 1:
        raise BrightfieldError(f"The share of worst frames must lie in (0, 1]; got {worst:g}.")
    space = bounds_of(algorithm, bounds)
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    directions: list[Any] = ["maximize" if MEASURES[o].best == "high" else "minimize" for o in objectives]
    sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, n_startup_trials=max(8, trials // 6))
    study = optuna.create_study(directions=directions, sampler=sampler)
    study.enqueue_trial(_within(default_parameters(algorithm), space))
    weights = np.array([f.weight for f in frames])
    done: list[Trial] = []
    kept = Kept(
        keep, _about(algorithm, frames, objectives, rules, trials, seed, space, worst) if keep else ""
    )

    def attempt(trial: Any) -> tuple[float, ...]:
        chosen = {n: _suggest(trial, n, b) for n, b in space.items()}
        known = kept.result(len(done), chosen)
        if known is None:
            per_frame = scores_of(algorithm(**chosen), frames, rules)
            values = tuple(aggregate(per_frame[o], o, weights, worst) for o in objectives)
            known = {"values": values, "scores": {n: mean(v, weights) for n, v in per_frame.items()}}
            kept.keep(chosen, known)
        values = tuple(known["values"])
        done.append(Trial(chosen, values, known["scores"]))
        if told is not None:
            told(len(done), trials)
        return values

    study.optimize(attempt, n_trials=trials)
    signs = np.array([-1.0 if d == "maximize" else 1.0 for d in directions])
    losses = signs * np.array([t.values for t in done])
    front = pareto(losses)
    return Tuning(
        algorithm,
        tuple(objectives),
        space,
        tuple(done),
        tuple(front),
        nearest_ideal(losses, front),
        kept.answered,
    )


def _about(algorithm: type[Algorithm], frames: Sequence[Frame], *rest: object) -> str:
    """What decides a search: the algorithm, the frames' images and truths, and all that it is told."""
    sha = hashlib.sha256()
    for f in frames:
        t = f.truth
        arrays = (f.image, f.usable, t.regions, *((t.edges.points, t.edges.line) if t.edges else ()))
        for x in arrays:
            sha.update(b"none" if x is None else np.ascontiguousarray(x).tobytes())
        sha.update(repr((f.weight, t.lines, t.circles, t.patterns)).encode())
    return key_of(algorithm.__qualname__, algorithm.source, text_of(algorithm), sha.hexdigest(), *rest)


def text_of(algorithm: type[Algorithm]) -> str:
    """The source of its module: another version of a user's function is another algorithm."""
    module = inspect.getmodule(getattr(algorithm, "function", algorithm))
    try:
        return inspect.getsource(module) if module else ""
    except OSError:  # typed in at a prompt
        return ""


def check_objectives(algorithm: type[Algorithm], objectives: Sequence[str]) -> None:
    known = measures_of(algorithm.finds)
    if not objectives or len(set(objectives)) < len(objectives):
        raise BrightfieldError(
            f"There must be one objective or more, each once; got {', '.join(objectives)}."
        )
    for name in objectives:
        if name not in known:
            raise BrightfieldError(
                f'{algorithm.__name__} is not measured by "{name}".{did_you_mean(name, known)} It is by '
                f"{', '.join(known)}."
            )


def scores_of(algorithm: Algorithm, frames: Sequence[Frame], rules: Rules) -> dict[str, np.ndarray]:
    """Every measure by name, (n,) over the frames."""
    each = [score(algorithm, f, rules) for f in frames]
    return {n: np.array([s[n] for s in each]) for n in measures_of(algorithm.finds)}


def aggregate(values: np.ndarray, measure: str, weights: np.ndarray, worst: float = 1.0) -> float:
    """The mean over the worst share of the frames, all (n,); frames without a value are left out. Raises
    BrightfieldError where none has one."""
    good = np.isfinite(values) & (weights > 0)
    if not good.any():
        raise BrightfieldError(
            f"No frame of the series can be judged by {measure} ({MEASURES[measure].meaning})."
        )
    x, w = values[good], weights[good]
    order = np.argsort(x if MEASURES[measure].best == "high" else -x, kind="stable")
    x, w = x[order], w[order]
    share = w * np.clip(
        (worst * w.sum() - (np.cumsum(w) - w)) / w, 0, 1
    )  # of each frame that is among the worst
    return float(np.sum(share * x) / share.sum())


def mean(values: np.ndarray, weights: np.ndarray) -> float:
    """Weighted, over the frames that have a value; NaN where none has."""
    good = np.isfinite(values) & (weights > 0)
    return float(np.average(values[good], weights=weights[good])) if good.any() else float("nan")


def default_parameters(algorithm: type[Algorithm]) -> dict[str, float]:
    own = algorithm()
    return {n: getattr(own, n) for n in (*parameters(algorithm), *settings(algorithm))}


def pareto(losses: np.ndarray) -> list[int]:
    """Indices of rows of ``losses`` (n, k), the lower the better, that no other row beats or equals in all and beats in
    one; of equal rows the first."""
    front = []
    for i, row in enumerate(losses):
        no_worse = (losses <= row).all(axis=1)
        better = no_worse & (losses < row).any(axis=1)
        twin = (losses[:i] == row).all(axis=1).any()
        if np.isfinite(row).all() and not better.any() and not twin:
            front.append(i)
    return front


def nearest_ideal(losses: np.ndarray, front: Sequence[int]) -> int:
    """Of the front, the row nearest to the best of each loss, every loss scaled to its spread over the front."""
    own = losses[list(front)]
    spread = np.ptp(own, axis=0)
    scaled = (own - own.min(axis=0)) / np.where(spread > 0, spread, 1)
    return int(front[int(np.argmin(np.linalg.norm(scaled, axis=1)))])


def _suggest(trial: Any, name: str, bound: Bound) -> float:
    if bound.whole:
        return int(trial.suggest_int(name, int(bound.low), int(bound.high)))
    return float(trial.suggest_float(name, bound.low, bound.high, log=bound.log))


def _within(values: Mapping[str, float], space: Mapping[str, Bound]) -> dict[str, float]:
    return {n: min(max(values[n], b.low), b.high) for n, b in space.items()}

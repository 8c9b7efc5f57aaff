"""A tuning from start to end: split the series, search, look at robustness, predict the real images, then score them.

The prediction is handed to ``stated`` before any real image is scored; whoever writes it to disk there has it stated
first.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from analysis.tune.algorithms.base import Algorithm
from analysis.tune.found import Place
from analysis.tune.frames import Frame, pattern_of
from analysis.tune.prediction import LEAST, Prediction, Verified, predict, verify
from analysis.tune.robustness import Slice, dependence, slices
from analysis.tune.scores import Rules, measures_of
from analysis.tune.search import Tuning, mean, scores_of, tune
from interchange.problems import BrightfieldError

DEFAULT_OBJECTIVE = {"Edges": "f1", "Blobs": "f1"}  # of the kind found; else position
SLICED = 6  # frames on which slices are drawn


@dataclass(frozen=True, eq=False)
class Session:
    """``tuned_on`` and ``held_out``: indices of ``frames``; ``scores`` and ``default_scores``: every measure (n,) over
    all frames with the chosen and with the declared default parameters; ``real`` likewise over the real frames."""

    frames: Sequence[Frame]
    tuned_on: np.ndarray
    held_out: np.ndarray
    tuning: Tuning
    scores: dict[str, np.ndarray]
    default_scores: dict[str, np.ndarray]
    slices: list[Slice]
    dependence: dict[str, float]
    predictions: list[Prediction]
    rules: Rules
    real_frames: Sequence[Frame]
    real_scores: dict[str, np.ndarray]
    real_default: dict[str, np.ndarray]
    verified: Verified | None

    def mean(self, measure: str, which: np.ndarray, default: bool = False) -> float:
        """Of ``measure`` over the frames ``which`` (indices), weighted; NaN where none can be judged."""
        scores = self.default_scores if default else self.scores
        weights = np.array([f.weight for f in self.frames])
        return mean(scores[measure][which], weights[which])


def split(count: int, share: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices of frames to tune on and of those held out, each in order, drawn with ``seed``; one or more each."""
    if count < 2:
        raise BrightfieldError(f"A series to tune on must have two frames or more; it has {count}.")
    if not 0 < share < 1:
        raise BrightfieldError(f"The share of frames held out must lie between 0 and 1; got {share:g}.")
    order = np.random.default_rng(seed).permutation(count)
    held = min(max(1, round(share * count)), count - 1)
    return np.sort(order[held:]), np.sort(order[:held])


def run(
    algorithm: type[Algorithm],
    frames: Sequence[Frame],
    objectives: Sequence[str] = (),
    rules: Rules = Rules(),  # noqa: B008  frozen
    trials: int = 100,
    seed: int = 0,
    holdout: float = 0.35,
    worst: float = 1.0,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    real: Callable[[], Sequence[Frame]] | None = None,
    coverage: float = 0.9,
    registration: float = 0.0,
    stated: Callable[[Tuning, list[Prediction]], Any] | None = None,
    told: Callable[[int, int], None] | None = None,
    keep: Path | None = None,
) -> Session:
    """``real`` is called for the real frames after ``stated`` has the prediction; ``registration`` px, rms in each
    direction: how well the truth of real images is known, which their prediction counts in; ``keep``: the file from
    which a search that was broken off goes on. Raises BrightfieldError."""
    chosen = tuple(objectives) or (DEFAULT_OBJECTIVE.get(algorithm.finds.__name__, "position"),)
    tuned_on, held_out = split(len(frames), holdout, seed)
    if algorithm.finds is Place:
        names = frames[0].truth.patterns
        rules = replace(rules, patterns={n: pattern_of(frames[tuned_on[0]], n) for n in names})
    own = [frames[i] for i in tuned_on]
    tuning = tune(algorithm, own, chosen, rules, trials, seed, bounds, worst, told, keep)
    scores = scores_of(tuning.best, frames, rules)
    default = scores_of(tuning.default, frames, rules)
    others = [frames[i] for i in held_out]
    rough = replace(rules, registration=registration)
    foretold = (
        scores_of(tuning.best, others, rough)
        if registration > 0
        else {m: v[held_out] for m, v in scores.items()}
    )
    weights = np.array([f.weight for f in others])
    predictions = [
        predict(m, foretold[m], weights, coverage)
        for m in measures_of(algorithm.finds)
        if np.isfinite(foretold[m]).sum() >= LEAST
    ]
    if real is not None and not predictions:
        raise BrightfieldError(
            f"Real images can be predicted from {LEAST} held-out frames or more; there are {len(held_out)}. Hold out a "
            "larger share, or simulate more."
        )
    if stated is not None:
        stated(tuning, predictions)
    real_frames = list(real()) if real is not None else []
    real_scores = scores_of(tuning.best, real_frames, rules)
    return Session(
        frames=frames,
        tuned_on=tuned_on,
        held_out=held_out,
        tuning=tuning,
        scores=scores,
        default_scores=default,
        slices=slices(tuning, own[:SLICED], rules, chosen[0]),
        dependence=dependence(frames, scores[chosen[0]]),
        predictions=predictions,
        rules=rules,
        real_frames=real_frames,
        real_scores=real_scores,
        real_default=scores_of(tuning.default, real_frames, rules),
        verified=verify(predictions, real_scores, [f.name for f in real_frames]) if real_frames else None,
    )

"""From the scene as written to where a cause alone comes nearest to the captures, from coarse to fine.

An edge that is off by more than its own width tells no linearisation how far, and a shadow's hardly which way. Means
over 16 x 16 pixels have edges as wide; then over 8 x 8, 4 x 4 and 2 x 2, each from where the one before ended, or from
home where that is nearer. Objects slide first and turn later; how high they lie is left to finer edges. Every capture
may be as much brighter as it likes: of what a lamp's place changes, shape counts.

Lucas, Kanade: An iterative image registration technique with an application to stereo vision. IJCAI 1981.
Bergen et al.: Hierarchical model-based motion estimation. ECCV 1992.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.radiance import Rendered, means
from analysis.gap.light.reach import cropped
from analysis.gap.parallel import each
from analysis.gap.terms.base import Cause
from analysis.gap.terms.normal_equations import FLOOR, SIGNAL
from interchange.camera import Camera
from interchange.problems import BrightfieldError

if TYPE_CHECKING:
    from analysis.gap.search.search import Search

LEVELS = (16, 8, 4, 2)  # pixels along a side of what is taken together
LEAST = 4  # pixels along a side that a level has
STEPS = 5  # of each level, at most
TURNING, RISING = 8, 4  # levels from which on objects do not turn, and neither rise nor sink
PARTS = (1.0, 0.4)  # of a step that are tried
LONGER = (2.0, 4.0)  # times a step, as long as they are better
NEAR = 0.5  # units, times the level: a shorter step is the next level's
FINE = 2  # levels that two causes together are followed over
CANDIDATES = 4  # causes that are followed: those that explain most where the scene stands as written
FURTHEST = 15.0  # units that a number moves by at once, times the level: one and a half pixels of it
DAMPING = 1e-2
SETTLED = 0.1  # of what is left: a smaller gain is the last


@dataclass(frozen=True)
class Approach:
    """``at`` (q,): where the cause stands; ``gain``: by how much less is left there, and would be a step
    further, in sigma² of pixels."""

    cause: Cause
    at: np.ndarray
    gain: float


@dataclass(frozen=True, eq=False)
class _Level:
    """Conditions on a grid ``n`` times coarser than the sensors', and the weight (h, w, C) of each of their pixels."""

    n: int
    conditions: tuple[Condition, ...]
    weights: tuple[np.ndarray, ...]


def approaches(search: "Search", causes: dict[Cause, np.ndarray]) -> list[Approach]:
    """Of those of ``causes`` {cause: its terms} that explain most, the nearest first."""
    levels = _levels(search)
    home = np.zeros(search.q)
    gains = _gains(search, levels, causes, home)
    found = []
    for cause in sorted(gains, key=lambda c: -gains[c])[: CANDIDATES if levels else 0]:
        found.append(_descended(search, levels, cause, causes[cause], home))
        search.told("what moves", len(found) / CANDIDATES)
    return sorted(found, key=lambda a: -a.gain)


def approached_beside(
    search: "Search", causes: dict[Cause, np.ndarray], first: Approach, least: float = 0.0
) -> Approach | None:
    """Which of ``causes`` explains most beside ``first``, both followed from where that ended, over fine levels
    alone; None where there is none, or a step further explains less than ``least`` of what ``first`` leaves."""
    levels = _levels(search)[-FINE:]
    both = {
        c: np.sort(np.concatenate([causes[first.cause], i])) for c, i in causes.items() if c != first.cause
    }
    if not levels or not both:
        return None
    gains = _gains(search, levels, both, first.at)
    cause = max(gains, key=lambda c: gains[c])
    ways = {first.cause: causes[first.cause], cause: both[cause]}
    if least and not any(_explains(search, level, first, cause, ways, least) for level in levels):
        return None
    return _descended(search, levels, cause, both[cause], first.at)


def _explains(
    search: "Search",
    level: _Level,
    first: Approach,
    cause: Cause,
    ways: dict[Cause, np.ndarray],
    least: float,
) -> bool:
    """Whether a step of both, ``ways[cause]``, explains ``least`` or more of what one of ``first`` leaves."""
    gains = _gains(search, [level], ways, first.at)
    alone = gains[first.cause]
    return gains[cause] - alone >= least * (_left(search, level, first.at) - alone)


def _gains(
    search: "Search", levels: Sequence[_Level], causes: dict[Cause, np.ndarray], at: np.ndarray
) -> dict[Cause, float]:
    """What a step of each explains where the scene stands ``at``, at the level where it is most."""
    gains = dict.fromkeys(causes, 0.0)
    every = np.array(sorted({int(i) for index in causes.values() for i in index}))
    for level in levels:
        G, b, _ = _equations(search, level, every, at)
        for cause, index in causes.items():
            own = np.searchsorted(every, index)
            unit = _units(search, index)
            gain = float(b[own] @ _solved(G[np.ix_(own, own)], b[own], unit))
            gains[cause] = max(gains[cause], gain)
    return gains


def _levels(search: "Search") -> list[_Level]:
    smallest = min((min(c.camera.sensor.resolution) for c in search.conditions), default=0)
    return [_level(search, n) for n in LEVELS if n * LEAST <= smallest]


def _descended(
    search: "Search", levels: Sequence[_Level], cause: Cause, index: np.ndarray, home: np.ndarray
) -> Approach:
    """From ``home``; of that is the gain."""
    at, gain, every = home, 0.0, index
    for level in levels:
        index = _sliding(search, every, level.n)
        before = now = _left(search, level, home)
        if at is not home and (there := _left(search, level, at)) < before:
            now = there
        else:
            at = home
        for _ in range(STEPS):
            step = np.zeros(search.q)
            try:
                step[index] = _step(search, level, index, at)
            except BrightfieldError:  # at the end of what it may be
                break
            if np.abs(step[index] / _units(search, index)).max() < NEAR * level.n:
                break
            for part in PARTS:
                aim = search.within(at + part * step, index)
                left = _tried(search, level, aim)
                if left < now:
                    break
            else:
                break
            # an edge's slope is less than the way that it has to go
            for more in LONGER if part == PARTS[0] else ():
                further = search.within(at + more * step, index)
                there = _tried(search, level, further)
                if there >= left:
                    break
                aim, left = further, there
            settled = now - left < SETTLED * left
            at, now = aim, left
            if settled:
                break
        gain = before - now
    G, b, _ = _equations(search, levels[-1], index, at)
    return Approach(cause, at, gain + float(b @ _solved(G, b, _units(search, index))))


def _sliding(search: "Search", index: np.ndarray, n: int) -> np.ndarray:
    """What is followed at a level: an object that sinks out of sight leaves no way back."""
    held = ("z", "rx", "ry", "rz") if n >= TURNING else ("z",) if n >= RISING else ()
    return np.array(
        [i for i in index if search.terms[i].cause != "object_pose" or search.terms[i].parameter not in held]
    )


def _tried(search: "Search", level: _Level, at: np.ndarray) -> float:
    """What is left where the scene stands ``at``; infinite where it cannot stand there."""
    try:
        search.can_stand(at)
    except BrightfieldError:
        return np.inf
    return _left(search, level, at)


def _left(search: "Search", level: _Level, at: np.ndarray) -> float:
    return _equations(search, level, np.array([], int), at)[2]


Numbers = tuple[np.ndarray, np.ndarray, float]


def _equations(search: "Search", level: _Level, index: np.ndarray, at: np.ndarray) -> Numbers:
    """X' W X (k, k), X' W r (k,) and r' W r of the terms ``index`` where the scene stands ``at``, each condition
    without what a brighter capture would be."""
    terms = [search.terms[i] for i in index]
    G, b, rr = np.zeros((len(index), len(index))), np.zeros(len(index)), 0.0
    model = search.model(at, at)

    def of(k: int) -> tuple[list[int], np.ndarray]:
        state, W = model.state(level.conditions[k]), level.weights[k]
        s = state.signal
        columns = [t.column(state) for t in terms]
        shown = [k for k, column in enumerate(columns) if column is not None]
        X = np.stack([state.residual, *(columns[k] for k in shown)]).astype(np.float32)
        share = np.einsum("khwc,hwc->kc", X, W * s) / np.maximum((W * s * s).sum(axis=(0, 1)), 1e-30)
        X = (X - share[:, None, None, :] * s).reshape(len(X), -1)
        return shown, (X * W.reshape(-1)) @ X.T

    for shown, A in each(of, range(len(level.conditions))):
        G[np.ix_(shown, shown)] += A[1:, 1:]
        b[shown] += A[1:, 0]
        rr += float(A[0, 0])
    return G, b, rr


def _step(search: "Search", level: _Level, index: np.ndarray, at: np.ndarray) -> np.ndarray:
    unit = level.n * _units(search, index)
    G, b, _ = _equations(search, level, index, at)
    delta = _solved(G, b, unit)
    return np.asarray(delta * min(1.0, FURTHEST / max(float(np.abs(delta / unit).max()), 1e-30)))


def _units(search: "Search", index: np.ndarray) -> np.ndarray:
    """By which terms count: the steps of what is rendered, the tolerances of what moves the image."""
    terms = [search.terms[i] for i in index]
    return np.array([t.step if t.kind == "scene" else t.spike for t in terms])


def _solved(G: np.ndarray, b: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Levenberg's step, damped in ``unit``: what hardly shows stays."""
    scaled = G * np.outer(unit, unit)
    most = max(float(np.diag(scaled).max()), 1e-30)
    return np.asarray(unit * np.linalg.solve(scaled + DAMPING * most * np.eye(len(b)), b * unit))


def _level(search: "Search", n: int) -> _Level:
    home = np.zeros(search.q)
    shown: dict[int, Rendered] = {}
    conditions, weights = [], []
    for condition in search.conditions:
        state = search.model(home, home).state(condition)
        if not state.usable.any() or not state.signal.any():
            continue
        e, s = state.simulation, np.maximum(state.signal, 0)
        v = e.temporal / len(condition.captures) + e.fixed + (SIGNAL * s) ** 2 + (FLOOR * s.mean()) ** 2
        whole = np.where(state.usable[..., None], 1 / v, 0).astype(np.float32)
        weight = means(whole, n)
        r = means(whole * state.residual, n) / np.maximum(weight, 1e-30)
        if id(condition.shown) not in shown:
            shown[id(condition.shown)] = _rendered(condition.shown, n)
        there = shown[id(condition.shown)]
        seen = np.ones(weight.shape[:2], bool)
        camera = replace(_camera(condition.camera, n), t_exp=condition.camera.t_exp)
        coarse = replace(condition, camera=camera, rendered=there, mask=seen, mean=r, packed=None)
        brighter = float(search.model(home, home).state(coarse).signal.sum() / means(state.signal, n).sum())
        coarse = replace(coarse, camera=replace(camera, t_exp=camera.t_exp / brighter))  # larger pixels
        simulated = search.model(home, home).state(coarse).simulation.dn
        conditions.append(replace(coarse, mean=r + simulated))
        weights.append(weight * n**2)
    return _Level(n, tuple(conditions), tuple(weights))


def _rendered(shown: Rendered, n: int) -> Rendered:
    middle = slice(n // 2, None, n)
    height, width = (x // n for x in shown.rest.shape[:2])
    return replace(
        shown,
        camera=_camera(shown.camera, n),
        lamps={k: means(v, n) for k, v in shown.lamps.items()},
        rest=means(shown.rest, n),
        ambient=means(shown.ambient, n),
        leaning={axis: means(p, n) for axis, p in shown.leaning.items()},
        indirect={k: means(v, n) for k, v in shown.indirect.items()},
        undrawn={k: means(v, n) for k, v in shown.undrawn.items()},
        passes={k: v[middle, middle][:height, :width] for k, v in shown.passes.items()},
        fine={},
        coarse=n,
        origin=shown,
        elsewhere=(),
        moved=None,
    )


def _camera(camera: Camera, n: int) -> Camera:
    width, height = (x // n for x in camera.sensor.resolution)
    coarse = cropped(camera, slice(0, height * n), slice(0, width * n)).resized(width)
    # a JPEG's blocks are of the own pixels
    return replace(coarse, sensor=replace(coarse.sensor, jpeg_quality=0))

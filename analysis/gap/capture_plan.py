"""Which few captures make effects identifiable, before anyone goes to the rig.

Every capture that the scene offers (cameras where they stand, each lamp alone, all, none, other exposures) is
simulated, and what unit errors of each effect would add to it gives its normal equations. With those of the chosen
captures summed, the margin by which effect i, as large as ``SEVERITY``, would be told from effect j is

    m_ij = ½ Σ_k S_kk σ_k²,    S = (A⁻¹_ii)⁻¹ - P_i,    A = G + P with j free and all else within its tolerance

(the Schur complement of i: what no value of j and of the tolerances can imitate). Captures are added one by one, each
time that which raises Σ min(m_ij, ENOUGH) most.

T-optimality: Atkinson, Fedorov: The design of experiments for discriminating between two rival models. Biometrika 1975.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.judgement.advice import separating
from analysis.gap.light.named import arrangement
from analysis.gap.light.radiance import Render, Rendered, render_all
from analysis.gap.parallel import each
from analysis.gap.sensor.expected import expected
from analysis.gap.terms.base import NUISANCE, Term
from analysis.gap.terms.chain import chain_terms, dark_current, shutter_delay
from analysis.gap.terms.geometry import geometry_terms, moved_objects
from analysis.gap.terms.light import light_terms, shaded
from analysis.gap.terms.material import material_terms
from analysis.gap.terms.normal_equations import equations, stride_for
from interchange.camera import Camera
from interchange.captures import Capture, Tolerances
from interchange.formats.document import Document
from interchange.light import Light
from interchange.problems import BrightfieldError
from interchange.scene import Scene

SEVERITY = 0.01  # rms of an effect over the signal
ENOUGH = 9.0  # margin of log Z: odds of 20 at the temper of analysis.gap.evidence.likelihood
FULL = 0.7  # of the highest DN, for the brightest part of a capture
DIM = 0.1  # of the highest DN: what stays below that in its brightest part tells little
LONGEST = 10.0  # s: nobody waits longer, and what a sensor gathers in the dark would fill it
MOST_VIEWS, WIDTH = 8, 160  # stands of cameras; px of the simulation
LEAST, LITTLE = 5, 0.004  # captures; gain, of what is left, below which no more are added
REPEATS = 4
ALL, NONE = "all lamps", "no lamp"

Cause = tuple[str, str]
Told = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A capture that could be taken. ``like``: the time code whose poses it has; ``time``: the one that the scene has
    for it, None where there is none yet; ``lamps``: those that are on; ``bright``: its brightest part, of the highest
    DN over black."""

    camera: str
    like: float
    time: float | None
    lamps: tuple[str, ...]
    lighting: str
    exposure: float
    bright: float
    stops: str = ""

    @property
    def name(self) -> str:
        return f"{self.camera.rsplit('/', 1)[-1]}, {self.lighting}{self.stops}"


@dataclass(frozen=True)
class Pair:
    """Two effects (``rival`` None: no effect at all) and the margin, nats, by which the captures tell them apart."""

    effect: Cause
    rival: Cause | None
    margin: float


@dataclass(frozen=True, eq=False)
class Planned:
    """One capture of the plan, how often to take it, and the pairs that only it, after those before it, tells apart."""

    candidate: Candidate
    repeats: int
    separates: tuple[Pair, ...]


@dataclass(frozen=True, eq=False)
class CapturePlan:
    """``captures`` in the order to take them; ``confusable``: the pairs that stay below ``ENOUGH``, worst first;
    ``told``: how many of ``pairs`` are told apart."""

    captures: tuple[Planned, ...]
    confusable: tuple[Pair, ...]
    told: int
    pairs: int


def capture_plan(
    document: Document,
    render: Render,
    settings: dict[str, Any],
    cache: Path,
    tolerances: Tolerances | None = None,
    most: int = 12,
    told: Told = lambda what, share: None,
) -> CapturePlan:
    """The plan for a scene; at most ``most`` captures, repeats not counted. Raises BrightfieldError where the scene has
    no camera or no lamp."""
    tolerances = tolerances or Tolerances()
    candidates, conditions = _candidates(document, render, settings, cache, told)
    terms = _terms(conditions, tolerances)
    stride = stride_for(conditions)
    zero = np.zeros(len(terms))
    parts, signal = [], 0.0
    for k, c in enumerate(conditions):
        state = State(c, stride=stride)
        part = equations(state, terms, zero) if state.usable.any() else None
        parts.append(np.zeros((len(terms), len(terms))) if part is None else part.G)
        signal += 0.0 if part is None else part.signal
        told("sensitivities", (k + 1) / len(conditions))
    margins = Margins(terms, np.sum(parts, axis=0), signal)
    with threadpool_limits(1, "blas"):  # matrices are small; threads would wait for each other
        return _greedy(candidates, parts, margins, most, told)


class Margins:
    """m_ij of a set of captures. ``G`` (q, q), ``signal``: of all captures, by which terms are scaled."""

    def __init__(self, terms: Sequence[Term], G: np.ndarray, signal: float) -> None:
        share = np.sqrt(np.maximum(np.diag(G), 0) / max(signal, 1e-30))
        seen = share > 0
        safe = np.maximum(share, 1e-12)
        self.spike = np.array(
            [t.spike / s if t.relative else t.spike for t, s in zip(terms, safe, strict=True)]
        )
        members: dict[Cause, list[int]] = {}
        for i, term in enumerate(terms):
            if seen[i] and term.cause != NUISANCE and not term.form:
                members.setdefault(term.candidate, []).append(i)
        self.members = {c: np.array(i) for c, i in members.items()}
        self.slab = np.zeros(len(terms))
        for index in self.members.values():
            self.slab[index] = SEVERITY / safe[index] / np.sqrt(len(index))
        told = np.array([[not _the_same(a, b) for a in self.members] for b in (None, *self.members)], bool)
        self._told = told.reshape(-1)
        every = [(a, b) for b in (None, *self.members) for a in self.members]
        self.pairs: list[tuple[Cause, Cause | None]] = [
            p for p, t in zip(every, self._told, strict=True) if t
        ]
        sizes = [len(i) for i in self.members.values()]
        self._places = [
            np.flatnonzero(np.equal(sizes, m)) for m in sorted(set(sizes))
        ]  # of effects of as many terms

    def of(self, G: np.ndarray, known: np.ndarray | None = None) -> np.ndarray:
        """(n,) margins in nats of ``pairs``; those that are told apart by ``known``, of fewer captures, are as there:
        more captures take nothing from them."""
        D = self.spike
        C = np.linalg.inv(np.eye(len(D)) + G * D[:, None] * D[None, :])  # in units of the spikes
        ratio = self.slab / D
        own = list(self.members.values())
        groups = []
        for places in self._places:
            i = np.stack([own[k] for k in places])  # (n, m)
            groups.append((places, i, np.linalg.inv(C[i[:, :, None], i[:, None, :]])))
        out = np.zeros((1 + len(own), len(own)))
        if known is not None:
            out.reshape(-1)[self._told] = known
        wanted = (out < ENOUGH) & self._told.reshape(out.shape)
        for row, rival in enumerate((None, *own)):
            if not wanted[row].any():
                continue
            V = self._freed(C, ratio, rival)
            for group in groups:
                places, i, P = (x[wanted[row][group[0]]] for x in group)
                if not len(places):
                    continue
                if V.shape[1] < i.shape[1]:  # by Woodbury's formula
                    U = P @ V[i]
                    inner = np.linalg.inv(np.eye(V.shape[1]) + V[i].transpose(0, 2, 1) @ U)
                    S = np.diagonal(P, axis1=1, axis2=2) - ((U @ inner) * U).sum(axis=2)
                else:
                    within = C[i[:, :, None], i[:, None, :]] + V[i] @ V[i].transpose(0, 2, 1)
                    S = np.diagonal(np.linalg.inv(within), axis1=1, axis2=2)
                out[row, places] = 0.5 * ((S - 1) * ratio[i] ** 2).sum(axis=1)
        return np.maximum(out.reshape(-1)[self._told], 0.0)

    def _freed(self, C: np.ndarray, ratio: np.ndarray, rival: np.ndarray | None) -> np.ndarray:
        """(q, k): V, where the covariance is C + V V' with the terms ``rival`` as good as free."""
        if rival is None:
            return np.zeros((len(C), 1))
        more = 1 - np.maximum(100 * ratio[rival], 2.0) ** -2
        w, Q = np.linalg.eigh(np.diag(1 / more) - C[np.ix_(rival, rival)])
        return np.asarray(
            C[:, rival] @ (Q / np.sqrt(np.maximum(w, 1e-9)))
        )  # what nothing shows moves nothing else


def _the_same(a: Cause, b: Cause | None) -> bool:
    """Whether both are one effect on one thing, whichever way it takes."""
    return b is not None and a[0] == b[0] and a[1].partition(",")[0] == b[1].partition(",")[0]


def _greedy(
    candidates: Sequence[Candidate], parts: Sequence[np.ndarray], margins: Margins, most: int, told: Told
) -> CapturePlan:
    G = np.zeros_like(parts[0])
    now = np.zeros(len(margins.pairs))
    chosen: list[int] = []
    planned: list[Planned] = []
    for step in range(min(most, len(candidates))):
        rest = [k for k in range(len(candidates)) if k not in chosen]
        found = each(partial(margins.of, known=now), [G + parts[k] for k in rest])
        tried = dict(zip(rest, found, strict=True))
        gain = {
            k: float(np.minimum(m, ENOUGH).sum() - np.minimum(now, ENOUGH).sum()) for k, m in tried.items()
        }
        best = max(rest, key=lambda k: gain[k])
        missing = ENOUGH * len(now) - float(np.minimum(now, ENOUGH).sum())
        if len(chosen) >= LEAST and gain[best] < LITTLE * missing:
            break
        told("choosing", (step + 1) / most)
        newly = np.flatnonzero((tried[best] >= ENOUGH) & (now < ENOUGH))
        order = newly[np.argsort(-(np.minimum(tried[best], ENOUGH) - now)[newly])]
        pairs = tuple(_pair(margins, int(i), tried[best]) for i in order)
        planned.append(Planned(candidates[best], 1, pairs))
        G, now = G + parts[best], tried[best]
        chosen.append(best)
    bright = next((k for k, p in enumerate(planned) if p.candidate.lighting == ALL), 0)
    planned[bright] = replace(planned[bright], repeats=REPEATS)
    left = [_pair(margins, int(i), now) for i in np.argsort(now) if now[i] < ENOUGH]
    return CapturePlan(tuple(planned), tuple(left), int((now >= ENOUGH).sum()), len(now))


def _pair(margins: Margins, number: int, values: np.ndarray) -> Pair:
    effect, rival = margins.pairs[number]
    return Pair(effect, rival, float(values[number]))


def _terms(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    bright = max(conditions, key=lambda c: float(np.median(c.mean)))
    found = [
        *geometry_terms(conditions, tolerances),
        *moved_objects(conditions, tolerances),
        *light_terms(conditions, tolerances),
        *shaded(conditions, tolerances),
        *material_terms(conditions, tolerances),
        *chain_terms(State(bright), tolerances, {c.camera.t_exp for c in conditions}),
        *dark_current(conditions, tolerances),
        *shutter_delay(conditions, tolerances),
    ]
    return [t for t in found if not t.generic]


def _candidates(
    document: Document, render: Render, settings: dict[str, Any], cache: Path, told: Told
) -> tuple[list[Candidate], list[Condition]]:
    scenes = {time: document.scene(time) for time in document.times}
    first = next(iter(scenes.values()))
    if not first.cameras or not first.lights:
        what = "camera" if not first.cameras else "lamp"
        raise BrightfieldError(
            f"A plan needs a scene with a camera and a lamp; it has no {what}. ({document.path})"
        )
    if flashing := [x.name for x in first.lights if x.strobe.is_there]:
        raise BrightfieldError(
            f"A plan chooses exposures, of which lamps that are always on get all; {flashing[0]} flashes. "
            f"({document.path})"
        )
    brightest: dict[str, Light] = {}
    for scene in scenes.values():
        for light in scene.lights:
            if light.name not in brightest or max(light.intensity) > max(brightest[light.name].intensity):
                brightest[light.name] = light
    powered = [name for name, light in brightest.items() if light.is_on]
    if not powered:
        raise BrightfieldError(
            f"A plan needs a lamp that is on at some time code; none is. ({document.path})"
        )
    views = _views(scenes)
    small = [(_lit(scenes[t], brightest, powered), _small(scenes[t].camera(name))) for name, t in views]
    rendered = render_all(small, render, settings, cache, lambda k, n: told("rendering", k / n))
    lightings = {ALL: tuple(powered)} if len(powered) > 1 else {}
    lightings |= {
        f"{n.rsplit('/', 1)[-1]} alone" if lightings else n.rsplit("/", 1)[-1]: (n,) for n in powered
    }
    lightings[NONE] = ()
    candidates, conditions = [], []
    for (name, like), (whole, camera), shown in zip(views, small, rendered, strict=True):
        base = 0.0
        for lighting, lamps in lightings.items():
            scene = _lit(whole, brightest, lamps)
            rate = _brightest(scene, camera, shown)
            exposure = _exposure(rate) if lamps else base
            base = max(base, exposure)
            at_several = len(lamps) in (0, len(powered))  # all light, and the dark
            for stops, factor in (("", 1.0), (", a quarter", 0.25), (", four times", 4.0)):
                if factor != 1 and not at_several:
                    continue
                seconds = _rounded(factor * exposure)
                if seconds > LONGEST:
                    continue
                time = _existing(scenes, name, like, lamps, whole)
                candidates.append(
                    Candidate(name, like, time, lamps, lighting, seconds, rate * seconds, stops)
                )
                conditions.append(_condition(scene, replace(camera, t_exp=seconds), shown, candidates[-1]))
    return candidates, conditions


def _views(scenes: dict[float, Scene]) -> list[tuple[str, float]]:
    """Each camera at each of its stands, and with each arrangement of objects: its name and a time code."""
    found: dict[str, tuple[str, float]] = {}
    for time, scene in scenes.items():
        for camera in scene.cameras:
            found.setdefault(arrangement(scene, replace(camera, t_exp=1.0)), (camera.name, time))
    views = list(found.values())
    if len(views) > MOST_VIEWS:
        views = [views[k] for k in np.linspace(0, len(views) - 1, MOST_VIEWS).astype(int)]
    return views


def _small(camera: Camera) -> Camera:
    width = camera.sensor.resolution[0]
    return replace(camera.resized(WIDTH) if width > WIDTH else camera, t_exp=1.0)


def _lit(scene: Scene, brightest: dict[str, Light], lamps: Sequence[str]) -> Scene:
    """The scene with these lamps as bright as they get, and the others off."""
    dark = (0.0, 0.0, 0.0)
    lights = tuple(
        replace(x, intensity=brightest[x.name].intensity if x.name in lamps else dark) for x in scene.lights
    )
    return replace(scene, lights=lights)


def _brightest(scene: Scene, camera: Camera, shown: Rendered) -> float:
    """1/s: of the highest DN over black, what the brightest part gathers in a second."""
    e = expected(shown.radiance(scene), camera)
    return max(float(np.percentile(e.dn, 99.5)) - e.black, 0.0) / (e.top - e.black)


def _exposure(rate: float) -> float:
    """s, that brings the brightest part to ``FULL``, if anyone can wait that long."""
    return _rounded(min(FULL / rate, LONGEST)) if rate > 0 else 1.0


def _rounded(seconds: float) -> float:
    return float(f"{seconds:.2g}")


def _existing(
    scenes: dict[float, Scene], camera: str, like: float, lamps: Sequence[str], whole: Scene
) -> float | None:
    """The scene's own time code with that view and those lamps on at full power."""
    full = {x.name: x.intensity for x in whole.lights}
    wanted = arrangement(scenes[like], scenes[like].camera(camera))
    for time, scene in scenes.items():
        lit = {x.name: x.intensity for x in scene.lights if x.is_on}
        alike = set(lit) == set(lamps) and all(np.allclose(lit[n], full[n]) for n in lamps)
        if alike and arrangement(scene, scene.camera(camera)) == wanted:
            return time
    return None


def _condition(scene: Scene, camera: Camera, shown: Rendered, candidate: Candidate) -> Condition:
    dn = expected(shown.radiance(scene), camera).dn
    capture = Capture(candidate.name, camera.name, candidate.like, camera.t_exp, dn)
    return Condition((capture,), scene, camera, dn, None, np.ones(dn.shape[:2], bool), False, shown)


def advice(pair: Pair) -> str:
    """The one more capture that would tell a pair apart."""
    return separating(pair.effect[0], pair.rival[0] if pair.rival else "")


def words(cause: Cause | None) -> str:
    if cause is None:
        return "nothing"
    name, target = cause
    place = target.split(" at ")[0].rsplit("/", 1)[-1]
    return f"{name.replace('_', ' ')} {place}".strip()

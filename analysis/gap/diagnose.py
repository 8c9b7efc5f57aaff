"""From captures and a scene to a diagnosis: where the simulation is wrong, what causes it, how far it shrinks."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.corrected.written import written
from analysis.gap.diagnosis import Diagnosis
from analysis.gap.evidence.caution import KNOWN
from analysis.gap.evidence.sureness import TEMPERATURE, cooled
from analysis.gap.finding import PRESENT
from analysis.gap.judgement.attribution import Told, attribution, claimed, errors_alone, waterfall
from analysis.gap.judgement.calling import confirmed, less_what_is_slight, no_worse
from analysis.gap.judgement.detectable import detectable
from analysis.gap.judgement.findings import beside_unknown, effects_found, noise_effect, what_is_unknown
from analysis.gap.judgement.rehearsing import rehearse
from analysis.gap.judgement.verdict import Simulations, verdict
from analysis.gap.judgement.verify import verified
from analysis.gap.judgement.where import edge_offsets, ledger_of
from analysis.gap.light.knots import Knots
from analysis.gap.light.radiance import Render, Rendered, render_all
from analysis.gap.light.reflections import Reflections
from analysis.gap.measures.ledger import temporal_scale
from analysis.gap.measures.metric import Measure, measured
from analysis.gap.measures.shape_left import shape_left
from analysis.gap.measures.shrinkage import yardstick
from analysis.gap.measures.structure import twin_off
from analysis.gap.noise.codes import without_flat_tops
from analysis.gap.noise.finding import NoiseFinding
from analysis.gap.noise.variance import WEIGHING, noise_findings, with_black_level, with_noise
from analysis.gap.notes import notes
from analysis.gap.parallel import one_thread
from analysis.gap.processed.beforehand import Beforehand, beforehand
from analysis.gap.search.anew import Anew, rendered_anew
from analysis.gap.search.fit import Fit, Redraw, fit
from analysis.gap.terms.lines import without_lines
from interchange.captures import Captures
from interchange.formats.document import Document


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A diagnosis and what it was made from, for a report."""

    diagnosis: Diagnosis
    conditions: tuple[Condition, ...]
    fit: Fit
    simulations: Simulations  # of the held-out conditions, in their order

    @property
    def held_out(self) -> tuple[Condition, ...]:
        return tuple(c for c in self.conditions if c.held_out)


@one_thread()
def diagnose(
    captures: Captures,
    document: Document,
    render: Render,
    settings: dict[str, Any],
    cache: Path,
    out: Path,
    told: Told = lambda what, share: None,
    verify: bool = False,
    metric: tuple[str, Measure] | None = None,
    rehearsals: int = 0,
    binning: int = 1,
) -> Diagnosed:
    """The diagnosis of ``captures``; the corrected scene is written to ``out``.

    ``render`` draws a scene as ``settings`` say (analysis.gap.light.radiance); ``cache``: where renderings are kept.
    ``told(what, share)`` hears how far each part is. ``verify`` renders the held-out captures anew from the written
    corrected scene (analysis.gap.judgement.verify). ``metric``: a name and a measure of images
    (analysis.gap.measures.metric.load).
    ``rehearsals``: cases simulated from the scene that probabilities are calibrated on
    (analysis.gap.judgement.rehearsing).
    ``binning``: pixels across that are taken as one (analysis.gap.processed.binned.times_binned: how many they ask
    for). Raises BrightfieldError where captures and scene do not belong together.
    """
    began = time.monotonic()

    def drawn(some: Sequence[Condition]) -> list[Rendered]:
        return render_all(
            [(c.scene, c.camera) for c in some],
            render,
            settings,
            cache,
            lambda k, n: told("rendering", k / n),
        )

    first = beforehand(captures, document, binning, drawn)
    whole, tolerances = first.conditions, first.captures.tolerances
    evened, lines = without_lines(without_flat_tops(whole))  # a flat top would be taken for a response curve
    reflections = Reflections(render, settings, cache) if settings.get("indirect") else None
    knots = Knots(cache, reflections=reflections)  # asked for as long as the fit is used

    as_rendered = {c.name: c.shown for c in evened}

    def redraw(some: Sequence[Condition], anew: Anew) -> list[Condition]:
        return rendered_anew(
            some, as_rendered, anew, render, settings, cache, lambda share: told("rendering anew", share)
        )

    scale = temporal_scale(evened) or 1.0
    there = _fitted(first, evened, scale, knots, redraw, told)
    all_of_them, judged = there.conditions, there.judged
    off = twin_off(tolerances)
    v = verdict(there.fit, all_of_them, there.corrected, judged, scale, off)
    fitted, held = v.fitted, [c for c in all_of_them if c.held_out]
    told("shares", 0.0)
    taken = attribution(fitted, held, v.by, v.shown.before, v.after, v.maps, told)
    v, known = first.known(v, held)
    shrunk = v.gap
    findings = first.with_known(effects_found(fitted, taken, shrunk), known, v)
    noise = [n for n in judged if n.probability >= PRESENT and n.name not in taken.players]
    findings += [noise_effect(n, taken, shrunk) for n in noise]
    left_at = (
        shape_left(all_of_them, v.corrected) if max(fitted.left_over[1], v.structured) >= PRESENT else ""
    )
    unknown = what_is_unknown(fitted, left_at, (v.times, v.structured), off)
    rehearsal = None
    if rehearsals:
        fitted_to = [c for c in whole if not c.held_out]
        rng = np.random.default_rng(0)
        rehearsal = rehearse(fitted_to, tolerances, fitted, knots, rehearsals, rng, told)
    sureness = partial(cooled, temperature=max(TEMPERATURE, rehearsal.temperature if rehearsal else 1.0))
    of_noise = {n.name for n in noise}  # which is judged by other figures
    findings = [
        f if f.name in of_noise else replace(f, probability=sureness(f.probability)) for f in findings
    ]
    findings.sort(key=lambda f: (-f.probability, -f.share))
    unknown = tuple((words, sureness(p)) for words, p in unknown)
    told("where", 0.0)
    where = ledger_of(all_of_them, fitted, v.corrected)
    scene_file = out / f"{captures.scene.stem}_corrected.usda"
    mapped = v.maps is not None
    left = written(
        document,
        first.captures,
        all_of_them,
        fitted,
        findings,
        noise,
        mapped,
        first.scene,
        scene_file,
        first.by,
    )
    check = None
    if verify and findings:
        lacks = [f.name for f in findings if f.name in left]
        claim = claimed(fitted, held, v.by, taken, frozenset({f.name for f in findings} - set(lacks)))
        errors = errors_alone(fitted)
        check = verified(
            scene_file, held, errors, v.by, claim, lacks, render, settings, cache, told, first.document
        )
    told_of = notes(
        all_of_them, fitted, where, judged, there.forged, left, lines, first.encodings, first.mixed
    )
    if check is not None and check.sentence:
        told_of.insert(0, check.sentence)
    findings, edges = first.of_own_pixels(findings, edge_offsets(held, v.by, v.shown))
    told_of += first.notes
    diagnosis = Diagnosis(
        effects=tuple(findings),
        unknown=unknown,
        gap=shrunk,
        where=where,
        corrected_scene=scene_file.name,
        seconds=time.monotonic() - began,
        notes=tuple(told_of),
        waterfall=waterfall(shrunk, taken, {k.name: k.taken_off for k in known}),
        edges=edges,
        metric=measured(*metric, held, v.shown.as_written, v.shown.before, v.shown.after) if metric else None,
        verification=check,
        smallest=detectable(fitted.evidence, fitted.declared, fitted.severity),
        over_declared=fitted.factors,
        rehearsal=rehearsal,
        left=v.left,
    )
    return Diagnosed(diagnosis, tuple(all_of_them), fitted, v.shown)


@dataclass(frozen=True, eq=False)
class _Fitted:
    """``corrected``: (H, W, C) DN of each condition; ``judged``: effects of noise, ``forged`` those that were taken
    back."""

    conditions: tuple[Condition, ...]
    fit: Fit
    corrected: list[np.ndarray]
    judged: list[NoiseFinding]
    forged: list[NoiseFinding] = field(default_factory=list)


def _fitted(
    first: Beforehand, evened: list[Condition], scale: float, knots: Knots, redraw: Redraw, told: Told
) -> _Fitted:
    """The fit, and once more where captures have another noise than the sensor's model says: weighed by the data sheet,
    that would be taken for what has no name."""

    def stood(some: Sequence[Condition]) -> _Fitted:
        fitted = fit([c for c in some if not c.held_out], first.captures.tolerances, told, knots, redraw)
        there = redraw(some, fitted.anew) if fitted.anew.is_there else list(some)
        told("verdict", 0.0)
        fitted = less_what_is_slight(no_worse([c for c in there if not c.held_out], fitted))
        held = [c for c in there if c.held_out]
        fitted = confirmed(fitted, held, yardstick(held, fitted.after.simulations(held), scale))
        told("noise", 0.0)
        corrected = fitted.after.simulations(there)
        return _Fitted(tuple(there), fitted, corrected, _noise(fitted, first.conditions, corrected))

    once = stood(evened)
    shown_of_noise = with_noise(evened, once.corrected, once.judged)
    if shown_of_noise is evened:
        return once
    again = stood(shown_of_noise)
    if is_noise_of(again.fit, once.fit):
        return again
    forged = [n for n in once.judged if n.name in WEIGHING and n.probability >= PRESENT]
    return replace(once, judged=[n for n in once.judged if n.name not in WEIGHING], forged=forged)


def is_noise_of(weighed: Fit, before: Fit) -> bool:
    """Whether captures that are ``weighed`` by a noise leave what it says, no worse than ``before``: a black level that
    is told wrong forges a noise that they do not have."""
    return abs(weighed.left_over[0]) <= max(abs(before.left_over[0]), KNOWN)


def _noise(fitted: Fit, whole: Sequence[Condition], corrected: Sequence[np.ndarray]) -> list[NoiseFinding]:
    """Effects that do not move the mean image, each as probable as it is beside what was fitted."""
    black: dict[str, float] = {}
    for t, x in zip(fitted.terms, fitted.after.theta, strict=True):
        if (t.cause, t.parameter) == ("black_level", "black_level"):
            for name in [t.camera] if t.camera else {c.camera.name for c in whole}:
                black[name] = black.get(name, 0.0) + float(x)
    found = noise_findings(with_black_level(whole, black), corrected, black)
    return [beside_unknown(n, fitted, whole[0].camera.sensor) for n in found]

"""From captures and a scene to a diagnosis: where the simulation is wrong, what causes it, how far it shrinks."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from analysis.gap.anew import Anew, rendered_anew
from analysis.gap.attribution import (
    Told,
    attribution,
    claimed,
    waterfall,
    without,
)
from analysis.gap.binned import binned_captures, binning_of
from analysis.gap.calling import confirmed, less_what_is_slight, no_worse
from analysis.gap.caution import KNOWN
from analysis.gap.code_findings import with_steps, without_flat_tops
from analysis.gap.conditions import Condition, conditions, must_fit
from analysis.gap.detectable import detectable
from analysis.gap.diagnosis import PRESENT, Diagnosis, Edges, Estimate
from analysis.gap.edges import offsets
from analysis.gap.encoded import GROUNDS, as_encoded, encoded, is_linear, on_scene
from analysis.gap.evidence import Evidence
from analysis.gap.findings import (
    CROSSTALK,
    CURVE,
    SCREEN,
    Known,
    beside_unknown,
    effects_found,
    noise_effect,
    what_is_unknown,
    with_known,
)
from analysis.gap.fit import Fit, fit
from analysis.gap.knots import Knots
from analysis.gap.ledger import Ledger, fixed_to, ledger, temporal_scale
from analysis.gap.lines import without_lines
from analysis.gap.matrices import GROUNDS as MIXED
from analysis.gap.matrices import as_mixed, matrices, numbers, unmixed, with_matrices, without_declared
from analysis.gap.metric import Measure, measured
from analysis.gap.model import Model
from analysis.gap.mosaics import must_say_its_mosaic
from analysis.gap.noise import WEIGHING, noise_findings, with_black_level, with_noise
from analysis.gap.noise_finding import NoiseFinding
from analysis.gap.normal_equations import NormalEquations, equations, stride_for, total_of
from analysis.gap.notes import notes
from analysis.gap.overlap import must_overlap, with_files_bits
from analysis.gap.own_pixels import edges_of_own_pixels, of_own_pixels
from analysis.gap.own_pixels import notes as notes_on_pixels
from analysis.gap.parallel import each, one_thread
from analysis.gap.radiance import Render, render_all
from analysis.gap.rehearsing import rehearse
from analysis.gap.shape_left import shape_left
from analysis.gap.shrinkage import Yardstick, yardstick
from analysis.gap.structure import twin_off
from analysis.gap.sureness import TEMPERATURE, cooled
from analysis.gap.terms import Term
from analysis.gap.verdict import Simulations, against, verdict
from analysis.gap.verify import verified
from analysis.gap.written import written
from interchange.captures import Captures
from interchange.formats.document import Document
from interchange.scene import Scene


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

    ``render`` draws a scene as ``settings`` say (analysis.gap.radiance); ``cache``: where renderings are kept.
    ``told(what, share)`` hears how far each part is. ``verify`` renders the held-out captures anew from the written
    corrected scene (analysis.gap.verify). ``metric``: a name and a measure of images (analysis.gap.metric.load).
    ``rehearsals``: cases simulated from the scene that probabilities are calibrated on (analysis.gap.rehearsing).
    ``binning``: pixels across that are taken as one (analysis.gap.binned.times_binned: how many they ask for).
    Raises BrightfieldError where captures and scene do not belong together.
    """
    began = time.monotonic()
    as_written = document
    must_fit(captures, document)
    captures, document = without_declared(captures, document)
    of_all_pixels, unbinned = captures, document
    must_say_its_mosaic(captures, document.scene())
    by = binning_of(captures, document, binning)
    if by.n > 1:
        captures, document = binned_captures(captures, document, by), by.document(document)
    found = with_steps(with_files_bits(conditions(captures, document)))
    rendered = render_all(
        [(c.scene, c.camera) for c in found], render, settings, cache, lambda k, n: told("rendering", k / n)
    )
    whole = [replace(c, rendered=r) for c, r in zip(found, rendered, strict=True)]
    must_overlap(whole)
    screens = encoded(whole)
    linear = {c.camera.name for c in whole if is_linear(c.camera.sensor)}
    taken_as = as_encoded(whole, screens)
    mixed = matrices([c for c in taken_as if c.camera.name in linear])
    if mixed:
        pure = unmixed(of_all_pixels, {c.camera.name: c.camera for c in taken_as}, mixed)
        captures = binned_captures(pure, unbinned, by) if by.n > 1 else pure
        found = with_steps(with_files_bits(conditions(captures, document)))
        whole = [replace(c, rendered=r) for c, r in zip(found, rendered, strict=True)]
    whole, as_said = as_encoded(whole, screens), {c.name: c.camera for c in whole}
    evened, lines = without_lines(without_flat_tops(whole))  # a flat top would be taken for a response curve
    knots = Knots(cache)  # what effects of the scene change is asked for as long as the fit is used

    as_rendered = {c.name: c.shown for c in evened}

    def redraw(some: Sequence[Condition], anew: Anew) -> list[Condition]:
        return rendered_anew(
            some, as_rendered, anew, render, settings, cache, lambda share: told("rendering anew", share)
        )

    def stood(
        some: Sequence[Condition],
    ) -> tuple[list[Condition], Fit, list[np.ndarray], list[NoiseFinding]]:
        fitted = fit([c for c in some if not c.held_out], captures.tolerances, told, knots, redraw)
        there = redraw(some, fitted.anew) if fitted.anew.is_there else list(some)
        told("verdict", 0.0)
        fitted = less_what_is_slight(no_worse([c for c in there if not c.held_out], fitted))
        held = [c for c in there if c.held_out]
        fitted = confirmed(fitted, held, yardstick(held, fitted.after.simulations(held), scale))
        told("noise", 0.0)
        corrected = fitted.after.simulations(there)
        return there, fitted, corrected, _noise(fitted, whole, corrected)

    scale = temporal_scale(evened) or 1.0
    all_of_them, fitted, corrected, judged = stood(evened)
    shown_of_noise = with_noise(evened, corrected, judged)
    forged: list[NoiseFinding] = []
    if shown_of_noise is not evened:  # weighed by the data sheet, it would be taken for what has no name
        anew = stood(shown_of_noise)
        if is_noise_of(anew[1], fitted):
            all_of_them, fitted, corrected, judged = anew
        else:
            forged = [n for n in judged if n.name in WEIGHING and n.probability >= PRESENT]
            judged = [n for n in judged if n.name not in WEIGHING]
    off = twin_off(captures.tolerances)
    v = verdict(fitted, all_of_them, corrected, judged, scale, off)
    fitted, held, shrunk = v.fitted, [c for c in all_of_them if c.held_out], v.gap
    told("shares", 0.0)
    taken = attribution(fitted, held, v.by, v.shown.before, v.after, v.maps, told)
    known: list[Known] = []  # the file says nothing of them, so they are its to close
    if mixed:
        v = against(v, [as_mixed(c, dn, mixed) for c, dn in zip(held, v.shown.before, strict=True)])
        closed, only = v.gap.before**2 - shrunk.before**2, _alone([m.camera for m in mixed], whole)
        known.append(Known(CROSSTALK, {}, MIXED, closed, only))
    if screens:
        least, curved = v.gap.before**2, {s.camera for s in screens}
        as_it_is = [replace(c, camera=as_said[c.name]).simulated().dn for c in held]
        v = against(
            v,
            [
                dn if c.camera.name in curved else as_mixed(c, dn, mixed)
                for c, dn in zip(held, as_it_is, strict=True)
            ],
        )
        curve, closed = {SCREEN: Estimate(1.0, 0.0, "1")}, v.gap.before**2 - least
        known.append(Known(CURVE, curve, GROUNDS, closed, _alone(sorted(curved), whole)))
    shrunk = v.gap
    findings = effects_found(fitted, taken, shrunk)
    for k in known:
        if k.name == CROSSTALK:  # with what the fit adds to it
            found_too = next((f.parameters for f in findings if f.name == CROSSTALK), {})
            k = replace(k, parameters=numbers(mixed, found_too))
        findings = with_known(findings, k, shrunk)
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
        rehearsal = rehearse(fitted_to, captures.tolerances, fitted, knots, rehearsals, rng, told)
    sureness = partial(cooled, temperature=max(TEMPERATURE, rehearsal.temperature if rehearsal else 1.0))
    of_noise = {n.name for n in noise}  # which is judged by other figures
    findings = [
        f if f.name in of_noise else replace(f, probability=sureness(f.probability)) for f in findings
    ]
    findings.sort(key=lambda f: (-f.probability, -f.share))
    unknown = tuple((words, sureness(p)) for words, p in unknown)
    told("where", 0.0)
    where = _ledger(all_of_them, fitted, v.corrected)
    scene_file = out / f"{captures.scene.stem}_corrected.usda"
    mapped = v.maps is not None

    def before_the_fit(scene: Scene) -> Scene:
        return with_matrices(on_scene(by.on_scene(scene), screens), mixed)

    left = written(
        as_written, captures, all_of_them, fitted, findings, noise, mapped, before_the_fit, scene_file, by
    )
    check = None
    if verify and findings:
        lacks = [f.name for f in findings if f.name in left]
        claim = claimed(fitted, held, v.by, taken, frozenset({f.name for f in findings} - set(lacks)))
        errors = without(fitted, fitted.best.causes)
        check = verified(
            scene_file, held, errors, v.by, claim, lacks, render, settings, cache, told, by.document
        )
    told_of = notes(all_of_them, fitted, where, judged, forged, left, lines, screens, mixed)
    if check is not None and check.sentence:
        told_of.insert(0, check.sentence)
    edges = _edges(held, v.by, v.shown)
    if by.n > 1:
        findings = [of_own_pixels(f, by) for f in findings]
        edges = edges and edges_of_own_pixels(edges, by)
    told_of += notes_on_pixels(of_all_pixels, by)
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


def _alone(own: Sequence[str], found: Sequence[Condition]) -> tuple[str, ...]:
    """The cameras that have something, where others have not."""
    return tuple(own) if {c.camera.name for c in found} - set(own) else ()


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


def _edges(held: Sequence[Condition], by: Yardstick, shown: Simulations) -> Edges | None:
    regions, noise = [], []
    for c in held:
        ids = c.shown.passes
        regions.append(ids["object_id"].astype(np.int64) * 100000 + ids["material_id"])
        model = c.simulated()
        variance = (model.temporal / len(c.captures) + model.fixed).sum(axis=2)
        noise.append(np.sqrt(variance) / model.dn.shape[2])
    found = offsets(
        [c.mean for c in held],
        [shown.as_written, shown.before, shown.after],
        regions,
        [ok.any(axis=2) for ok in by.ok],
        noise,
    )
    return Edges(*found) if found else None


def _ledger(found: Sequence[Condition], fitted: Fit, after: Sequence[np.ndarray]) -> Ledger:
    before = fitted.before.simulations(found)
    families = {
        "the image": ("fixed to the image, multiplicative", "fixed to the image, additive", "exposure"),
        "the surface": ("fixed to the surface", "albedo"),
        "the lamp": ("fixed to the lamp", "light_intensity"),
    }
    index: dict[str, list[int]] = {}
    own: list[Term] = []
    for name, causes in families.items():
        chosen = [t for t in fitted.terms if t.cause in causes]
        index[name] = list(range(len(own), len(own) + len(chosen)))
        own += chosen
    zero, stride = np.zeros(len(own)), stride_for(found)
    model = Model(tuple(own), zero, zero)

    def part(both: tuple[Condition, np.ndarray]) -> NormalEquations | None:
        c, dn = both
        left = replace(c, mean=c.mean - dn + c.simulated().dn)  # what is to be told apart is before's gap
        state = model.state(left, stride)
        return equations(state, own, zero) if state.usable.any() else None

    fitted_to = [(c, dn) for c, dn in zip(found, before, strict=True) if not c.held_out]
    total = total_of([p for p in each(part, fitted_to) if p is not None])
    evidence = Evidence(total, own)
    seen = {name: np.array([i for i in places if evidence.seen[i]], int) for name, places in index.items()}
    fixed = fixed_to(seen, total.G, total.b, total.rr, evidence.spike)
    return ledger(found, before, after, fixed)

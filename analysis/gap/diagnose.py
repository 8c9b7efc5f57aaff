"""From captures and a scene to a diagnosis: where the simulation is wrong, what causes it, how far it shrinks."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from analysis.gap import aperture
from analysis.gap.attribution import (
    CATALOGUED,
    PATTERN,
    Cause,
    Told,
    attribution,
    claimed,
    waterfall,
    without,
)
from analysis.gap.calling import confirmed, no_worse
from analysis.gap.chain_terms import signed
from analysis.gap.code_findings import with_steps, without_flat_tops
from analysis.gap.conditions import Condition, conditions, with_renderings
from analysis.gap.corrected import Change, write_corrected
from analysis.gap.detectable import detectable
from analysis.gap.diagnosis import PRESENT, Diagnosis, Edges
from analysis.gap.edges import offsets
from analysis.gap.evidence import Evidence
from analysis.gap.findings import (
    beside_unknown,
    cautious,
    effects_found,
    noise_effect,
    what_is_unknown,
)
from analysis.gap.fit import Fit, fit
from analysis.gap.knots import Knots
from analysis.gap.ledger import Ledger, fixed_to, ledger, temporal_scale
from analysis.gap.lines import without_lines
from analysis.gap.metric import Measure, measured
from analysis.gap.model import Model
from analysis.gap.noise import noise_findings, with_black_level, with_noise
from analysis.gap.noise_finding import NoiseFinding
from analysis.gap.normal_equations import NormalEquations, equations, stride_for, total_of
from analysis.gap.overlap import must_overlap, notes_on_files, shifts, with_files_bits
from analysis.gap.parallel import each
from analysis.gap.radiance import Changes, Render, render_all
from analysis.gap.redrawn import redrawn
from analysis.gap.rehearsing import rehearse
from analysis.gap.scales import UNDECLARED
from analysis.gap.shape_left import shape_left
from analysis.gap.shrinkage import Yardstick, yardstick
from analysis.gap.terms import Term
from analysis.gap.verdict import Simulations, verdict
from analysis.gap.verify import verified
from interchange.captures import Captures
from interchange.effects.parts import called
from interchange.formats.document import Document

SLIGHTLY = 1.5  # times a tolerance that nobody need look after
WRITTEN = (
    "sensor_noise",
    "fixed_pattern",
    "saturation",
    "jpeg",
)  # effects without a mean that a scene file can say


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


@contextmanager
def _one_thread() -> Iterator[None]:
    """Matrices are small: threads would wait for each other."""
    with threadpool_limits(1, "blas"):
        yield


@_one_thread()
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
) -> Diagnosed:
    """The diagnosis of ``captures``; the corrected scene is written to ``out``.

    ``render`` draws a scene as ``settings`` say (analysis.gap.radiance); ``cache``: where renderings are kept.
    ``told(what, share)`` hears how far each part is. ``verify`` renders the held-out captures anew from the written
    corrected scene (analysis.gap.verify). ``metric``: a name and a measure of images (analysis.gap.metric.load).
    ``rehearsals``: cases simulated from the scene that probabilities are calibrated on (analysis.gap.rehearsing).
    Raises BrightfieldError where captures and scene do not belong together.
    """
    began = time.monotonic()
    found = with_steps(with_files_bits(conditions(captures, document)))
    rendered = render_all(
        [(c.scene, c.camera) for c in found], render, settings, cache, lambda k, n: told("rendering", k / n)
    )
    whole = [replace(c, rendered=r) for c, r in zip(found, rendered, strict=True)]
    must_overlap(whole)
    evened, lines = without_lines(without_flat_tops(whole))  # a flat top would be taken for a response curve
    knots = Knots(cache)  # what effects of the scene change is asked for as long as the fit is used

    def redraw(some: Sequence[Condition], standing: Changes) -> list[Condition]:
        bases = {id(c.shown): c.shown for c in evened}
        there = {}
        for k, (key, base) in enumerate(bases.items()):
            told("rendering anew", k / len(bases))
            there[key] = redrawn(base, standing, render, settings, cache)
        return with_renderings(some, {c.name: there[id(c.shown)] for c in evened}, standing)

    def stood(
        some: Sequence[Condition],
    ) -> tuple[list[Condition], Fit, list[np.ndarray], list[NoiseFinding]]:
        fitted = fit([c for c in some if not c.held_out], captures.tolerances, told, knots, redraw)
        there = redraw(some, fitted.redrawn) if fitted.redrawn else list(some)
        told("verdict", 0.0)
        fitted = no_worse([c for c in there if not c.held_out], fitted)
        held = [c for c in there if c.held_out]
        fitted = confirmed(fitted, held, yardstick(held, each(fitted.after.simulated, held), scale))
        told("noise", 0.0)
        corrected = each(fitted.after.simulated, there)
        return there, fitted, corrected, _noise(fitted, whole, corrected)

    scale = temporal_scale(evened) or 1.0
    all_of_them, fitted, corrected, judged = stood(evened)
    shown_of_noise = with_noise(evened, corrected, judged)
    if shown_of_noise is not evened:  # weighed by the data sheet, it would be taken for what has no name
        all_of_them, fitted, corrected, judged = stood(shown_of_noise)
    v = verdict(fitted, all_of_them, corrected, judged, scale)
    fitted, held, shrunk = v.fitted, [c for c in all_of_them if c.held_out], v.gap
    told("shares", 0.0)
    taken = attribution(fitted, held, v.by, v.shown.before, v.after, v.maps, told)
    findings = effects_found(fitted, taken, shrunk)
    noise = [n for n in judged if n.probability >= PRESENT and n.name not in taken.players]
    findings += [noise_effect(n, taken, shrunk) for n in noise]
    findings.sort(key=lambda f: (-f.probability, -f.share))
    left_at = (
        shape_left(all_of_them, v.corrected) if max(fitted.left_over[1], v.structured) >= PRESENT else ""
    )
    unknown = what_is_unknown(fitted, left_at, (v.times, v.structured))
    rehearsal = None
    if rehearsals:
        written = [c for c in whole if not c.held_out]
        rng = np.random.default_rng(0)
        rehearsal = rehearse(written, captures.tolerances, fitted, knots, rehearsals, rng, told)
        of_noise = {n.name for n in noise}  # which is judged by other figures
        findings = [
            f if f.name in of_noise else replace(f, probability=rehearsal.calibrated(f.probability))
            for f in findings
        ]
        unknown = tuple((words, rehearsal.calibrated(p)) for words, p in unknown)
    told("where", 0.0)
    where = _ledger(all_of_them, fitted, v.corrected)
    scene_file = out / f"{captures.scene.stem}_corrected.usda"
    changes = [
        *_changes(fitted, {f.name for f in findings}),
        *(_noise_change(n) for n in noise if n.name in WRITTEN),
    ]
    left = write_corrected(document, captures, changes, scene_file)
    left |= {
        f.name: "Its pattern in places is in no scene file."
        for f in findings
        if "rms in places" in f.parameters
    }
    if v.maps:
        left[PATTERN] = "Which pixels are off by how much is in no scene file, only the rms of it."
    left |= {n.name: "It is no number of the sensor's model." for n in noise if n.name not in WRITTEN}
    left |= {f.name: "Render it with paths (--render offline)." for f in findings if "added" in f.parameters}
    check = None
    if verify and findings:
        carried = frozenset({f.name for f in findings} - set(left))
        claim = claimed(fitted, held, v.by, taken, carried)
        errors = without(fitted, fitted.best.causes)
        check = verified(scene_file, held, errors, v.by, claim, render, settings, cache, told)
    tried = {t.cause for t in fitted.terms} | {n.name for n in judged}
    notes = [
        *_refuted(fitted),
        *cautious(fitted),
        *_wider(fitted),
        *_apertures(fitted),
        *(str(x) for x in lines),
        *_notes(all_of_them, where, tried, left),
    ]
    if check is not None and check.sentence:
        notes.insert(0, check.sentence)
    diagnosis = Diagnosis(
        effects=tuple(findings),
        unknown=unknown,
        gap=shrunk,
        where=where,
        corrected_scene=scene_file.name,
        seconds=time.monotonic() - began,
        notes=tuple(notes),
        waterfall=waterfall(shrunk, taken),
        edges=_edges(held, v.by, v.shown),
        metric=measured(*metric, held, v.shown.as_written, v.shown.before, v.shown.after) if metric else None,
        verification=check,
        smallest=detectable(fitted.evidence, fitted.declared),
        over_declared=fitted.factors,
        rehearsal=rehearsal,
        left=v.left,
    )
    return Diagnosed(diagnosis, tuple(all_of_them), fitted, v.shown)


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


def _changes(fitted: Fit, names: set[str]) -> list[Change]:
    """What the findings change in the scene: a value a parameter, by effect and by what it is about."""
    found: dict[Cause, dict[str, tuple[float, float]]] = {}
    told_at: dict[Cause, float] = {}
    for term, theta in zip(fitted.terms, fitted.after.theta, strict=True):
        if term.cause in names and term.candidate in fitted.best.causes and term.family is None:
            pair = (term.value(float(theta)), term.value(0.0))
            found.setdefault(term.candidate, {})[term.parameter] = pair
            told_at[term.candidate] = max(told_at.get(term.candidate, 0.0), term.t_exp)
    changes = []
    for (name, target), values in found.items():
        new, old = (signed({n: pair[k] for n, pair in values.items()}) for k in (0, 1))
        changes.append(Change(name, target, new, old, told_at[name, target]))
    return changes


def _noise_change(noise: NoiseFinding) -> Change:
    """Its numbers stand for those of the sensor's data sheet."""
    return Change(noise.name, "", {n: x.value for n, x in noise.parameters.items()}, None)


def _ledger(found: Sequence[Condition], fitted: Fit, after: Sequence[np.ndarray]) -> Ledger:
    before = each(fitted.before.simulated, found)
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


def _refuted(fitted: Fit) -> list[str]:
    return [
        f"The captures that were fitted to speak for {name.replace('_', ' ')}{of}; those held out are simulated better "
        f"without it, so it is taken back."
        for name, of in ((n, f" of {called(target)}" if target else "") for n, target in fitted.refuted)
    ]


def _apertures(fitted: Fit) -> list[str]:
    v = aperture.variance(fitted.terms, fitted.after.theta)
    if not aperture.may_be_one(fitted.best.causes, v):
        return []
    return [
        f"A blur of {v**0.5:.2g} px is as small as that of pixels whose aperture is no square, and captures do not "
        f"tell the two apart: {aperture.TELLING} does."
    ]


def _wider(fitted: Fit) -> list[str]:
    notes = []
    for name, factor in fitted.factors.items():
        if factor > SLIGHTLY:
            of, than = (name, "expected") if name in UNDECLARED else (f"errors of {name}", "declared")
            notes.append(
                f"{of[0].upper()}{of[1:]} look {factor:g} times as large as {than}, and are taken so: check the "
                f"calibration. Effects below that are not found."
            )
    return notes


def _notes(found: Sequence[Condition], where: Ledger, tried: set[str], left: dict[str, str]) -> list[str]:
    notes = []
    if not where.measured:
        notes.append("No captures are repeats: the noise floor is the sensor model's, not measured.")
    notes += notes_on_files(found)
    notes += [
        f"The captures of {name} lie {px:.1f} px off their simulation as a whole, which is more than registration "
        f"follows well: calibrate the camera anew, or take the figures as those of a wrong pose."
        for name, px in shifts(found).items()
    ]
    if len(found) < 6:
        notes.append(
            f"{len(found)} conditions are few: six or more, under two lamps and two poses, tell effects apart."
        )
    if any(c.shown.undrawn for c in found):
        notes.append(
            "The renderer draws direct light alone; what surfaces give each other was traced by paths, and is "
            "interreflection where the captures show it."
        )
    elif not any(c.shown.indirect for c in found):
        notes.append(
            "The simulation has direct light alone: interreflection is not among the causes that were tried."
        )
    for name, reason in left.items():
        notes.append(f"The corrected scene does not carry {name.replace('_', ' ')}: {reason}")
    missing = sorted(n.replace("_", " ") for n in CATALOGUED - tried)
    if missing:
        notes.append(f"Not tried with these captures and this renderer: {', '.join(missing)}.")
    return notes

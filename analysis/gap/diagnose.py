"""From captures and a scene to a diagnosis: where the simulation is wrong, what causes it, how far it shrinks."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from analysis.gap.advice import separating
from analysis.gap.conditions import Condition, conditions
from analysis.gap.corrected import write_corrected
from analysis.gap.diagnosis import STAGES, Diagnosis, Estimate, Finding
from analysis.gap.fit import Fit, Model, fit, uncertainty
from analysis.gap.ledger import Ledger, fixed_to, ledger, temporal_scale
from analysis.gap.noise import NoiseFit, noise_fit
from analysis.gap.normal_equations import equations, stride_for
from analysis.gap.radiance import Render, render_all
from analysis.gap.shrinkage import gap
from interchange.captures import Captures
from interchange.effects import Effect
from interchange.formats.document import Document
from interchange.problems import BrightfieldError

CATALOGUED = {name for names in STAGES.values() for name in names}
PRESENT = 0.5
OVERLAP = 0.2  # least correlation of captures and simulation that a diagnosis can start from

Told = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A diagnosis and what it was made from, for a report."""

    diagnosis: Diagnosis
    conditions: tuple[Condition, ...]
    fit: Fit


def diagnose(
    captures: Captures,
    document: Document,
    render: Render,
    settings: dict[str, Any],
    cache: Path,
    out: Path,
    told: Told = lambda what, share: None,
) -> Diagnosed:
    """The diagnosis of ``captures``; the corrected scene is written to ``out``.

    ``render`` draws a scene as ``settings`` say (analysis.gap.radiance); ``cache``: where renderings are kept. Raises
    BrightfieldError where captures and scene do not belong together.
    """
    began = time.monotonic()
    found = conditions(captures, document)
    rendered = render_all(
        [(c.scene, c.camera) for c in found], render, settings, cache, lambda k, n: told("rendering", k / n)
    )
    all_of_them = [replace(c, rendered=r) for c, r in zip(found, rendered, strict=True)]
    _must_overlap(all_of_them)
    with threadpool_limits(1, "blas"):  # matrices are small; threads would wait for each other
        fitted = fit([c for c in all_of_them if not c.held_out], captures.tolerances, told)
    told("verdict", 0.0)
    held = [c for c in all_of_them if c.held_out]
    scale = temporal_scale(all_of_them) or 1.0
    rng = np.random.default_rng(0)
    shrunk = gap(held, fitted.before, fitted.after, scale, rng)
    findings = _findings(fitted, held, scale, shrunk.before, shrunk.after)
    noise = noise_fit(all_of_them)
    if noise is not None and noise.probability >= PRESENT:
        findings.append(_noise_finding(noise, shrunk.after))
    findings.sort(key=lambda f: -f.probability)
    unknown = _unknown(fitted)
    told("where", 0.0)
    where = _ledger(all_of_them, fitted)
    scene_file = out / f"{captures.scene.stem}_corrected.usda"
    effects = [e for e in _effects(fitted, all_of_them[0]) if e.name() in {f.name for f in findings}]
    left = write_corrected(document, all_of_them[0].scene, effects, findings, scene_file)
    notes = _notes(captures, all_of_them, where, fitted, left)
    spent = time.monotonic() - began
    diagnosis = Diagnosis(tuple(findings), unknown, shrunk, where, scene_file.name, spent, tuple(notes))
    return Diagnosed(diagnosis, tuple(all_of_them), fitted)


def _must_overlap(found: Sequence[Condition]) -> None:
    lit = [c for c in found if c.lamps]
    if not lit:
        return
    correlations = []
    for c in lit:
        simulated = c.simulated()
        ok = c.mask
        a, b = c.mean.mean(axis=2)[ok], simulated.dn.mean(axis=2)[ok]
        if a.std() > 0 and b.std() > 0:
            correlations.append(float(np.corrcoef(a, b)[0, 1]))
    if correlations and max(correlations) < OVERLAP:
        raise BrightfieldError(
            f"The captures must show what the scene shows; the best of them correlates with its simulation by "
            f"{max(correlations):.2f}. Check the cameras' poses, or the order of the images. "
            f"({found[0].captures[0].where.file})"
        )


def _effects(fitted: Fit, condition: Condition) -> list[Effect]:
    """The chain's effects at the best estimate."""
    return Model(fitted.terms, fitted.after.theta, fitted.after.theta).effects(condition)


def _findings(
    fitted: Fit, held: Sequence[Condition], scale: float, before: float, after: float
) -> list[Finding]:
    best, sigma = fitted.best, uncertainty(fitted)
    named = [c for c in best.causes if c[0] in CATALOGUED and fitted.probability.get(c, 0) >= PRESENT]
    out = []
    for name in dict.fromkeys(c[0] for c in named):
        own = [c for c in named if c[0] == name]
        index = [i for c in own for i in fitted.evidence.members[c]]
        estimates = {}
        for i in index:
            term = fitted.terms[i]
            value = term.value(float(best.theta[i]))
            width = float(sigma[i])
            if term.power == 2:
                width = width / max(2 * np.sqrt(max(float(best.theta[i]), 0.0)), np.sqrt(width))
            target = term.target.rsplit("/", 1)[-1]
            estimates[f"{target} {term.parameter}".strip()] = Estimate(value, width, term.unit)
        rivals = _rivals(fitted, own)
        without = after
        if len(best.causes) == len(own):
            without = before
        else:
            theta, at = best.theta.copy(), fitted.after.at.copy()
            theta[index], at[index] = 0.0, 0.0
            without = gap(
                held, Model(fitted.terms, theta, at), fitted.after, scale, np.random.default_rng(0)
            ).before
        separate = separating(name, rivals[0][0]) if rivals and rivals[0][1] > 0.1 else None
        probability = min(max(fitted.probability[c] for c in own), 0.999)
        out.append(Finding(name, probability, estimates, rivals, separate, without, after))
    return out


def _rivals(fitted: Fit, own: Sequence[tuple[str, str]]) -> tuple[tuple[str, float], ...]:
    """What else could stand in these causes' place, and how probable that is."""
    rest = set(fitted.best.causes) - set(own)
    chances: dict[str, float] = {}
    for cause, p in fitted.probability.items():
        if cause not in fitted.best.causes and cause[0] in CATALOGUED:
            with_own = sum(
                np.exp(h.score - fitted.best.score)
                for h in fitted.hypotheses
                if cause in h.causes and rest <= set(h.causes) and not set(own) & set(h.causes)
            )
            if with_own > 1e-3:
                chances[cause[0]] = chances.get(cause[0], 0.0) + min(float(with_own), p)
    return tuple(sorted(chances.items(), key=lambda x: -x[1])[:3])


def _noise_finding(noise: NoiseFit, chi: float) -> Finding:
    value = Estimate(noise.read_noise, noise.read_noise_sigma, "e-")
    return Finding("sensor_noise", noise.probability, {"read_noise": value}, (), None, chi, chi)


def _unknown(fitted: Fit) -> tuple[tuple[str, float], ...]:
    """Generic families that the evidence asks for, described by where their largest part lies."""
    out = []
    for cause in fitted.best.causes:
        p = fitted.probability.get(cause, 0.0)
        if cause[0] in CATALOGUED or p < PRESENT:
            continue
        index = fitted.evidence.members[cause]
        theta = fitted.best.theta[index]
        sub = fitted.evidence.e.G[np.ix_(index, index)]
        rms = float(np.sqrt(max(theta @ sub @ theta, 0) / fitted.evidence.e.signal))
        words = cause[0] + (f" {cause[1].rsplit('/', 1)[-1]}" if cause[1] else "")
        largest = fitted.terms[index[int(np.argmax(np.abs(theta) * fitted.evidence.share[index]))]]
        out.append((f"{words}: {100 * rms:.1f} % of the signal, most of it in {largest.parameter}", p))
    return tuple(out)


def _ledger(found: Sequence[Condition], fitted: Fit) -> Ledger:
    before, after = ([m.simulated(c) for c in found] for m in (fitted.before, fitted.after))
    families = {
        "the image": ("fixed to the image, multiplicative", "fixed to the image, additive", "exposure"),
        "the surface": ("fixed to the surface", "albedo"),
        "the lamp": ("fixed to the lamp", "light_intensity"),
    }
    to_fit = [c for c in found if not c.held_out]
    zero = np.zeros(len(fitted.terms))
    stride = stride_for(found)
    total = None
    for c in to_fit:
        state = Model(fitted.terms, zero, zero).state(c, stride)
        if state.usable.any():
            part = equations(state, fitted.terms, zero)
            total = part if total is None else total + part
    assert total is not None
    b = total.b - total.G @ fitted.before.theta
    rr = total.rr - 2 * fitted.before.theta @ total.b + fitted.before.theta @ total.G @ fitted.before.theta
    index = {
        name: np.array(
            [i for i, t in enumerate(fitted.terms) if t.cause in causes and fitted.evidence.seen[i]]
        )
        for name, causes in families.items()
    }
    fixed = fixed_to(index, total.G, b, float(rr), fitted.evidence.spike)
    return ledger(found, before, after, fixed)


def _notes(
    captures: Captures, found: Sequence[Condition], where: Ledger, fitted: Fit, left: Sequence[str]
) -> list[str]:
    notes = []
    if not where.measured:
        notes.append("No captures are repeats: the noise floor is the sensor model's, not measured.")
    if any(c.captures[0].bits == 8 for c in found):
        notes.append(
            "8-bit images: rounding hides effects below half a DN, and a processed image may be curved."
        )
    if len(found) < 6:
        notes.append(
            f"{len(found)} conditions are few: six or more, under two lamps and two poses, tell effects apart."
        )
    if all(c.shown.indirect is None for c in found):
        notes.append(
            "The simulation has direct light alone: interreflection is not among the causes that were tried."
        )
    if left:
        notes.append(
            f"The corrected scene does not carry {', '.join(left)}: a scene file has no place for it yet."
        )
    tried = {t.cause for t in fitted.terms}
    missing = sorted(CATALOGUED - tried - {"sensor_noise"})
    notes.append(f"Not tried: {', '.join(missing)}.")
    return notes

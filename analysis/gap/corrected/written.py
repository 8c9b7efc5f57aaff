"""What was found, written into the scene file, and what of it no scene file carries."""

from collections.abc import Callable, Sequence
from pathlib import Path

from analysis.gap.compared.conditions import Condition
from analysis.gap.corrected.painted import patterns
from analysis.gap.corrected.scene import Change, write_corrected
from analysis.gap.finding import Finding
from analysis.gap.judgement.attribution import PATTERN, Cause
from analysis.gap.noise.finding import NoiseFinding
from analysis.gap.noise.hot_pixels import HOT
from analysis.gap.processed.binned import Binning
from analysis.gap.search.fit import Fit
from analysis.gap.terms.base import together
from analysis.gap.terms.chain import signed
from interchange.captures import Captures
from interchange.formats.document import Document
from interchange.scene import Scene

WRITTEN = (
    "sensor_noise",
    "fixed_pattern",
    "saturation",
)  # effects without a mean that a scene file can say


def written(
    document: Document,
    captures: Captures,
    conditions: Sequence[Condition],
    fitted: Fit,
    findings: Sequence[Finding],
    noise: Sequence[NoiseFinding],
    mapped: bool,
    known: Callable[[Scene], Scene],
    path: Path,
    binning: Binning,
) -> dict[str, str]:
    """Write the scene to ``path``; returns the effects that it does not carry, each with the reason. ``mapped``: which
    pixels are off by how much is known; ``known``: a scene with what was known before anything was fitted; ``binning``:
    of the captures that were fitted to, which is not the scene's."""
    changes = [
        *_changes(conditions, fitted, {f.name for f in findings}, binning),
        *(change for n in noise if n.name in WRITTEN for change in _noise_changes(n, binning)),
    ]
    left = write_corrected(document, captures, changes, path, known)
    if mapped:
        left[PATTERN] = "Which pixels are off by how much is in no scene file, only the rms of it."
    left |= {n.name: "It is no number of the sensor's model." for n in noise if n.name not in WRITTEN}
    return left | {
        f.name: "Render it with paths (--render offline)." for f in findings if "added" in f.parameters
    }


def _changes(conditions: Sequence[Condition], fitted: Fit, names: set[str], binning: Binning) -> list[Change]:
    """What the findings change in the scene: a value a parameter, by effect and by what it is about; textures are
    laid out."""
    found: dict[Cause, dict[str, tuple[float, float]]] = {}
    told_at: dict[Cause, float] = {}
    for i, term in enumerate(fitted.terms):
        if term.cause in names - {"texture"} and term.candidate in fitted.best.causes and term.is_a_parameter:
            theta = float(fitted.after.theta[together(fitted.terms, i)].sum())
            own = 1 / binning.factor(term.cause, term.parameter, term.unit)
            pair = (own * term.value(theta), own * term.value(0.0))
            found.setdefault(term.candidate, {})[term.parameter] = pair
            told_at[term.candidate] = max(told_at.get(term.candidate, 0.0), term.t_exp)
    changes = []
    for (name, target), values in found.items():
        new, old = (signed({n: pair[k] for n, pair in values.items()}) for k in (0, 1))
        changes.append(Change(name, target, new, old, told_at[name, target]))
    if "texture" in names:
        laid_out = patterns(conditions, fitted)
        changes += [Change("texture", m, {}, None, patterns=found) for m, found in laid_out.items() if found]
    return changes


def _noise_changes(noise: NoiseFinding, binning: Binning) -> list[Change]:
    """Its numbers stand for those of the sensor's data sheet; what is hot is an effect by itself there."""
    told = {n: (x.value, x.unit) for n, x in noise.parameters.items()}
    values = binning.of_own_pixels(noise.name, told)
    hot = {n.removeprefix(HOT): values.pop(n) for n in list(values) if n.startswith(HOT)}
    changes = [Change(noise.name, "", values, None)] if values else []
    return [*changes, Change("hot_pixels", "", hot, None)] if hot else changes

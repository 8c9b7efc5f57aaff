"""What a fit says in words and numbers: the effects found with their parameters and rivals, and what has no name."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.gap.evidence.caution import uncalled
from analysis.gap.evidence.hypotheses import ENOUGH
from analysis.gap.evidence.likelihood import TAU
from analysis.gap.finding import PRESENT, Estimate, Finding
from analysis.gap.judgement.advice import separating
from analysis.gap.judgement.attribution import CATALOGUED, Attribution
from analysis.gap.judgement.attribution import called as causes_called
from analysis.gap.measures.shrinkage import Gap
from analysis.gap.noise.finding import NoiseFinding
from analysis.gap.noise.hot_pixels import HOT
from analysis.gap.search.fit import Fit
from analysis.gap.search.uncertainty import uncertainty, uncertainty_of_sum
from analysis.gap.terms.base import Cause, together
from analysis.gap.terms.generic import FIXED_TO_THE_IMAGE
from analysis.gap.terms.material import IN_PLACES, SEEN_TWICE
from analysis.gap.terms.normal_equations import SIGNAL
from analysis.gap.terms.subpixel import PRODUCT
from interchange.effects.parts import called
from interchange.sensor import Sensor

CURVE, CROSSTALK, JPEG, SURE = "response_curve", "color_crosstalk", "jpeg", 0.999
EVERY = {  # what an effect is about whose target is none, where one of them could have it
    "light_position": "all lamps",
    "light_size": "all lamps",
    "shadow": "all lamps",
    "principal_point": "all cameras",
}


def effects_found(fitted: Fit, taken: Attribution, shrunk: Gap) -> list[Finding]:
    sigma = uncertainty(fitted)
    by = {
        (*t.candidate, t.parameter): float(x) for t, x in zip(fitted.terms, fitted.after.theta, strict=True)
    }
    out = []
    for name in (n for n in taken.players if n in CATALOGUED):
        own = list(taken.players[name])
        index = [
            i
            for i, t in enumerate(fitted.terms)
            if t.candidate in own and i in fitted.evidence.members[t.candidate]
        ]
        estimates = {}
        for i in index:
            term = fitted.terms[i]
            parts = together(fitted.terms, i)
            value = term.value(float(fitted.after.theta[parts].sum()))
            width = float(sigma[i]) if len(parts) == 1 else uncertainty_of_sum(fitted, parts)
            if term.power == 2:
                width = width / max(2 * np.sqrt(max(float(fitted.after.theta[i]), 0.0)), np.sqrt(width))
            if term.parameter == PRODUCT or not term.is_a_parameter:
                continue
            if term.parameter == "v" and by.get((*term.candidate, PRODUCT), 0.0) < 0:
                value = -value
            target = called(term.target)
            estimates[f"{target} {term.parameter}".strip()] = Estimate(value, width, term.unit)
        if pattern := [i for i in index if fitted.terms[i].family is not None or fitted.terms[i].pattern]:
            estimates["rms of the pattern"] = _rms(fitted, pattern)
        rivals = _rivals(fitted, own)
        separate = separating(name, rivals[0][0]) if rivals and rivals[0][1] > 0.1 else None
        out.append(
            Finding(
                name=name,
                probability=min(max(fitted.probability[c] for c in own), SURE),
                parameters=estimates,
                rivals=rivals,
                separate_by=separate,
                gap_without=float(np.sqrt(taken.lacking(name))),
                gap_with=shrunk.after,
                share=taken.share[name] / shrunk.before**2,
                cameras=tuple(dict.fromkeys(called(fitted.terms[i].camera) for i in index))
                if all(fitted.terms[i].camera for i in index)
                else (),
                targets=_targets(fitted, own),
            )
        )
    return out


def _targets(fitted: Fit, own: Sequence[Cause]) -> tuple[str, ...]:
    terms = [t for t in fitted.terms if t.cause in {name for name, _ in own}]
    if any(t.kind == "chain" or t.camera for t in terms):
        return ()  # of cameras, which are told by themselves
    several = any(t.target for t in terms)
    of = [(name, target.removesuffix(IN_PLACES).removesuffix(SEEN_TWICE)) for name, target in own]
    named = [called(target) if target else EVERY.get(name, "") if several else "" for name, target in of]
    return tuple(dict.fromkeys(named)) if all(named) else ()


def _rms(fitted: Fit, index: Sequence[int]) -> Estimate:
    """Of a pattern without a formula, over the signal; its width from the gain of every place alone."""
    e = fitted.evidence.e
    theta = fitted.after.theta[list(index)]
    square = float(theta @ e.G[np.ix_(index, index)] @ theta) / e.signal
    return Estimate(float(np.sqrt(max(square, 0.0))), float(np.sqrt(len(index) / e.signal)), "1")


def _rivals(fitted: Fit, own: Sequence[tuple[str, str]]) -> tuple[tuple[str, float], ...]:
    """What else could stand in these causes' place, and how probable that is."""
    rest = set(fitted.best.causes) - set(own)
    chances: dict[str, float] = {}
    for cause, p in fitted.probability.items():
        if cause not in fitted.best.causes and cause[0] in CATALOGUED - {c[0] for c in own}:
            with_own = sum(
                np.exp(h.score - fitted.best.score)
                for h in fitted.hypotheses
                if cause in h.causes and rest <= set(h.causes) and not set(own) & set(h.causes)
            )
            if with_own > 1e-3:
                chances[cause[0]] = chances.get(cause[0], 0.0) + min(float(with_own), p)
    for cause in (c for c in own if c in fitted.alike):
        (other, _), times = fitted.alike[cause]
        chances[other] = max(chances.get(other, 0.0), times * fitted.probability[cause])
    return tuple(sorted(chances.items(), key=lambda x: -x[1])[:3])


@dataclass(frozen=True)
class Known:
    """An effect that was known before anything was fitted, by these ``grounds``: it has taken ``taken_off`` off the
    mean χ², and χ is ``without`` it where all else stays as it was found. ``cameras``: those that alone have it;
    ``words`` for it, where its name says too little."""

    name: str
    parameters: dict[str, Estimate]
    grounds: str
    taken_off: float
    without: float
    cameras: tuple[str, ...]
    words: str = ""


def with_known(findings: Sequence[Finding], known: Known, shrunk: Gap) -> list[Finding]:
    """With what was known, beside what one of that name that was found takes off."""
    share = known.taken_off / shrunk.before**2
    cameras = tuple(map(called, known.cameras))
    own = Finding(
        known.name, SURE, known.parameters, (), None, known.without, shrunk.after, share, cameras,
        grounds=known.grounds, words=known.words,
    )  # fmt: skip
    for f in findings:
        if f.name == known.name:
            own = replace(own, parameters=f.parameters | known.parameters, share=share + f.share)
    return [own, *(f for f in findings if f.name != known.name)]


def noise_effect(noise: NoiseFinding, taken: Attribution, shrunk: Gap) -> Finding:
    """What does not move the mean image closes nothing; a fixed pattern does where its map is known."""
    values = {n: Estimate(x.value, x.sigma, x.unit) for n, x in noise.parameters.items()}
    lacking, share = shrunk.after, 0.0
    if noise.name in taken.share:
        lacking, share = float(np.sqrt(taken.lacking(noise.name))), taken.share[noise.name] / shrunk.before**2
    return Finding(noise.name, min(noise.probability, 0.999), values, (), None, lacking, shrunk.after, share)


def beside_unknown(noise: NoiseFinding, fitted: Fit, sheet: Sensor) -> NoiseFinding:
    """A fixed pattern beside what has no name and is fixed to the image may be what that leaves at its pixels: less
    probable by E / (E + E_unknown), E the mean square over the signal (analysis.gap.evidence.belief.believed). Hot
    pixels are none of it."""
    if noise.name != "fixed_pattern" or any(n.startswith(HOT) for n in noise.parameters):
        return noise
    e, theta, unknown = fitted.evidence.e, fitted.after.theta, 0.0
    for cause in fitted.best.causes:
        if cause[0] in FIXED_TO_THE_IMAGE:
            index = fitted.evidence.members[cause]
            unknown += float(theta[index] @ e.G[np.ix_(index, index)] @ theta[index]) / e.signal
    own = max(noise.parameters["prnu"].value ** 2 - sheet.prnu**2, 0.0)
    return replace(noise, probability=noise.probability * own / (own + unknown)) if unknown else noise


def what_is_unknown(
    fitted: Fit,
    shape: str = "in no shape known",
    structured: tuple[float, float] = (0.0, 0.0),
    off: float = SIGNAL,
) -> tuple[tuple[str, float], ...]:
    """Generic families that the evidence asks for, described by where their largest part lies; ``shape``: where what is
    left without a cause does; ``structured``: how many times as much of it has structure as is usual, and the
    probability that it has a cause (analysis.gap.measures.structure); ``off``: share of the signal that the twin is
    off by."""
    out = []
    for cause in fitted.best.causes:
        p = fitted.probability.get(cause, 0.0)
        if cause[0] in CATALOGUED or p < PRESENT:
            continue
        index = fitted.evidence.members[cause]
        theta = fitted.after.theta[index]
        sub = fitted.evidence.e.G[np.ix_(index, index)]
        rms = float(np.sqrt(max(theta @ sub @ theta, 0) / fitted.evidence.e.signal))
        words = cause[0] + (f" {called(cause[1])}" if cause[1] else "")
        largest = fitted.terms[index[int(np.argmax(np.abs(theta) * fitted.evidence.share[index]))]]
        out.append((f"{words}: {100 * rms:.1f} % of the signal, most of it in {largest.parameter}", p))
    more, probable = fitted.left_over
    if probable >= PRESENT and not out:
        out.append(
            (
                f"{100 * more:.0f} % more χ² is left than noise and the renderer leave, {shape}",
                probable,
            )
        )
    sure = bool(causes_called(fitted))
    larger = all(c in fitted.cautions and fitted.cautions[c].tail >= PRESENT for c in fitted.best.causes)
    nothing = float(fitted.probability_of_none)
    none = max((h.score for h in fitted.hypotheses if not h.causes), default=-np.inf)
    slight = fitted.best.score - none < ENOUGH / TAU  # what conditions disagree on besides
    if fitted.best.causes and not (sure or larger or slight or out) and nothing < PRESENT:
        tried = ", ".join(sorted({c[0].replace("_", " ") for c in fitted.best.causes}))
        probable = uncalled(fitted.weighed, fitted.best)
        agreed = [fitted.cautions[c].something if c in fitted.cautions else 1.0 for c in fitted.best.causes]
        p = (1 - nothing) * max(probable, *agreed)
        if p >= PRESENT:
            out.append((f"something that no effect alone explains (nearest: {tried})", p))
    times, p = structured
    if p >= PRESENT and not out:
        words = f"pixels 2 px apart share {times:.0f} times as much as a twin that is {100 * off:.1f} % off leaves"
        out.append((f"what is left away from edges is no noise: {words}, {shape}", p))
    return tuple(out)


def cautious(fitted: Fit) -> list[str]:
    """Why causes that the captures together speak for are not called."""
    notes, sure = [], causes_called(fitted)
    larger = () if sure else fitted.larger_errors
    for (name, target), c in fitted.cautions.items():
        if (name, target) in (*sure, *fitted.refuted):
            continue
        what = f"{name.replace('_', ' ')}{f' of {called(target)}' if target else ''}"
        if c.tail >= PRESENT or (name, target) in larger:
            notes.append(
                f"{what[0].upper()}{what[1:]} looks off by more than the calibration's tolerances, but by no more than "
                f"calibrations are off now and then ({100 * c.tail:.0f} % probable): it is not called."
            )
        elif c.most < PRESENT:
            notes.append(
                f"The captures together speak for {what}, but how much of it there is changes by "
                f"{100 * c.spread:.0f} % as one or another is left out: it is not called."
            )
    return notes

"""What the diagnosis says in plain words: the verdict, why an effect and why not another, what to capture next."""

import math
import sys
from collections.abc import Sequence

from analysis.gap.compared.conditions import Condition
from analysis.gap.diagnosis import Diagnosis
from analysis.gap.finding import Estimate, Finding, names
from analysis.gap.judgement.verify import Verification
from analysis.gap.measures.structure import STEPS
from analysis.gap.noise.hot_pixels import HOT
from analysis.gap.processed import matrices
from analysis.gap.search.fit import Fit
from analysis.gap.terms import aperture
from interchange.effects import MODELS
from interchange.parameter import parameters

STRENGTH = ((10.0, "overwhelming"), (5.0, "strong"), (3.0, "clear"), (1.0, "weak"), (-math.inf, "no"))
WHITE = 0.02  # of σ², from which on it is worth a word
LEAST = 0.005  # of a gap, or a probability, that is told as one
OF_NOISE = (
    "It moves no mean: it is judged on repeats, on what stays at the same pixels, and on which DN occur."
)
MOVES_NO_MEAN = {"sensor_noise", "fixed_pattern", "quantization"}
ALONE = "All pixels of the captures tell it alone, before the fit: nothing was weighed in its place."
SURE_OF_ITSELF = 5.0  # of log Z: odds that are larger than what a probability is ever told as


def sentence(d: Diagnosis) -> str:
    """The verdict in one sentence or two."""
    g = d.gap
    share = f"{100 * min(d.gap.explained, 1):.0f} %" if d.gap.explained >= LEAST else "nothing"
    closing = f"{share} of what can be closed on captures that nothing was fitted to"
    match d.verdict:
        case "none":
            wider = [f"{n.replace('_', ' ')} {k:g} times" for n, k in d.over_declared.items() if k > 2]
            taken = f", taken wider than declared ({', '.join(wider)})" if wider else ""
            return (
                f"No unmodelled effect was found: the captures are what the scene file says, within its "
                f"tolerances{taken} (chi {g.before:.2f}, noise {g.noise_floor:.2f})."
            )
        case "effects":
            if not any(f.share for f in d.effects):
                stays = f"chi stays at {g.after:.2f}, noise {g.noise_floor:.2f}"
                noise = {f.name for f in d.effects} <= MOVES_NO_MEAN
                where = "moves no mean" if noise else "shows in no capture that nothing was fitted to"
                return f"There is {names(d.effects)}, which {where}: {stays}."
            return f"The gap comes from {names(d.effects)}; adding that closes {closing}."
        case "unknown":
            return f"There is a gap that no effect of the catalogue explains: {d.unknown[0][0]}."
        case _:
            return (
                f"The gap comes from {names(d.effects)} and from something that the catalogue does not have "
                f"({d.unknown[0][0]}); together that closes {closing}."
            )


def what_is_left(d: Diagnosis) -> str:
    """Whether what is left away from edges is noise."""
    if d.left is None:
        return ""
    at = STEPS.index(2)
    shared = max(d.left.near[at], 0.0)
    words = (
        f"With what was found, away from edges, {100 * max(d.left.white, 0.0):.1f} % of σ² more than the sensor's "
        f"noise is left from pixel to pixel, and {100 * shared:.1f} % is shared by pixels {STEPS[at]} px apart."
    )
    if d.left.white > WHITE and d.left.white > 2 * shared:
        words += (
            " What no neighbour shares is no effect of light, optics or surfaces: it is noise that the sensor's "
            "numbers do not have, or a path tracer's, where captures are rendered."
        )
    return words


def lacking(v: Verification) -> str:
    """ "camera pose and texture", which the file that was rendered anew does not have."""
    return " and ".join(plain(name) for name in v.lacks)


def plain(name: str) -> str:
    return name.replace("_", " ")


def number(value: float, sigma: float) -> str:
    """A value with as many digits as its σ leaves sense."""
    if not (math.isfinite(sigma) and sigma > 0):
        return f"{value:.4g}"
    digits = max(0, 1 - math.floor(math.log10(sigma)))
    return f"{value:.{min(digits, 8)}f}"


def beneath(f: Finding, parameter: str) -> str:
    """What a parameter is called beneath a heading that says what ``f`` is about."""
    about = f.cameras or f.targets
    return parameter.removeprefix(f"{about[0]} ") if len(about) == 1 else parameter


def interval(effect: str, name: str, found: Estimate) -> str:
    """A parameter's 95 % interval, as far as it lies within what the catalogue lets the parameter be."""
    about = parameters(MODELS[effect]).get(name.split()[-1]) if effect in MODELS else None
    low, high = (about.low, about.high) if about else (-math.inf, math.inf)
    ends = (max(found.value - 1.96 * found.sigma, low), min(found.value + 1.96 * found.sigma, high))
    return " to ".join(number(x, found.sigma) for x in ends)


def grounds(fit: Fit, finding: Finding) -> tuple[str, list[str]]:
    """Why an effect, and why not another."""
    if finding.grounds:
        return finding.grounds, [ALONE]
    if _is_fitted(fit, finding):
        return evidence(fit, finding), why_not(fit, finding)
    return OF_NOISE, why_not(fit, finding)


def _is_fitted(fit: Fit, finding: Finding) -> bool:
    """Whether it is a cause of the best hypothesis; what noise or the files' codes show is none."""
    return any(finding.name == cause for cause, _ in fit.best.causes)


def evidence(fit: Fit, finding: Finding) -> str:
    """How much likelier the captures are with the effect than with the best explanation that leaves it out, and all
    that may as well be there."""
    alike = {finding.name, *(name.replace(" ", "_") for name in finding.tied)}
    without = [h.score for h in fit.hypotheses if not alike & {c[0] for c in h.causes}]
    if not without:
        return "Every explanation that was tried has it."
    gain = fit.best.score - max(without)
    word = next(word for least, word in STRENGTH if gain >= least)
    told = (
        f"There is {word} evidence: the best explanation without it makes the captures {_times(gain)} times "
        f"less likely"
    )
    if finding.tied:
        others = " or ".join(finding.tied)
        return (
            f"The captures speak for it or for {others} and hardly tell which; it is the likeliest. There is {word} "
            f"evidence for one of them: the best explanation without any makes the captures {_times(gain)} times less "
            f"likely."
        )
    if gain < SURE_OF_ITSELF:
        return f"{told}."
    return (
        f"{told}, if models were exact. They are not: the probability is what such evidence proved to be worth "
        f"in blind cases."
    )


def _times(gain: float) -> str:
    return f"10^{gain / math.log(10):.0f}" if gain > 14 else f"{float(f'{math.exp(gain):.1g}'):,.0f}"


def kinds(finding: Finding) -> list[str]:
    """The effects that it is of: hot pixels are told with a fixed pattern, or as one; a camera's colour matrix as
    crosstalk, which is what it does."""
    if finding.grounds == matrices.GROUNDS:
        return ["color_correction"]
    if not any(n.startswith(HOT) for n in finding.parameters):
        return [finding.name]
    alone = all(n.startswith(HOT) for n in finding.parameters)
    return ["hot_pixels"] if alone else [finding.name, "hot_pixels"]


def _inside(sentence: str) -> str:
    """As it is after a colon: "DN" stays what it is."""
    return sentence if sentence[:2].isupper() else sentence[0].lower() + sentence[1:]


def meaning(names: Sequence[str]) -> str:
    """What effects are, the first sentence of each one's file."""
    modules = [sys.modules.get(MODELS[n].__module__) for n in names if n in MODELS]
    return " ".join((m.__doc__ or "").strip().split("\n")[0] for m in modules if m)


def why(names: Sequence[str]) -> str:
    """What only these effects do."""
    return " ".join(getattr(MODELS[n], "identified_by", "") for n in names if n in MODELS)


def why_not(fit: Fit, finding: Finding) -> list[str]:
    """One sentence or two for each effect that looks alike."""
    chances = {name: p for name, p in finding.rivals if p >= LEAST}
    own = kinds(finding)
    alike = [*dict(finding.rivals), *(n for k in own for n in getattr(MODELS.get(k), "confused_with", ()))]
    out = []
    for rival in (n for n in dict.fromkeys(alike) if n not in (finding.name, *own)):
        mark = why([rival])
        seen = f" It would show like this: {_inside(mark)}" if mark else ""
        if rival in chances:
            out.append(
                f"{plain(rival)}: could stand in its place with probability {chances[rival]:.2f}.{seen}"
            )
            continue
        instead = [
            h.score
            for h in fit.hypotheses
            if rival in {c[0] for c in h.causes} and finding.name not in {c[0] for c in h.causes}
            if _is_fitted(fit, finding)
        ]
        gain = fit.best.score - max(instead) if instead else 0.0
        said = "was not tried in its place"
        if gain == math.inf:
            said = "has no numbers that could stand in its place"
        elif gain > 0:
            said = f"in its place makes the captures {_times(gain)} times less likely"
        out.append(f"{plain(rival)}: {said}.{seen}")
    return out


def next_captures(d: Diagnosis, found: Sequence[Condition], fit: Fit) -> list[str]:
    """What to capture next, the most useful first; empty where nothing would tell more."""
    out = [
        f"To tell {plain(f.name)} from {plain(f.rivals[0][0])}: {f.separate_by}."
        for f in d.effects
        if f.separate_by
    ]
    if aperture.may_be_one(fit.best.causes, aperture.variance(fit.terms, fit.after.theta)):
        out.append(f"To tell defocus from pixels whose aperture is no square: {aperture.TELLING}.")
    if d.unknown:
        out.append(
            "To follow what the catalogue does not have: a flat field (fixed to the image?), the same part turned "
            "(fixed to the surface?), and the lamps one by one (fixed to a lamp?)."
        )
    undecided = [
        (cause, p)
        for cause, p in sorted(fit.probability.items(), key=lambda x: -x[1])
        if 0.1 < p < 0.5 and cause[0] in MODELS and cause[0] not in {f.name for f in d.effects}
    ]
    for (name, _), p in undecided[:2]:
        advice = getattr(MODELS[name], "separated_by", "")
        if advice:
            out.append(f"{plain(name).capitalize()} is possible (p = {p:.2f}); it would show in {advice}.")
    if not any(c.spread is not None for c in found):
        out.append("Repeats: four captures or more of one condition measure the noise floor.")
    if not any(not c.lamps for c in found):
        out.append(
            "One capture with all lamps off: it tells black level, ambient light and veiling glare apart."
        )
    if len({c.camera.t_exp for c in found}) < 2:
        out.append(
            "One condition at a quarter and at four times the exposure: it tells offsets and curves from factors."
        )
    lamps = {name for c in found for name in c.lamps}
    alone = {c.lamps[0] for c in found if len(c.lamps) == 1}
    if len(lamps) > 1 and lamps - alone:
        missing = ", ".join(sorted(n.rsplit("/", 1)[-1] for n in lamps - alone))
        out.append(f"Each lamp alone ({missing}): it tells lamps from materials.")
    return out

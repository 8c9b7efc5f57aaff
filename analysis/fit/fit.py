"""A reflectance model fitted to a measurement: parameters with uncertainties, and how far the fit can be believed.

The steps: usable samples to bands; the best of many starts (``search``); as many lobes as held-out samples pay for;
intervals and what the samples do not tell (``uncertainty``); errors of samples that the fit had not seen (``folds``).
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from analysis.fit.folds import Folds, folds_of
from analysis.fit.search import best_fit, enough
from analysis.fit.solve import Problem, Solution, TimeUp, predict, solve
from analysis.fit.starts import lobed
from analysis.fit.uncertainty import Estimate, Uncertainty, uncertainty
from analysis.fit.unknowns import COLORS, chart_of
from analysis.fit.weighting import AUTO, Weighting, resolved, weighting_of
from interchange.brdf import BY_NAME, Brdf
from interchange.brdf.sum import Sum
from interchange.parameter import parameters, tables
from interchange.problems import BrightfieldError, did_you_mean
from interchange.reflectance import ReflectanceSamples

METRICS = ("mse", "cosine", "log")


@dataclass(frozen=True)
class Options:
    """``weighting``: one of ``analysis.fit.weighting``, or "auto": sigma where the file gives it, else log.
    ``lobes``: their number, or 0 to choose it up to ``most_lobes``. ``isotropic``: None asks the samples.
    ``fixed``: parameters that are not fitted. ``seconds``: for one model."""

    weighting: str = AUTO
    lobes: int = 0
    most_lobes: int = 3
    per_channel: bool = False
    isotropic: bool | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)
    folds: str = "incidence"
    fold_count: int = 8
    seed: int = 0
    seconds: float = np.inf


@dataclass(frozen=True)
class Errors:
    """Root mean squares over samples and channels, by metric: ``mse`` 1/sr, ``cosine`` 1/sr, ``log`` (about relative).
    ``share``: the same over the root mean square of the readings. ``by_fold``: by label."""

    rms: dict[str, float]
    share: dict[str, float]
    by_fold: dict[str, dict[str, float]] = field(default_factory=dict)
    spread: float = 0.0  # one standard error of the mean square of the weighting's own metric, over the folds


@dataclass(frozen=True, eq=False)
class Fit:
    """``brdf``: the fitted model. ``residual`` (N, 3): fitted minus measured, 1/sr, over ``samples``, the usable ones
    in bands. ``held`` (N, 3): what the fits that had not seen a sample foretell for it, 1/sr. ``tried``: by number of
    lobes, the held-out error in the weighting's metric. ``jackknife``: by parameter, its standard error over the folds.
    ``chi2``: per degree of freedom, of the measurement's σ; NaN where nobody knows σ."""

    brdf: Brdf
    samples: ReflectanceSamples
    options: Options
    estimates: tuple[Estimate, ...]
    correlation: np.ndarray
    errors: Errors
    held_out: Errors
    held: np.ndarray
    folds: Folds
    warnings: tuple[str, ...]
    unknowns: int
    lobes: int
    tried: dict[int, float]
    jackknife: dict[str, float]
    chi2: float
    seconds: float
    finished: bool
    isotropic: bool
    parts: tuple["Fit", ...] = ()

    @property
    def residual(self) -> np.ndarray:
        return self.brdf.evaluate(self.samples.wi, self.samples.wo) - three(self.samples.f)


def model_of(name: str) -> type[Brdf]:
    """A model that can be fitted, by name, whatever its capitals. Raises BrightfieldError, with the nearest name."""
    known = {n.lower().replace("_", ""): n for n in BY_NAME}
    word = name.lower().replace("_", "").replace("-", "")
    if word not in known:
        hint = did_you_mean(word, known)
        for low, proper in known.items():
            hint = hint.replace(f'"{low}"', f'"{proper}"')
        raise BrightfieldError(f'No BRDF is called "{name}".{hint} Known: {", ".join(sorted(fittable()))}.')
    model = BY_NAME[known[word]]
    if model.__name__ not in fittable():
        raise BrightfieldError(
            f"{model.__name__} holds a table or other models, not parameters to fit. Known: "
            f"{', '.join(sorted(fittable()))}."
        )
    return model


def fittable() -> dict[str, type[Brdf]]:
    """The models whose declared parameters are all there is to find."""
    return {n: m for n, m in BY_NAME.items() if parameters(m) and not tables(m) and m is not Sum}


def prepared(samples: ReflectanceSamples) -> ReflectanceSamples:
    """The usable samples in three bands, or in one where the measurement has one. Raises BrightfieldError for none."""
    count = samples.f.shape[1]
    bands = samples if count == 1 else samples.bands()
    used = bands.masked()
    if not len(used):
        raise BrightfieldError(f"A fit needs usable samples; none of {len(samples)} is. ({samples.file})")
    return used


def tells_azimuth(samples: ReflectanceSamples) -> bool:
    """Whether the lamp stood in several directions around the normal, so that anisotropy could show."""
    off = samples.theta[0] > np.radians(2)
    turned = np.exp(2j * np.arctan2(samples.wi[off, 1], samples.wi[off, 0]))  # a half turn looks the same
    return bool(off.sum() > 2 and abs(turned.mean()) < np.cos(np.radians(30)))


def fit(samples: ReflectanceSamples, model: type[Brdf], options: Options = Options()) -> Fit:  # frozen
    """``model`` fitted to ``samples``. Raises BrightfieldError for too few samples, unknown weights, no time."""
    used = prepared(samples)
    options = replace(options, weighting=resolved(options.weighting, used))
    began = time.monotonic()
    grey = used.f.shape[1] == 1
    with threadpool_limits(1, "blas"):  # matrices of a dozen columns: threads would only wait for each other
        if options.per_channel and not grey:
            return _by_channel(used, model, options, began)
        return _fit(used, model, options, (0,) if grey else (0, 1, 2), grey, began)


def _fit(
    used: ReflectanceSamples,
    model: type[Brdf],
    options: Options,
    channels: tuple[int, ...],
    grey: bool,
    began: float,
    weighting: Weighting | None = None,
) -> Fit:
    problem = Problem(used, weighting or weighting_of(options.weighting, used), began + options.seconds)
    isotropic = options.isotropic if options.isotropic is not None else not tells_azimuth(used)
    many = any(p.per_lobe for p in parameters(model).values())
    smallest = lobed(model, int(many), None, np.random.default_rng(options.seed))[0]
    enough(chart_of(smallest, channels, grey, isotropic, tuple(options.fixed)), problem)
    folds = folds_of(used, options.folds, options.fold_count, options.seed)
    if options.lobes and not many:
        raise BrightfieldError(f"{model.__name__} has no lobes to count; --lobes is for models that have.")
    counts = range(1, (options.lobes or options.most_lobes) + 1) if many else [0]
    found: list[tuple[Solution, _Held]] = []
    before: Brdf | None = None
    for lobes in counts:
        try:
            solution = best_fit(
                model, problem, channels, grey, isotropic, lobes, before, options.fixed, seed=options.seed
            )
            held = (
                _held_out(solution, problem, folds) if not options.lobes or lobes == options.lobes else None
            )
        except TimeUp:
            if found:
                break
            raise BrightfieldError(
                f"{model.__name__} could not be fitted within {options.seconds:g} s."
            ) from None
        before = solution.chart.brdf(solution.x)
        if held is not None:
            found.append((solution, held))
    chosen = _smallest([held for _, held in found])
    solution, held = found[chosen]
    told = uncertainty(solution, problem)
    return _result(used, options, solution, problem, held, told, folds, {
        s.chart.template.lobes: h.errors.rms[metric_of(options.weighting)] for s, h in found
    }, isotropic, began)  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Held:
    predicted: np.ndarray  # (N, K)
    errors: Errors
    jackknife: np.ndarray  # (P,) in the unknowns' scale
    means: np.ndarray  # (F,) mean square of the weighting's metric
    finished: bool


def metric_of(weighting: str) -> str:
    """In which errors are compared: the weighting's own, or that of logarithms, which is nearest to relative
    differences and to noise that grows with f."""
    return weighting if weighting in METRICS else "log"


def _held_out(solution: Solution, problem: Problem, folds: Folds) -> _Held:
    """Every fold foretold by a fit to the others, which starts where the whole fit ended."""
    samples = problem.samples
    predicted = np.empty_like(samples.f)
    ends, finished = [], True
    for k in range(len(folds)):
        out = folds.held == k
        if time.monotonic() > problem.deadline:
            raise TimeUp
        part = solve(solution.chart, solution.x, problem.take(~out), steps=60, tolerance=1e-6)
        finished &= part.finished
        predicted[out] = predict(solution.chart, part.x, samples.take(out))[0]
        ends.append(part.x)
    x = np.array(ends)
    share = (len(folds) - 1) / len(folds)
    jackknife = np.sqrt(share * np.sum(np.square(x - x.mean(axis=0)), axis=0))
    errors = errors_of(predicted, samples, folds, problem.weighting)
    own = _own(problem.weighting, predicted, samples)
    means = np.array([own[folds.held == k].mean() for k in range(len(folds))])
    return _Held(predicted, errors, jackknife, means, finished)


def _own(weighting: Weighting, predicted: np.ndarray, samples: ReflectanceSamples) -> np.ndarray:
    """Mean square over channels (N,) of what is minimised."""
    with np.errstate(all="ignore"):
        return np.square(weighting.residual(predicted, samples.f)[0]).mean(axis=1)


def _smallest(held: list[_Held]) -> int:
    """The fewest lobes whose held-out mean square is within one standard error of the best's, fold by fold."""
    totals = [h.means.mean() for h in held]
    best = int(np.argmin(totals))
    for k in range(best):
        excess = held[k].means - held[best].means
        if excess.mean() <= excess.std(ddof=1) / np.sqrt(len(excess)):
            return k
    return best


def errors_of(
    predicted: np.ndarray,
    samples: ReflectanceSamples,
    folds: Folds | None = None,
    own: Weighting | None = None,
) -> Errors:
    """Errors of predicted against measured reflectance, both (N, K) 1/sr."""
    rms: dict[str, float] = {}
    share: dict[str, float] = {}
    by_fold: dict[str, dict[str, float]] = {label: {} for label in (folds.labels if folds else ())}
    for metric in METRICS:
        w = weighting_of(metric, samples)
        with np.errstate(over="ignore"):
            square = np.square(w.of(predicted) - w.of(samples.f)).mean(axis=1)
        rms[metric] = float(np.sqrt(square.mean()))
        share[metric] = rms[metric] / max(float(np.sqrt(np.square(w.of(samples.f)).mean())), 1e-300)
        if folds is not None:
            for k, label in enumerate(folds.labels):
                by_fold[label][metric] = float(np.sqrt(square[folds.held == k].mean()))
    spread = 0.0
    if folds is not None and own is not None:
        square = _own(own, predicted, samples)
        means = [square[folds.held == k].mean() for k in range(len(folds))]
        spread = float(np.std(means, ddof=1) / np.sqrt(len(means)))
    return Errors(rms, share, by_fold, spread)


def _result(
    used: ReflectanceSamples, options: Options, solution: Solution, problem: Problem, held: _Held, told: Uncertainty,
    folds: Folds, tried: dict[int, float], isotropic: bool, began: float,
) -> Fit:  # fmt: skip
    chart = solution.chart
    f, _ = predict(chart, solution.x, used)
    warnings = list(told.warnings)
    if not (solution.finished and held.finished):
        warnings.append("The search stopped before it converged: at the time limit or the limit of steps.")
    warnings += _missed_highlight(f, used.f)
    chi2 = float("nan")
    if used.sigma is not None and (used.sigma > 0).all():
        freedom = max(used.f.size - len(chart.unknowns), 1)
        chi2 = float(np.sum(np.square((f - used.f) / used.sigma)) / freedom)
        if chi2 > 2:
            warnings.append(
                f"The fit misses the samples by {np.sqrt(chi2):.1f} times their noise (rms): the surface is not of "
                "this model, and the intervals are too narrow."
            )
    slopes = [float(u.scale.slope(v)) for u, v in zip(chart.unknowns, chart.values(solution.x), strict=True)]
    return Fit(
        brdf=chart.brdf(solution.x),
        samples=used,
        options=options,
        estimates=told.estimates,
        correlation=told.correlation,
        errors=errors_of(f, used),
        held_out=held.errors,
        held=three(held.predicted),
        folds=folds,
        warnings=tuple(warnings),
        unknowns=len(chart.unknowns),
        lobes=chart.template.lobes,
        tried=tried,
        jackknife={
            u.name: float(j * s) for u, j, s in zip(chart.unknowns, held.jackknife, slopes, strict=True)
        },
        chi2=chi2,
        seconds=time.monotonic() - began,
        finished=solution.finished,
        isotropic=isotropic,
    )


def _missed_highlight(fitted: np.ndarray, f: np.ndarray, most: int = 10) -> list[str]:
    """Whether the brightest readings are off by more than a factor of two, as where a highlight fills a few of them."""
    top = np.argsort(-f.mean(axis=1))[:most]
    ratio = float(np.median(fitted[top].mean(axis=1) / np.maximum(f[top].mean(axis=1), 1e-300)))
    if 0.5 <= ratio <= 2.0:
        return []
    off = f"{1 / ratio:.3g} times too dark" if ratio < 1 else f"{ratio:.3g} times too bright"
    return [f"The highlight is missed: at the {len(top)} brightest readings the fit is {off}."]


def _by_channel(used: ReflectanceSamples, model: type[Brdf], options: Options, began: float) -> Fit:
    """Every channel alone, with lobes of its own; together a Sum with one part a channel. What counts as dark is the
    same for all: a channel that is nothing but noise is not fitted as if it were a colour."""
    parts = []
    weights = weighting_of(options.weighting, used)
    for c in range(3):
        sigma = None if used.sigma is None else used.sigma[:, c : c + 1]
        one = replace(used, f=used.f[:, c : c + 1], sigma=sigma, channels=(used.channels[c],))
        share = replace(options, seconds=options.seconds / 3)
        factor = weights.factor[:, [min(c, weights.factor.shape[1] - 1)]]
        alone = replace(weights, factor=factor)
        parts.append(_fit(one, model, share, (c,), False, time.monotonic(), alone))
    weight: Any = tuple(tuple(float(i == c) for i in range(3)) for c in range(3))
    brdf = Sum(weight, tuple(p.brdf for p in parts))
    predicted = np.stack([p.held[:, c] for c, p in enumerate(parts)], axis=-1)
    f = brdf.evaluate(used.wi, used.wo)
    size = sum(p.unknowns for p in parts)
    correlation, at = np.full((size, size), np.nan), 0
    for p in parts:
        correlation[at : at + p.unknowns, at : at + p.unknowns] = p.correlation
        at += p.unknowns
    named = list(zip(COLORS, parts, strict=True))
    return Fit(
        brdf=brdf,
        samples=used,
        options=options,
        estimates=tuple(replace(e, name=f"{c}: {e.name}") for c, p in named for e in p.estimates),
        correlation=correlation,
        errors=errors_of(f, used),
        held_out=errors_of(predicted, used, parts[0].folds, weighting_of(options.weighting, used)),
        held=predicted,
        folds=parts[0].folds,
        warnings=tuple(f"{c}: {w}" for c, p in named for w in p.warnings),
        unknowns=size,
        lobes=max(p.lobes for p in parts),
        tried={},
        jackknife={f"{c}: {n}": v for c, p in named for n, v in p.jackknife.items()},
        chi2=float(np.mean([p.chi2 for p in parts])),
        seconds=time.monotonic() - began,
        finished=all(p.finished for p in parts),
        isotropic=parts[0].isotropic,
        parts=tuple(parts),
    )


def three(f: np.ndarray) -> np.ndarray:
    """(N, 3) of (N, 1) or (N, 3)."""
    return np.broadcast_to(f, (len(f), 3))

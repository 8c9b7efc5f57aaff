"""The fit of one model with a given number of lobes: starts compared, the best followed, bounds settled."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from analysis.fit.solve import Problem, Solution, linear_unknowns, residuals, solve, with_best_colors
from analysis.fit.starts import candidates, lobed
from analysis.fit.unknowns import Chart, chart_of, normalised, with_fixed
from interchange.brdf.base import Brdf
from interchange.problems import BrightfieldError

FEW = 400  # samples that starts are compared on
SPREAD = 96  # candidates over the bounds of a model without lobes
SNAP = 1e-3  # of a range: an unknown this near to its bound is tried at it


def best_fit(
    model: type[Brdf],
    problem: Problem,
    channels: tuple[int, ...],
    grey: bool,
    isotropic: bool,
    lobes: int = 0,
    before: Brdf | None = None,
    fixed: Mapping[str, float] | None = None,
    follow: int = 4,
    seed: int = 0,
) -> Solution:
    """The lowest of ``follow`` minima. ``before``: the fit with one lobe less. Raises BrightfieldError where there are
    not more readings than unknowns."""
    rng = np.random.default_rng(seed)
    small = problem.take(_few(problem, rng))
    ranked: list[tuple[float, Chart, np.ndarray]] = []
    linear: dict[tuple[str, ...], np.ndarray] = {}
    templates = [with_fixed(t, fixed or {}) for t in lobed(model, lobes, before, rng)]
    for template in templates:
        chart = chart_of(template, channels, grey, isotropic, tuple(fixed or {}))
        names = tuple(u.name for u in chart.unknowns)
        if names not in linear:
            enough(chart, problem)
            linear[names] = linear_unknowns(chart, small.samples)
        for x in candidates(chart, linear[names], SPREAD if len(templates) == 1 else 1, seed):
            x = with_best_colors(chart, x, linear[names], small)
            r, _ = residuals(chart, x, small)
            ranked.append((float(np.sum(r * r)), chart, x))
    ranked.sort(key=lambda entry: entry[0])
    followed = [solve(chart, x, small, steps=60, tolerance=1e-6) for _, chart, x in ranked[:follow]]
    followed.sort(key=lambda s: s.cost)
    done = [solve(s.chart, s.x, problem, steps=40, tolerance=1e-6) for s in followed[:2]]
    best = min(done, key=lambda s: s.cost)
    return settled(solve(best.chart, best.x, problem), problem, channels, grey, isotropic, tuple(fixed or {}))


def _few(problem: Problem, rng: np.random.Generator) -> np.ndarray:
    """Rows to compare starts on: a quarter where the weighted readings are largest, which is the highlight, however
    narrow it is; the others anywhere."""
    count = len(problem.samples)
    size = np.abs(problem.weighting.of(problem.samples.f)).mean(axis=1)
    first = np.argsort(-size)[: FEW // 4]
    return np.union1d(first, rng.choice(count, min(FEW - FEW // 4, count), replace=False))


def settled(
    solution: Solution,
    problem: Problem,
    channels: tuple[int, ...],
    grey: bool,
    isotropic: bool,
    fixed: tuple[str, ...],
) -> Solution:
    """The same minimum with Lafortune's largest |C| at 1, and unknowns at their bounds where that costs nothing."""
    brdf = solution.chart.brdf(solution.x)
    if (same := normalised(brdf)) != brdf:
        chart = chart_of(same, channels, grey, isotropic, fixed)
        again = solve(chart, chart.start(), problem)
        if again.cost <= solution.cost * (1 + 1e-6):
            solution = again
    low, high = solution.chart.bounds
    x = solution.x.copy()
    for k in range(len(x)):
        end = low[k] if x[k] - low[k] < high[k] - x[k] else high[k]
        if 0 < abs(x[k] - end) < SNAP * (high[k] - low[k]):
            trial = x.copy()
            trial[k] = end
            r, _ = residuals(solution.chart, trial, problem)
            if 0.5 * float(np.sum(r * r)) <= solution.cost * (1 + 1e-7):
                x = trial
    if (x != solution.x).any():
        r, j = residuals(solution.chart, x, problem)
        solution = replace(solution, x=x, residual=r, jacobian=j, cost=0.5 * float(np.sum(r * r)))
    return solution


def enough(chart: Chart, problem: Problem) -> None:
    count = problem.samples.f.size
    if count <= len(chart.unknowns):
        raise BrightfieldError(
            f"{type(chart.template).__name__} has {len(chart.unknowns)} unknowns here and must have more readings than "
            f"that; got {count} ({len(problem.samples)} usable samples, {problem.samples.f.shape[1]} channels). "
            f"({problem.samples.file})"
        )

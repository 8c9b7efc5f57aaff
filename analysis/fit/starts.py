"""Where a fit starts: many candidates, cheaply compared; the best are followed to their minima.

Shape parameters are spread over their bounds (Latin hypercube in the unknowns' own scale, McKay et al. 1979) with the
model's default among them; colours that enter linearly are solved for at each candidate. A model of several lobes
starts from its fit with one lobe less and a candidate lobe more, so that another lobe never makes a fit worse.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import qmc

from analysis.fit.unknowns import Chart, normalised
from interchange.brdf.base import Brdf
from interchange.brdf.lafortune import Lafortune
from interchange.parameter import Kind, parameters

PER_SHAPE = 20  # candidates for each number that shapes the reflectance

# a lobe may lie off the mirror direction (Cz / |Cxy| below 1: towards grazing), or go back to the lamp
LEANS = (0.0, 0.7, 0.9, 0.97, 1.0, 1.1, 1.5)
EXPONENTS = (1.5, 4.0, 10.0, 25.0, 60.0, 150.0, 400.0, 1500.0, 6000.0)


def candidates(chart: Chart, linear: np.ndarray, count: int, seed: int) -> Iterator[np.ndarray]:
    """Points (P,) of a chart, at most ``count``; its template's own values are the first."""
    low, high = chart.bounds
    yield chart.start()
    shape = ~linear
    if not shape.any() or count < 2:
        return
    # the channels of a colour that shapes the lobe (an index of refraction) move together
    groups = [u.name.rsplit(".", 1)[0] if u.color else u.name for u in chart.unknowns]
    keys = sorted({g for g, s in zip(groups, shape, strict=True) if s})
    cube = qmc.LatinHypercube(len(keys), rng=np.random.default_rng(seed))
    start = chart.start()
    for row in cube.random(min(count, PER_SHAPE * len(keys))):
        at = dict(zip(keys, row, strict=True))
        share = np.array([at.get(g, 0.0) for g in groups])
        yield np.where(shape, low + share * (high - low), start)


def lobed(model: type[Brdf], lobes: int, before: Brdf | None, rng: np.random.Generator) -> list[Brdf]:
    """Templates of a model to start from; for one with lobes, ``before`` (the fit with one lobe less) and one more."""
    if not any(p.per_lobe for p in parameters(model).values()):
        return [model()]
    if lobes == 0:
        return [_with_lobes(model, None, [])]
    if model is Lafortune:
        more = [
            {"weight": (0.1,) * 3, "C": _leaning(side, lean), "n": n}
            for n in EXPONENTS
            for side, lean in [(-1, q) for q in LEANS] + [(1, 1.0)]
        ]
    else:
        more = [_drawn_lobe(model, rng) for _ in range(24)]
    return [normalised(_with_lobes(model, before, [lobe])) for lobe in more]


def _leaning(side: int, lean: float) -> tuple[float, float, float]:
    return (side, side, lean) if lean <= 1 else (side / lean, side / lean, 1.0)


def _drawn_lobe(model: type[Brdf], rng: np.random.Generator) -> dict[str, Any]:
    drawn = model.drawn(rng, 1)
    lobe: dict[str, Any] = {}
    for name, about in parameters(model).items():
        if about.per_lobe:
            value = getattr(drawn, name)[0]
            lobe[name] = (float(np.mean(value)),) * 3 if about.kind is Kind.COLOR else value
    return lobe


def _with_lobes(model: type[Brdf], before: Brdf | None, more: list[dict[str, Any]]) -> Brdf:
    base = model() if before is None else before
    changed: dict[str, Any] = {}
    for name, about in parameters(model).items():
        if about.per_lobe:
            kept = () if before is None else getattr(before, name)
            changed[name] = (*kept, *(lobe[name] for lobe in more))
    return replace(base, **changed)  # type: ignore[type-var]

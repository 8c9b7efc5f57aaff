"""Cases that are simulated from the user's own scene, and what the diagnosis says of them.

A case is the scene with calibration's errors by lot, as large as they look, noise of the sensor's model, and, in
three of four, an effect of the catalogue of which anything else is drawn by lot as well. It goes through the same fit
as the captures. What no model has is in none of them: that is what sealed cases of another engine are for
(docs/blind.md).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.evidence.sureness import SUREST
from analysis.gap.judgement.attribution import CATALOGUED, called
from analysis.gap.judgement.rehearsal import Rehearsal, Rehearsed
from analysis.gap.light.knots import Knots
from analysis.gap.parallel import each
from analysis.gap.search.fit import Fit, fit
from analysis.gap.search.model import Model
from analysis.gap.search.search import Search
from analysis.gap.terms.base import Cause
from analysis.gap.terms.fall_off import falls
from interchange.captures import Tolerances

WITHOUT = 4  # one case in so many has no effect
TRIES = 100  # of numbers by lot, of which a third and more fall: a lens at its bound may have none that do
WEAKEST, STRONGEST = 0.004, 0.04  # rms of an effect over the signal


def rehearse(
    conditions: Sequence[Condition],
    tolerances: Tolerances,
    fitted: Fit,
    knots: Knots | None,
    count: int,
    rng: np.random.Generator,
    told: Callable[[str, float], None] = lambda what, share: None,
) -> Rehearsal:
    """``conditions``: those that ``fitted`` was fitted to, as the scene is written."""
    cases = []
    for k in range(count):
        told("rehearsal", k / count)
        cause = None if k % WITHOUT == WITHOUT - 1 else _cause(fitted, rng)
        severity = float(np.exp(rng.uniform(np.log(WEAKEST), np.log(STRONGEST)))) if cause else 0.0
        model = _drawn(conditions, fitted, knots, cause, severity, rng)
        found = fit(_captured(conditions, model, rng), tolerances, knots=knots)
        said: dict[str, float] = {}
        for c in found.best.causes:
            if c[0] in CATALOGUED:
                said[c[0]] = max(said.get(c[0], 0.0), min(found.probability[c], SUREST))
        truth = cause[0] if cause else ""
        exact = {name for name, _ in called(found)} == ({truth} if truth else set())
        cases.append(Rehearsed(truth, severity, said, exact))
    told("rehearsal", 1.0)
    return Rehearsal(tuple(cases))


def _cause(fitted: Fit, rng: np.random.Generator) -> Cause:
    """An effect with a name, all as often, and what it is about."""
    found: dict[str, list[Cause]] = {}
    for c in fitted.evidence.members:
        if c[0] in CATALOGUED:
            found.setdefault(c[0], []).append(c)
    targets = found[sorted(found)[rng.integers(len(found))]]
    return targets[rng.integers(len(targets))]


def _drawn(
    conditions: Sequence[Condition],
    fitted: Fit,
    knots: Knots | None,
    cause: Cause | None,
    severity: float,
    rng: np.random.Generator,
) -> Model:
    evidence, terms = fitted.evidence, fitted.terms
    theta = np.where(evidence.seen, evidence.spike * rng.standard_normal(len(terms)), 0.0)
    members = {}
    if cause is not None:
        index = members[cause] = evidence.members[cause]
        way = _way(evidence, cause, rng)
        metric = evidence.e.G[np.ix_(index, index)] / evidence.e.signal
        theta[index] += severity * way / max(float(np.sqrt(way @ metric @ way)), 1e-30)
    theta = np.maximum(theta, evidence.low)
    search = Search(conditions, terms, knots, lambda what, share: None)
    return Model(terms, theta, search.start(members, theta), knots)


def _way(evidence: Evidence, cause: Cause, rng: np.random.Generator) -> np.ndarray:
    """(k,): an effect's numbers by lot, to a factor, as an effect may have them: what vignets falls."""
    index, outwards = evidence.members[cause], evidence.fall_offs.get(cause)
    for _ in range(TRIES):
        way = rng.standard_normal(len(index)) * evidence.part[index] / evidence.together[index]
        way = np.where(np.isfinite(evidence.low[index]), np.abs(way), way)
        if outwards is None or falls(way[np.searchsorted(index, outwards)], np.zeros((2, 2))):
            break
    return way


def _captured(conditions: Sequence[Condition], model: Model, rng: np.random.Generator) -> list[Condition]:
    """The same conditions, of captures that are as the model says, with noise."""
    seeds = iter(rng.spawn(len(conditions)))
    fixed = {c.camera.name: rng.standard_normal(c.mean.shape) for c in conditions}

    def captured(both: tuple[Condition, np.random.Generator]) -> Condition:
        c, own = both
        state, dn = model.state(c), model.simulated(c)
        e = state.simulation
        noise = np.sqrt(e.temporal / len(c.captures)) * own.standard_normal(dn.shape)
        noise = noise + np.sqrt(e.fixed) * fixed[c.camera.name]
        return replace(c, mean=np.clip(dn + noise, 0, e.top), spread=None)

    return each(captured, list(zip(conditions, seeds, strict=True)))

"""What is called, and what that closes on captures that were held out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.finding import PRESENT
from analysis.gap.judgement.attribution import PATTERN, called
from analysis.gap.judgement.calling import (
    as_written_if_better,
    beside_structure,
    borne_out,
    no_worse,
    only_called,
    upheld,
)
from analysis.gap.measures.shrinkage import Gap, Yardstick, gap, yardstick
from analysis.gap.measures.structure import FORMS, FORMS_OF_LOBES, Structure, structure
from analysis.gap.noise.finding import NoiseFinding
from analysis.gap.noise.pixel_map import PixelMaps, pixel_maps
from analysis.gap.search.fit import Fit
from analysis.gap.terms.base import LOBES, Cause
from analysis.gap.terms.normal_equations import SIGNAL
from interchange.problems import BrightfieldError


@dataclass(frozen=True, eq=False)
class Simulations:
    """What is expected of each held-out condition, (H, W, C) DN each: see analysis.gap.measures.shrinkage."""

    as_written: tuple[np.ndarray, ...]
    before: tuple[np.ndarray, ...]
    after: tuple[np.ndarray, ...]


@dataclass(frozen=True, eq=False)
class Verdict:
    """``corrected``: of every condition, (H, W, C) DN, as ``fitted`` says; ``after`` the same of those held out,
    without the ``maps`` of a fixed pattern. ``times`` as much structure as is usual is left, which is ``structured``
    probable to have a cause without a name (analysis.gap.measures.structure)."""

    fitted: Fit
    corrected: Sequence[np.ndarray]
    after: list[np.ndarray]
    by: Yardstick
    maps: PixelMaps | None
    shown: Simulations
    gap: Gap
    left: Structure | None
    times: float
    structured: float


def verdict(
    fitted: Fit,
    conditions: Sequence[Condition],
    corrected: Sequence[np.ndarray],
    judged: Sequence[NoiseFinding],
    scale: float,
    off: float = SIGNAL,
) -> Verdict:
    """``corrected``: as ``fitted`` says so far; ``off``: share of the signal that the twin is off by. Causes that are
    not called leave, and what is left is looked at again, until all that are left are called. Raises BrightfieldError
    where nothing can be compared."""
    held = [c for c in conditions if c.held_out]
    told = partial(_told, conditions, judged, scale, off)
    fitted_to = [c for c in conditions if not c.held_out]

    def at_its_best(sure: Fit, was: Fit) -> Fit:
        return sure if sure.before is was.before or not called(sure) else no_worse(fitted_to, sure)

    sure = at_its_best(borne_out(fitted, held, judged, scale), fitted)
    if sure.after is not fitted.after:
        corrected = sure.after.simulations(conditions)
    while True:
        found = told(sure, corrected)
        left = found.left.unnamed(_removed(found)) if found.left else 0.0
        doubted = beside_structure(sure, left, found.structured)
        gone = [c for c in called(sure) if c not in called(doubted)]
        if not gone:
            break
        # those that stay are as probable as they were, until they are held against what is left then
        less = {c: doubted.probability[c] for c in gone}
        fewer = only_called(replace(sure, probability={**sure.probability, **less}))
        sure = upheld(at_its_best(fewer, sure), held, found.by)  # it stands elsewhere without them
        corrected = sure.after.simulations(conditions)
    if called(doubted):
        return replace(found, fitted=doubted)
    written = as_written_if_better(doubted, held, found.by)
    if written is doubted:
        return replace(found, fitted=doubted)
    return told(written, written.after.simulations(conditions))


def against(v: Verdict, written: Sequence[np.ndarray]) -> Verdict:
    """The verdict where the file at its best is as it is ``written``, (H, W, C) DN of each held-out condition: all that
    was taken for known before anything was fitted has been closed as well."""
    shown = replace(v.shown, as_written=tuple(written), before=tuple(written))
    shrunk = gap(v.by, shown.as_written, shown.before, shown.after, np.random.default_rng(0))
    return replace(v, shown=shown, gap=shrunk)


def further(v: Verdict, off: Sequence[np.ndarray]) -> Verdict:
    """The verdict where the file is ``off``, (H, W, C) DN of each held-out condition, from what was fitted to, and at
    its best as well."""
    written, before = (
        tuple(dn + x for dn, x in zip(shown, off, strict=True))
        for shown in (v.shown.as_written, v.shown.before)
    )
    shown = replace(v.shown, as_written=written, before=before)
    return replace(v, shown=shown, gap=gap(v.by, written, before, v.shown.after, np.random.default_rng(0)))


def _removed(v: Verdict) -> float:
    """Mean χ² that effects with a name take off; that of other lobes as many times as their formulas may leave more of
    it than others'."""
    kept = called(v.fitted)
    lobes = [c for c in kept if c[0] in LOBES]
    share = _changed(v.fitted, lobes) / max(_changed(v.fitted, kept), 1e-30) if lobes else 0.0
    return (v.gap.before**2 - v.gap.after**2) * (1 + share * (FORMS_OF_LOBES / FORMS - 1))


def _changed(fitted: Fit, causes: Sequence[Cause]) -> float:
    """σ²: what the causes change, each by itself."""
    e, theta = fitted.evidence.e, fitted.after.theta
    own = [fitted.evidence.members[c] for c in causes]
    return sum(float(theta[i] @ e.G[np.ix_(i, i)] @ theta[i]) for i in own)


def _told(
    conditions: Sequence[Condition],
    judged: Sequence[NoiseFinding],
    scale: float,
    off: float,
    fitted: Fit,
    corrected: Sequence[np.ndarray],
) -> Verdict:
    held = [c for c in conditions if c.held_out]
    after = [dn for c, dn in zip(conditions, corrected, strict=True) if c.held_out]
    by = yardstick(held, after, scale)
    pattern = any(n.name == PATTERN and n.probability >= PRESENT for n in judged)
    maps = pixel_maps(conditions, corrected) if pattern else None
    shown = Simulations(
        tuple(c.simulated().dn for c in held),
        tuple(fitted.before.simulations(held)),
        tuple(maps.applied(held, after) if maps else after),
    )
    if not any(ok.any() for ok in by.ok):
        raise BrightfieldError(
            "No pixel of the held-out captures can be compared: all are masked, saturated or cut off at DN 0."
        )
    shrunk = gap(by, shown.as_written, shown.before, shown.after, np.random.default_rng(0))
    left = structure(conditions, corrected, off)
    found = Verdict(fitted, corrected, after, by, maps, shown, shrunk, left, 0.0, 0.0)
    if left is None:
        return found
    times, structured = left.unexplained(_removed(found))
    if any(n.probability >= PRESENT for n in judged):
        structured = 0.0  # uneven lines and pixels are no light's
    return replace(found, times=times, structured=structured)

"""Which causes are called: those that are probable, and that captures held out bear out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.evidence.caution import left_over
from analysis.gap.finding import PRESENT
from analysis.gap.judgement.attribution import called, lacking
from analysis.gap.judgement.tolerated import within_tolerances
from analysis.gap.measures.shrinkage import Images, Yardstick, yardstick
from analysis.gap.noise.finding import NoiseFinding
from analysis.gap.parallel import each
from analysis.gap.search.fit import WORTH, Fit
from analysis.gap.search.model import Model
from analysis.gap.terms.base import added
from analysis.gap.terms.generic import CAPTURE
from analysis.gap.terms.normal_equations import stride_for

KEPT = 0.25  # of what an effect claims on held-out captures: with less, its slope there is under 0.63
SEEN = 16.0  # sigma²: of less noise hides half


def borne_out(fitted: Fit, held: Sequence[Condition], judged: Sequence[NoiseFinding], scale: float) -> Fit:
    """What is called, and held-out captures bear out as it stands without the rest."""
    sure = only_called(beside_left_over(fitted, judged))
    by = yardstick(held, sure.after.simulations(held), scale)
    found = upheld(sure if sure.after is fitted.after else confirmed(sure, held, by), held, by)
    return found if found is sure else only_called(beside_left_over(found, judged))


def confirmed(fitted: Fit, held: Sequence[Condition], by: Yardstick) -> Fit:
    """Less the causes, with a name or without, that the held-out captures refute; what is left over is told anew then.

    What a cause changes there, δ, would take off Σ δ² / σ² if it were all true, and takes off 2 β - 1 of that, β the
    slope of what captures have beyond the others on δ. Where that is less than ``KEPT``, most of it is not there; one
    that would not be seen there either way is not judged.
    """
    drift = _drift(fitted)
    while True:
        best, after = fitted.best, fitted.after.simulations(held)
        left = {}
        for cause in best.causes:
            if best.causes == (cause,):  # then what the file claims at its best is all that is left
                less = fitted.before.simulations(held)
            else:
                less = lacking(fitted, [cause]).simulations(held)
            left[cause] = taken_off(by, less, after, drift)
        worst = min(left, key=lambda c: left[c], default=None)
        if worst is None or left[worst] >= KEPT:
            return fitted
        fewer = best.of([c for c in best.causes if c != worst])
        fitted = replace(
            fitted,
            after=lacking(fitted, [worst]) if fewer.causes else fitted.before,
            hypotheses=(fewer, *fitted.hypotheses),
            probability={**fitted.probability, worst: 0.0},
            refuted=(*fitted.refuted, worst),
            left_over=left_over(fitted.weighed, fewer),
        )


def no_worse(fitted_to: Sequence[Condition], fitted: Fit) -> Fit:
    """With the file as written as ``before`` where that fits better (the pixels that were fitted to) than what the
    effects leave of calibration's errors: those go with the effects."""
    if not fitted.best.causes:
        return fitted

    stride, model = stride_for(fitted_to), fitted.before

    def left(c: Condition) -> list[float]:
        state, written = model.state(c, stride), c.simulated()
        ok, variance, mean = (state.take(x) for x in (c.usable(written), written.variance, c.mean))
        before = state.take(state.simulation.dn) + added(state, model.terms, model.theta - model.at)
        return [float(((mean - dn)[ok] ** 2 / variance[ok]).sum()) for dn in (state.take(written.dn), before)]

    as_written, before = np.sum(each(left, fitted_to), axis=0)
    if before <= as_written:
        return fitted
    zero = np.zeros(len(fitted.terms))
    return replace(fitted, before=Model(fitted.terms, zero, zero, fitted.before.knots))


def upheld(fitted: Fit, held: Sequence[Condition], by: Yardstick) -> Fit:
    """Without any cause where all that is called makes the held-out captures surely worse than the file at its best
    does, or than the file as written: what calibration may be off by was fitted beside them. Captures that would not
    show it either way, as a lamp's that is off in all of them, say nothing of it; nor do those that are no worse with
    than without it once calibration is as they show it too, as far as captures that were fitted to leave that open
    (analysis.gap.judgement.tolerated)."""
    kept = called(fitted)
    if not kept:
        return fitted
    written = [c.simulated().dn for c in held]
    before, after = (model.simulations(held) for model in (fitted.before, fitted.after))
    drift = _drift(fitted)
    if _off(by, before, after, drift)[2] < SEEN:
        return fitted
    if not any(_surely_worse(by, after, other, drift) for other in (before, written)):
        return fitted
    without, told = (within_tolerances(fitted, held, causes).simulations(held) for causes in ((), kept))
    if not any(_surely_worse(by, told, other, drift) for other in (without, written)):
        return replace(fitted, tolerated=by.chi2(told) ** 0.5)
    nothing = fitted.best.of(())
    return replace(
        fitted,
        after=fitted.before,
        hypotheses=(nothing, *fitted.hypotheses),
        probability={**fitted.probability, **dict.fromkeys(kept, 0.0)},
        refuted=(*fitted.refuted, *kept),
        left_over=left_over(fitted.weighed, nothing),
    )


def beside_structure(fitted: Fit, left: float, probable: float) -> Fit:
    """The causes beside what has structure and no name, ``left`` σ² of a value, which is ``probable`` to have a cause:
    as beside what is left over, and no more than structure is."""
    return _beside(fitted, left, probable) if left > 0 else fitted


def only_called(fitted: Fit) -> Fit:
    """With what is too improbable to be called at what calibration leaves of it, and all else as it is then, before and
    after: it closes nothing, and what is called closes no more than it does itself. Where nothing is called, what is
    taken for a larger error of the calibration than was declared is one: the file at its best has it, before and after;
    and where calibration's errors explain everything, that is as they do."""
    best, kept = fitted.best, called(fitted)
    if len(kept) == len(best.causes):
        return fitted
    if not kept:
        larger = fitted.larger_errors
        alone = larger or fitted.probability_of_none >= PRESENT
        nothing = fitted.stood(best.of(larger)) if alone else fitted.before
        return replace(fitted, before=nothing, after=nothing)
    sure = replace(fitted, after=fitted.stood(best.of(kept)))
    return replace(sure, before=lacking(sure, kept))


def less_what_is_slight(fitted: Fit) -> Fit:
    """As ``only_called`` where nothing is probable and what there may be gains little, before anything is told of it.
    What gains more may be called yet, when it is weighed by the noise that captures show beside it."""
    return fitted if called(fitted) or fitted.gain >= WORTH else only_called(fitted)


def as_written_if_better(fitted: Fit, held: Sequence[Condition], by: Yardstick) -> Fit:
    """Where nothing is called: with the file as written at its best where the held-out captures are surely simulated
    better so than with what the others say of the calibration."""
    written = [c.simulated().dn for c in held]
    if not _surely_worse(by, fitted.before.simulations(held), written, _drift(fitted)):
        return fitted
    zero = np.zeros(len(fitted.terms))
    nothing = Model(fitted.terms, zero, zero, fitted.before.knots)
    return replace(fitted, before=nothing, after=nothing)


def _drift(fitted: Fit) -> float:
    """Standard deviation of a capture's own gain, which says nothing of any effect
    (analysis.gap.measures.shrinkage)."""
    own = [i for i, t in enumerate(fitted.terms) if t.cause == CAPTURE]
    return float(fitted.weighed.spike[own].max()) if own else 0.0


def _surely_worse(by: Yardstick, one: Images, other: Images, drift: float) -> bool:
    """Whether ``one`` leaves more of the captures than ``other``, by twice the standard error (of blocks)."""
    off, error, _ = _off(by, other, one, drift)
    return off < -2 * error


def taken_off(by: Yardstick, before: Images, after: Images, drift: float = 0.0) -> float:
    """What ``after`` takes off the mean χ² of ``before``, over what it would if all of it were true; 1 where that
    would not be seen (less than twice its standard error by blocks)."""
    off, error, wanted = _off(by, before, after, drift)
    return 1.0 if wanted < max(2 * error, SEEN) else off / wanted


def _off(by: Yardstick, before: Images, after: Images, drift: float) -> tuple[float, float, float]:
    """What ``after`` takes off the χ² of ``before``, its standard error, and what it would if all of it were true."""
    _, shown, claimed = by.claims(before, after, drift).T
    off = 2 * shown - claimed
    return float(off.sum()), float(np.std(off) * np.sqrt(len(off))), float(claimed.sum())


def beside_left_over(fitted: Fit, noise: Sequence[NoiseFinding]) -> Fit:
    """The causes beside what is left without one: less probable by E / (E + E_left), as beside what has no name
    (analysis.gap.evidence.belief.believed). Where the noise is not what the sensor's model says, what is left is
    that."""
    more, probable = fitted.left_over
    if any(n.probability >= PRESENT for n in noise):
        return replace(fitted, left_over=(more, 0.0))
    if probable < PRESENT:
        return fitted
    return _beside(fitted, more, probable)


def _beside(fitted: Fit, left: float, probable: float) -> Fit:
    e, theta, out = fitted.evidence.e, fitted.after.theta, dict(fitted.probability)
    for cause in fitted.best.causes:
        index = fitted.evidence.members[cause]
        own = float(theta[index] @ e.G[np.ix_(index, index)] @ theta[index])
        out[cause] = out.get(cause, 0.0) * own / max(own + probable * left * e.count, 1e-30)
    return replace(fitted, probability=out)

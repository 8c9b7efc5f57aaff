"""The calibration as captures that were held out show it too, within what those that were fitted to leave open.

A lamp's place that none of the captures which were fitted to shows well is known to its tolerance only. What it is off
by is seen in the captures that were held out, is no effect, and no effect is to blame for it.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.parallel import each
from analysis.gap.search.fit import Fit
from analysis.gap.search.model import Model
from analysis.gap.terms.base import Cause
from analysis.gap.terms.normal_equations import NormalEquations, equations, stride_for, total_of

FIXED = 1e-3  # of its tolerance, that what a cause changes may be off by: nothing


def within_tolerances(fitted: Fit, held: Sequence[Condition], causes: Collection[Cause]) -> Model:
    """``causes`` as fitted, no other, and calibration's errors as likely as all captures make them, those that are
    ``held`` out included:

        θ = θ_c + (G + G_held + P)⁻¹ (b + b_held - (G + G_held) θ_c),     θ_c: of the causes, zero elsewhere
    """
    model = fitted.after if causes else fitted.before
    stride = stride_for(held)

    def of(condition: Condition) -> NormalEquations | None:
        state = model.state(condition, stride, symmetric=True)
        return equations(state, fitted.terms, model.at) if state.usable.any() else None

    shown = [part for part in each(of, held, shared=lambda c: id(c.shown)) if part is not None]
    fixed = np.zeros(len(fitted.terms), bool)
    for c in causes:
        fixed[fitted.evidence.members[c]] = True
    of_causes = np.where(fixed, model.theta, 0.0)
    both = total_of((*fitted.parts, *shown))
    joint = Evidence(replace(both, b=both.b - both.G @ of_causes), fitted.terms)
    tolerance = np.where(fitted.evidence.seen, fitted.evidence.spike, joint.spike)
    told = joint.with_spikes(np.where(fixed, FIXED, 1.0) * tolerance)
    return replace(model, theta=of_causes + told.theta(fitted.best.of(())), beside=None)

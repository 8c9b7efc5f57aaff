"""From which severity on the captures would show each effect: what "none" means.

For an effect of rms s over the signal, and no other error, the evidence for it over none grows as

    Δ log Z(s) = s² gain - cost,      shown where  Δ log Z + log prior odds >= log(p / (1 - p)),  p = SURE

with cost what its freedom is charged (Occam's factor), gain what its pattern adds to the fit that tolerances cannot.

MacKay: Bayesian interpolation. Neural Computation 1992.
"""

from dataclasses import dataclass, replace

import numpy as np

from analysis.gap.evidence import SLABS, Cause, Evidence
from analysis.gap.normal_equations import NormalEquations

SURE = 0.9
MOST = 0.5  # rms over the signal: what would not show there is told as never
UNIT = 0.05  # of the signal, that gains are measured at


@dataclass(frozen=True)
class Detectable:
    """``severity``: rms over the signal from which on ``cause`` would be found; inf: never."""

    cause: Cause
    severity: float


def detectable(evidence: Evidence) -> tuple[Detectable, ...]:
    """Every effect with a name, the easiest first; of an effect that is about several things, the easiest of them."""
    alone = Quiet(evidence)
    found: dict[str, Detectable] = {}
    for cause, index in evidence.members.items():
        if not evidence.terms[index[0]].generic:
            severity = min(alone.severity(cause, i) for i in index)
            if cause[0] not in found or severity < found[cause[0]].severity:
                found[cause[0]] = Detectable(cause, severity)
    return tuple(sorted(found.values(), key=lambda d: d.severity))


class Quiet:
    """The evidence of captures that are what the scene says but for one effect."""

    def __init__(self, evidence: Evidence) -> None:
        self.evidence = evidence
        self.nothing = _seen(evidence, np.zeros(len(evidence.spike)))

    def severity(self, cause: Cause, term: int) -> float:
        """Of ``cause`` by its ``term`` alone."""
        e = self.evidence
        size = UNIT / e.share[term]
        there = _seen(e, e.e.G[:, term] * size)
        gain = cost = 0.0
        best = np.inf
        for slab in SLABS:
            none, quiet = there.at((), ()), self.nothing.at((), ())
            one, idle = there.at((cause,), (slab,)), self.nothing.at((cause,), (slab,))
            cost = quiet.score - idle.score
            gain = (one.score - none.score) + cost  # of UNIT²
            if np.isfinite(gain) and gain > 0:
                best = min(best, UNIT * float(np.sqrt((cost + np.log(SURE / (1 - SURE))) / gain)))
        return best if best <= MOST else np.inf


def _seen(evidence: Evidence, b: np.ndarray) -> Evidence:
    """The same terms where the captures say ``b`` = X' W r."""
    out: Evidence = object.__new__(Evidence)
    out.__dict__.update(evidence.__dict__)
    equations: NormalEquations = replace(evidence.e, b=b)
    out.e, out.known, out.in_force = equations, {}, ()
    z = evidence.C @ (b * evidence.spike)
    out.straight = {frozenset(): (z, 0.5 * float(b * evidence.spike @ z))}
    return out

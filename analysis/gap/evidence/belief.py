"""How probable each cause is, by all hypotheses that have it, and where experience says that they are too sure."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import combinations
from types import MappingProxyType

import numpy as np

from analysis.gap.evidence.likelihood import Evidence, Hypothesis
from analysis.gap.terms.base import Cause
from analysis.gap.terms.form import SHARE

MISSED = 0.0125  # of what strong effects change: an eighth of SHARE, that no modulation of their formulas has
UNDONE = 0.5  # of what the stronger of two changes: where less is left of both, they are in doubt


def posterior(hypotheses: Sequence[Hypothesis]) -> dict[Cause, float]:
    """Probability of each cause: of all hypotheses that have it."""
    score = np.array([h.score for h in hypotheses])
    p = np.exp(score - score.max())
    p /= p.sum()
    out: dict[Cause, float] = {}
    for h, share in zip(hypotheses, p, strict=True):
        for cause in h.causes:
            out[cause] = out.get(cause, 0.0) + float(share)
    return out


def in_its_place(
    hypotheses: Sequence[Hypothesis], causes: Sequence[Cause], cause: Cause, named: Collection[Cause]
) -> float:
    """The probability that there is ``cause`` or, beside the other ``causes``, another ``named`` one in its place, over
    that of ``cause``: captures that do not tell a white balance from the colour of the one material that they show
    still tell that it is one of the two."""
    rest = set(causes) - {cause}
    own = others = 0.0
    for h in hypotheses:
        p, has = float(np.exp(h.score - hypotheses[0].score)), set(h.causes)
        if cause in has:
            own += p
        elif rest < has and has - rest <= set(named):
            others += p
    return (own + others) / own if own else 1.0


def gained(evidence: Evidence, h: Hypothesis) -> dict[Cause, float]:
    """Of log Z, by each cause of a hypothesis beside its others."""
    out = {}
    for k, c in enumerate(h.causes):
        rest = evidence.at((*h.causes[:k], *h.causes[k + 1 :]), (*h.slabs[:k], *h.slabs[k + 1 :]))
        out[c] = h.log_Z - rest.log_Z
    return out


def believed(
    probability: dict[Cause, float],
    causes: Sequence[Cause],
    evidence: Evidence,
    theta: np.ndarray,
    gains: Mapping[Cause, float] = MappingProxyType({}),
) -> dict[Cause, float]:
    """The probabilities of ``causes``, lower where experience says that the evidence is too sure:

        p E / (E + E_unknown)                        of an effect beside something without a name, as it outweighs that
        p E / (E + SHARE² E_named)                   of that beside effects, whose formulas may miss a share of what
                                                     they change (analysis.gap.terms.form)
        p / (1 + MISSED² E_others / 2 g)             of an effect that gains g in log Z beside others, whose formulas
                                                     may miss what no slow modulation has
        p min(1, 2 |Δ + Δ_o|² / max(|Δ|², |Δ_o|²))   where some of the others undo more than half of what it changes

    Δ: what a cause changes, Δ_o: what others of the named ones do together (of all choices of them the worst), in the
    metric of W; E = |Δ|². A weak effect may lean against a strong one: it undoes little of that. On cases whose cause
    was known, an effect that was called beside a stronger unknown was right one time in eight, and effects that undid
    each other never (docs/diagnosis_method.md).
    """
    if not causes:
        return probability
    generic = {c: evidence.terms[evidence.members[c][0]].generic for c in causes}

    G = evidence.e.G

    def energy(chosen: Iterable[Cause]) -> float:
        index = np.concatenate([members[c] for c in chosen])
        return max(float(theta[index] @ G[np.ix_(index, index)] @ theta[index]), 1e-30)

    members = {c: evidence.members[c] for c in causes}
    named = [c for c in causes if not generic[c]]
    unknown = sum(energy([c]) for c in causes if generic[c])
    out = dict(probability)
    for c in named:
        own, rest = energy([c]), [d for d in named if d != c]
        others = [chosen for k in range(1, len(named)) for chosen in combinations(rest, k)]
        undone = [energy([c, *chosen]) / max(own, energy(chosen)) for chosen in others]
        out[c] *= min([1.0, *(x / UNDONE for x in undone)]) * own / (own + unknown)
        if c in gains:
            gain = max(2 * gains[c], 1e-30)  # without bound where the others alone cannot be
            out[c] /= 1 + MISSED**2 * sum(energy([d]) for d in rest) / gain
    missed = SHARE**2 * sum(energy([c]) for c in named)
    for c in (c for c in causes if generic[c]):
        out[c] *= energy([c]) / (energy([c]) + missed)
    return out

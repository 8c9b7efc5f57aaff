"""The hypotheses of an evidence that are worth weighing, among the sets of causes that there may be.

All single causes are weighed, pairs of the best, and whatever the best set becomes by one cause more, less, or another.
"""

from collections.abc import Iterable
from itertools import combinations

import numpy as np

from analysis.gap.evidence.likelihood import TAU, Evidence, Hypothesis
from analysis.gap.terms.base import Cause

TOP = 12  # causes that are tried in pairs with all others
MOST = 5  # causes of a hypothesis
MOST_GENERIC = 2  # of them without a name
ENOUGH = 3.0  # gain of log Z that keeps a further cause


def best_first(evidence: Evidence) -> list[Hypothesis]:
    """None, singles, pairs of the best with all; then the best one changed by one cause as long as that helps,
    and all parts of it. Best first."""
    none = evidence.at((), ())
    singles = [evidence.best((c,), {}) for c in evidence.members]
    singles.sort(key=lambda h: -h.score)
    # what cannot be by itself (a path beside a blur would be no path) has no width of its own
    alone = [h for h in singles if np.isfinite(h.log_Z)]
    width = {h.causes[0]: h.slabs[0] for h in alone}
    found: dict[tuple[Cause, ...], Hypothesis] = {h.causes: h for h in [none, *singles]}

    def tried(causes: Iterable[Cause]) -> Hypothesis | None:
        causes = tuple(sorted(causes))
        first = [evidence.terms[evidence.members[c][0]] for c in causes]
        names = [t.cause for t in first]
        apart = any((t.form and names.count(t.cause) > 1) or set(t.against) & set(names) for t in first)
        if apart or sum(t.generic for t in first) > MOST_GENERIC:
            return None
        if causes not in found:
            found[causes] = evidence.best(causes, width)
        return found[causes]

    def beside(causes: tuple[Cause, ...]) -> list[Hypothesis | None]:
        """``causes`` with one more."""
        evidence.lean(causes, width)
        return [tried((*causes, c)) for c in evidence.members if c not in causes]

    if alone and alone[0].score > none.score:
        for h in alone[:TOP]:
            beside(h.causes)
    current = max(found.values(), key=lambda h: h.score)
    for _ in range(2 * MOST):
        now = current.causes
        width = dict(zip(now, current.slabs, strict=True)) | width
        near = beside(now) if len(now) < MOST else []
        best = _best(near)
        if best is None or best.score <= current.score + ENOUGH / TAU:
            rests = [tuple(c for c in now if c != gone) for gone in now if len(now) > 1]
            near = [tried(rest) for rest in rests]
            for rest in rests:
                near += beside(rest)
            best = _best(near)
            if best is None or best.score <= current.score:
                break
        current = best
    evidence.lean()
    # widths that fit the causes together
    again = evidence.best(current.causes, {})
    if again.score > current.score:
        current = found[current.causes] = again
    for size in range(len(current.causes) - 1, 0, -1):
        for fewer in combinations(current.causes, size):
            tried(fewer)
    return sorted(found.values(), key=lambda h: -h.score)


def _best(hypotheses: Iterable[Hypothesis | None]) -> Hypothesis | None:
    return max((h for h in hypotheses if h is not None), key=lambda h: h.score, default=None)

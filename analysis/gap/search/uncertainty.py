"""How well a fit knows its numbers: formally, by what is in doubt, and by leaving conditions out."""

from collections.abc import Sequence

import numpy as np

from analysis.gap.search.fit import Fit


def uncertainty(found: Fit) -> np.ndarray:
    """(q,): standard deviation of every term under the best hypothesis: the formal one, where the causes' formulas are
    in doubt, and what leaving out a condition after the other shows (the jackknife), which sees errors that pixels
    share.

    Efron: The jackknife, the bootstrap and other resampling plans. SIAM 1982.
    """
    best = found.best
    wide = sorted({i for c in best.causes for i in found.evidence.members[c]})
    formal = np.maximum(found.evidence.sigma(best), found.doubted)
    formal[wide] = np.hypot(formal[wide], found.evidence.spike[wide])
    if not len(found.left_out):
        return formal
    return np.asarray(np.sqrt(formal**2 + found.left_out.var(axis=0) * (len(found.left_out) - 1)))


def uncertainty_of_sum(found: Fit, index: Sequence[int]) -> float:
    """The same of the sum of some of a cause's terms, which go together."""
    along, padded = np.zeros(len(found.terms)), np.zeros(len(found.weighed.terms))
    along[index] = padded[index] = 1.0
    best = found.best
    formal = max(found.evidence.variance(best, along), found.weighed.variance(best, padded))
    spread = (found.left_out @ along).var() * (len(found.left_out) - 1) if len(found.left_out) else 0.0
    return float(np.sqrt(max(formal, 0.0) + float(np.square(found.evidence.spike[index]).sum()) + spread))

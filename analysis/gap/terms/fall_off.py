"""A vignetting is a fall-off: what it takes it gives back nowhere further out.

Its two numbers, a2 u + a4 u² at u = r², fit a ring as well, darker halfway out and as bright in the corners as in the
middle, which no pupil makes and an uneven field that calibration leaves does: of ten vignettings that were called in
103 blind cases (2026-11-24q) the six that were not there rose again by all that they had fallen, or more, and of the
true ones none by more than 0.03 of it.
"""

from collections.abc import Callable, Sequence

import numpy as np

from analysis.gap.terms.base import Cause, Term
from interchange.effects.vignetting import Vignetting

Covariance = Callable[[np.ndarray], np.ndarray]

RISES = 0.2  # of its fall that a fall-off may rise by: an aperture's, flat and then steep, is 0.11 at most in two terms


def fall_offs(terms: Sequence[Term]) -> dict[Cause, np.ndarray]:
    """Of every cause that is one, its numbers of second and of fourth order."""
    found: dict[Cause, dict[str, int]] = {}
    for k, t in enumerate(terms):
        if t.cause == Vignetting.name():
            found.setdefault(t.candidate, {})[t.parameter] = k
    return {c: np.array([own["a2"], own["a4"]]) for c, own in found.items() if {"a2", "a4"} <= set(own)}


def falls(numbers: np.ndarray, covariance: np.ndarray) -> bool:
    """Whether a2 and a4 (2,), known to ``covariance`` (2, 2), may be a fall-off's: from the middle to the corner it
    rises by no more than ``RISES`` of what it falls and the rise's standard deviation."""
    a2, a4 = (float(x) for x in numbers)
    turn = -a2 / (2 * a4) if a4 else -1.0
    ends = [0.0, turn, 1.0] if 0 < turn < 1 else [0.0, 1.0]
    steps = np.diff([[u, u * u] for u in ends], axis=0)  # (n, 2)
    change = steps @ numbers
    up = steps[change > 0].sum(axis=0)
    sigma = float(np.sqrt(max(up @ covariance @ up, 0.0)))
    return bool(up @ numbers <= RISES * -change[change < 0].sum() + sigma)


def without_rises(
    probability: dict[Cause, float], terms: Sequence[Term], theta: np.ndarray, covariance: Covariance
) -> dict[Cause, float]:
    """The probabilities of causes, nothing of those whose numbers ``theta`` (q,), as the formulas alone have them, are
    no fall-off's. ``covariance(index)`` (n, n): of some of the terms."""
    out = dict(probability)
    for cause, index in fall_offs(terms).items():
        written = np.array([terms[i].start for i in index])
        if theta[index].any() and not falls(written + theta[index], covariance(index)):
            out[cause] = 0.0
    return out

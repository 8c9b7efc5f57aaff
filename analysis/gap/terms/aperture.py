"""A blur as small as that of pixels whose aperture is no square may be one: no capture tells it from a lens's.

Pixels are taken as means over their squares, whose variance is 1/12 px² along each way. Charge that spreads to
neighbours, and the filters that other renderers draw with (a Gaussian of 0.45 to 0.5 px), are wider, by 0.12 to
0.17 px². With p0 the probability that pixels are not as said, before any capture, and a half-normal distribution of
what their variance adds, a defocus of variance v keeps (p0 is a guess; v0 is what the blind engine's other filter adds)

    p / (1 + odds),   odds = p0 / (1 - p0) min(1, exp(½ - ½ (v / v0)²))
"""

from collections.abc import Iterable, Sequence

import numpy as np

from analysis.gap.terms.base import Cause, Term
from analysis.gap.terms.uneven_blur import most

P0, V0 = 0.3, 0.12  # px²
TOLD = 0.9  # of what a defocus keeps: what keeps less is told
DEFOCUS = ("defocus", "blur")
TELLING = "a slanted edge at two focus distances"


def kept(variance: float) -> float:
    """The share of its probability that a defocus of ``variance`` px² keeps."""
    odds = P0 / (1 - P0) * min(1.0, float(np.exp(0.5 - 0.5 * (variance / V0) ** 2)))
    return 1 / (1 + odds)


def without_apertures(
    probability: dict[Cause, float], terms: Sequence[Term], theta: np.ndarray
) -> dict[Cause, float]:
    """Probabilities of causes, that of a defocus with what may be an aperture taken off."""
    v = variance(terms, theta)
    return {c: p * (kept(v) if c[0] == DEFOCUS[0] and v > 0 else 1.0) for c, p in probability.items()}


def may_be_one(causes: Iterable[Cause], variance: float) -> bool:
    """Whether the defocus among ``causes``, of ``variance`` px², is so small."""
    return any(c[0] == DEFOCUS[0] for c in causes) and variance > 0 and kept(variance) < TOLD


def variance(terms: Sequence[Term], theta: np.ndarray) -> float:
    """px² of the largest defocus among ``theta`` (q,) of ``terms``, with what it differs by over the image: pixels are
    alike everywhere. 0 where there is none."""
    found: dict[str, dict[str, float]] = {}
    for t, x in zip(terms, theta, strict=True):
        if t.cause == DEFOCUS[0]:
            found.setdefault(t.target, {})[t.parameter] = float(x)
    return max([0.0, *(values.get(DEFOCUS[1], 0.0) + most(values) for values in found.values())])

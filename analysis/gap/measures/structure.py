"""Whether what is left has structure: covariance of (mean of captures - simulated) / σ with itself a few pixels on.

Noise of pixels, a sensor's as a path tracer's, is white: pixels share none of it. What an effect leaves is smooth, or
follows surfaces: pixels near each other share most of it. Away from edges,

    S_d = mean of z(u) z(u + d) along columns and along rows, d = 1, 2, 4, 8 px,      W = mean of z² - 1 - S_1

In units of the sensor's variance of a condition's mean; 0 where nothing but noise is left.

No twin is exact: it is off by some 0.2 % of the signal (``SIGNAL``) where its flat field is declared to 0.3 %, as in
all figures below, and by as much more as that is declared more coarsely: only waves of it are fitted, and what is finer
stays. That gives E = mean of (off s)² / σ², and of JPEGs the S_2 of what compressing the simulation leaves.
Captures without any effect leave S_2 of E, more or less; what has a cause without a name leaves more. Nulls and right
answers of a rehearsal set of 76 cases of five scenes (forms and errors by somebody else) left 0.2 to 2.8 times E, its
cases outside the catalogue 8 to 1300 times. From 4.1 times on it is called; it was 5.3 before channels had black levels
and flat fields of their own, when nulls of three sealed sets left 0.35 to 3.4 times E and 31 such cases 3.0 to 395. On
the sealed set 2026-11-25t, which came after, 19 nulls left 0.3 to 3.2 times E and 14 such cases 3.5 to 290.
What effects that are strong leave by their formulas, ``FORMS`` of what they take off, is none of it; of other lobes
it is ``FORMS_OF_LOBES``: lamps show as much of them as a formula says (analysis.gap.evidence.caution).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from analysis.gap.compared.conditions import Condition
from analysis.gap.evidence.caution import OUTSIDE
from analysis.gap.noise.fixed_pattern import flat
from analysis.gap.parallel import each
from analysis.gap.terms.normal_equations import SIGNAL
from interchange.captures import Tolerances

FLAT = 0.003  # of a flat field's tolerance, up to which a twin is off by ``SIGNAL``
STEPS = (1, 2, 4, 8)  # px
FEWEST = 2000  # pairs of values of all conditions: their mean product is known to 0.02 of σ² or better
AT = STEPS.index(2)  # a pixel further than what a lens or an interpolation shares
FORMS = 0.05  # of what effects with a name take off, that their formulas may leave
FORMS_OF_LOBES = (
    0.16  # of other lobes; amounts that differ by 0.8 from lamp to lamp would leave four times as much
)
USUAL, USUALLY = 0.1, 0.5  # log of S over E where there is no effect: mean and standard deviation
CAUSED, LARGELY = 2.3, 1.2  # the same where something without a name is left


@dataclass(frozen=True)
class Structure:
    """``white``: beyond the sensor's noise, from pixel to pixel; ``near``: S_d of each of ``STEPS``, mean over
    conditions; ``expected``: E."""

    white: float
    near: tuple[float, ...]
    expected: float

    def unnamed(self, removed: float) -> float:
        """S_2 less what formulas of effects with a name may leave of ``removed``, mean χ² that they take off."""
        return self.near[AT] - FORMS * max(removed, 0.0)

    def unexplained(self, removed: float) -> tuple[float, float]:
        """How many times E there is, and the probability that it has a cause without a name; ``removed``: mean χ² that
        effects with a name take off."""
        left = self.unnamed(removed)
        if left <= 0 or self.expected <= 0:
            return 0.0, 0.0
        x = float(np.log(left / self.expected))
        usual, caused = (x - USUAL) / USUALLY, (x - CAUSED) / LARGELY
        if usual <= 0:
            return float(np.exp(x)), 0.0
        odds = np.log(OUTSIDE / (1 - OUTSIDE) * USUALLY / LARGELY) + 0.5 * (usual**2 - caused**2)
        return float(np.exp(x)), float(expit(odds))


def twin_off(tolerances: Tolerances) -> float:
    """What a twin is off by, over the signal."""
    return SIGNAL * max(1.0, tolerances.flat_field / FLAT)


def structure(
    conditions: Sequence[Condition], simulated: Sequence[np.ndarray], off: float = SIGNAL
) -> Structure | None:
    """Of conditions whose expected DN are ``simulated``, (H, W, C) each, by a twin that is ``off`` by a share of the
    signal; None where there is too little away from edges to tell."""

    def left(both: tuple[Condition, np.ndarray]) -> tuple[np.ndarray, tuple[float, float, float]]:
        c, dn = both
        s, w = flat(c, dn)
        z, count = (c.mean - dn) * np.sqrt(w), float((w > 0).sum())
        expected = float((np.square(off * s) * w).sum())
        if c.packed is not None:  # a JPEG's blocks share their errors
            product, pairs = _near(c.packed * np.sqrt(w), w > 0)[AT]
            expected += count * product / max(pairs, 1.0)
        return _near(z, w > 0), (float((z**2).sum()) - count, expected, count)

    found = each(left, list(zip(conditions, simulated, strict=True)))
    products, pairs = np.sum([near for near, _ in found], axis=0).T
    square, expected, count = np.sum([sums for _, sums in found], axis=0)
    if pairs.min() < FEWEST:
        return None
    near = products / pairs
    return Structure(float(square / count - near[0]), tuple(map(float, near)), float(expected / count))


def _near(z: np.ndarray, ok: np.ndarray) -> np.ndarray:
    """(n, 2): sum of products of values ``STEPS`` apart, and how many there are."""
    z = np.where(ok, z, 0.0)
    found = []
    for d in STEPS:
        products = [(z[d:] * z[:-d]).sum(), (z[:, d:] * z[:, :-d]).sum()]
        counts = [(ok[d:] & ok[:-d]).sum(), (ok[:, d:] & ok[:, :-d]).sum()]
        found.append((float(sum(products)), float(sum(counts))))
    return np.array(found)

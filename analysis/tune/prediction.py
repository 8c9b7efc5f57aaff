"""What a simulated series says of a real image, before the real image is looked at.

Of n simulated frames that nothing was tuned on, the k-th lowest and k-th highest score bracket the score of one more
frame of the same kind with probability 1 - 2 k / (n + 1), whatever the distribution (exchangeability). ``coverage`` is
what the frames can give at most when it was asked for more. A real score outside says that the real image is not of
the simulated kind, in what the score feels.

Vovk, Gammerman, Shafer: Algorithmic Learning in a Random World. 2005 (conformal prediction).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from interchange.problems import BrightfieldError

LEAST = 3  # frames that a prediction needs


@dataclass(frozen=True)
class Prediction:
    """Of one measure on one real image: ``median``, and ``low`` to ``high`` with probability ``coverage``, from
    ``frames`` simulated frames."""

    measure: str
    median: float
    low: float
    high: float
    coverage: float
    frames: int

    def holds(self, value: float) -> bool:
        return self.low <= value <= self.high


@dataclass(frozen=True)
class Verified:
    """``scores``: every measure of a real image. ``share``: of the real scores in their intervals, by measure."""

    scores: Mapping[str, Mapping[str, float]]
    share: Mapping[str, float]


def predict(
    measure: str, simulated: np.ndarray, weights: np.ndarray | None = None, coverage: float = 0.9
) -> Prediction:
    """From the scores (n,) of simulated frames and their weights; NaN ones are left out. Raises BrightfieldError for
    fewer than three.

    With weights, a frame's mass is w / (Σ w + max w), the largest weight standing for the new frame's. Tibshirani et
    al.: Conformal prediction under covariate shift. NeurIPS 2019.
    """
    w = np.ones(len(simulated)) if weights is None else np.asarray(weights, np.float64)
    good = np.isfinite(simulated) & (w > 0)
    order = np.argsort(simulated[good], kind="stable")
    known, mass = simulated[good][order], w[good][order]
    n = len(known)
    if n < LEAST:
        raise BrightfieldError(
            f"A prediction of {measure} needs three frames or more that nothing was tuned on; there are {n}."
        )
    mass = mass / (mass.sum() + mass.max())
    tail = (1 - coverage) / 2 + 1e-12
    low = max(int(np.searchsorted(np.cumsum(mass), tail, side="right")) - 1, 0)
    high = n - 1 - max(int(np.searchsorted(np.cumsum(mass[::-1]), tail, side="right")) - 1, 0)
    inside = 1 - mass[: low + 1].sum() - mass[high:].sum()
    median = known[min(int(np.searchsorted(np.cumsum(mass) / mass.sum(), 0.5)), n - 1)]
    return Prediction(
        measure, float(median), float(known[low]), float(known[high]), float(max(inside, 0.0)), n
    )


def verify(
    predictions: Sequence[Prediction], scores: Mapping[str, np.ndarray], names: Sequence[str]
) -> Verified:
    """``scores`` by measure, (m,) over the real images ``names``; a NaN score counts for no interval."""
    share = {}
    for p in predictions:
        real = scores[p.measure][np.isfinite(scores[p.measure])]
        share[p.measure] = float(np.mean([p.holds(float(v)) for v in real])) if len(real) else float("nan")
    each = {name: {m: float(v[i]) for m, v in scores.items()} for i, name in enumerate(names)}
    return Verified(each, share)

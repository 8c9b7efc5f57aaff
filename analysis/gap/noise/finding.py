"""What is said of an effect that does not move the mean image, and how probable it is."""

from dataclasses import dataclass

import numpy as np

PRIOR = 0.1  # that an effect of this class is there


@dataclass(frozen=True)
class Number:
    """A parameter's value, standard deviation and unit."""

    value: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class NoiseFinding:
    """``name`` of the file contract; ``parameters`` by the names of the effect's file, and K of photon transfer;
    ``notes``: what is told of it besides, where it is found."""

    name: str
    probability: float
    parameters: dict[str, Number]
    notes: tuple[str, ...] = ()


def probability(
    off: np.ndarray, covariance: np.ndarray, spike: np.ndarray, slab: np.ndarray, prior: float = PRIOR
) -> float:
    """That numbers ``off`` (n,) their data sheet's, known to ``covariance`` (n, n), are off by more than it leaves:
    normal priors as wide as ``slab`` against ``spike`` (n,).

    George, McCulloch: Variable selection via Gibbs sampling. JASA 1993.
    """

    def log_evidence(width: np.ndarray) -> float:
        V = covariance + np.diag(width**2)
        return -0.5 * float(off @ np.linalg.solve(V, off)) - 0.5 * float(np.linalg.slogdet(V)[1])

    odds = np.log(prior / (1 - prior)) + log_evidence(slab) - log_evidence(spike)
    return float(1 / (1 + np.exp(-np.clip(odds, -700, 700))))


def certainty(log_odds: float, prior: float = PRIOR) -> float:
    """The probability of what a log likelihood ratio speaks for."""
    odds = np.log(prior / (1 - prior)) + log_odds
    return float(1 / (1 + np.exp(-np.clip(odds, -700, 700))))

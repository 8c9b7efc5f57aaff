"""Whether the numbers of causes give other images than they did."""

import numpy as np

from analysis.gap.terms.base import Cause

SETTLED = 0.05  # of what a cause changes in the images: a smaller change needs no new linearisation


def moved(
    members: dict[Cause, np.ndarray], now: np.ndarray, before: np.ndarray, G: np.ndarray, spike: np.ndarray
) -> bool:
    """Whether the numbers of a cause give other images than they did: by more than a part of what it changes, and more
    than each may be off by anyway. Two that give the same images, one for the other, have not moved."""
    for index in members.values():
        own, off = G[np.ix_(index, index)], now[index] - before[index]
        least = np.max(spike[index] ** 2 * np.diag(own), initial=0.0)
        if off @ own @ off > max(SETTLED**2 * (now[index] @ own @ now[index]), least):
            return True
    return False

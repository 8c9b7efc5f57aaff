"""Terms that may not be below their least: what it costs a hypothesis that they stand there instead."""

import numpy as np

ALIKE = 1e-5  # of a standard deviation: what is left of it where others say all of it, and rounding


def raised(
    theta: np.ndarray, covariance: np.ndarray, low: np.ndarray, least: np.ndarray, held: np.ndarray
) -> float:
    """Half the squared distance, in standard deviations, that ``theta`` (m,) goes for those of its first terms (n,)
    that are below ``least`` to stand at ``low``, one after the other, the farthest first; it is changed. Infinite where
    one of them is not ``held``."""
    n, cost = len(low), 0.0
    free = np.ones(n, bool)
    rounded = ALIKE * np.sqrt(np.maximum(np.diag(covariance)[:n], 0))
    while True:
        sigma = np.sqrt(np.maximum(np.diag(covariance)[:n], 0))
        below = free & (theta[:n] < least)
        if not below.any():
            return cost
        nowhere = ~held | (sigma <= rounded)  # others, at their least, leave it no room
        if (below & nowhere).any():
            return np.inf
        off = np.where(below, (low - theta[:n]) / np.maximum(sigma, 1e-300), 0.0)
        k = int(np.argmax(off))
        along = covariance[:, k] / sigma[k]
        cost += 0.5 * off[k] ** 2
        theta += along * off[k]
        covariance -= np.outer(along, along)
        free[k] = False

"""Low-discrepancy points: which spot of a pixel, of a lamp and of a lens each accumulated pass takes.

Owen-scrambled Sobol points; sets with different seeds are independent of each other, so that a lamp's points
do not go along with the pixel's. Owen: Randomly permuted (t,m,s)-nets. 1995.
"""

from functools import lru_cache

import numpy as np
from scipy.stats import qmc


@lru_cache(maxsize=1024)
def points(count: int, seed: int) -> np.ndarray:
    """(count, 2) in [0, 1)²; a single point is the middle."""
    if count == 1:
        return np.full((1, 2), 0.5)
    exponent = int(np.ceil(np.log2(count)))
    net = qmc.Sobol(2, scramble=True, seed=seed).random_base2(exponent)
    if count == 2**exponent:
        return net
    # the first points of a longer net lean to one side; a lattice of exactly this length does not
    shift = np.random.default_rng(seed).random(2)
    return (np.arange(count)[:, None] * [1 / count, 0.6180339887498949] + shift) % 1.0


def disk(square: np.ndarray) -> np.ndarray:
    """Points of the unit square (..., 2) on the unit disk, equal areas to equal areas.

    Shirley, Chiu: A low distortion map between disk and square. 1997.
    """
    a, b = 2 * square[..., 0] - 1, 2 * square[..., 1] - 1
    first = np.abs(a) > np.abs(b)
    r = np.where(first, a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        phi = np.where(first, np.pi / 4 * b / a, np.pi / 2 - np.pi / 4 * a / b)
    phi = np.where((a == 0) & (b == 0), 0.0, phi)
    return np.stack([r * np.cos(phi), r * np.sin(phi)], axis=-1)

"""Low-discrepancy points: which spot of a pixel, of a lamp and of a lens each accumulated pass takes."""

import numpy as np

GOLDEN = (np.sqrt(5) - 1) / 2


def square(count: int) -> np.ndarray:
    """(count, 2) in [0, 1)²: the golden lattice ((k + 1/2) / n, (k + 1/2) g + s mod 1), turned by the s nearest to 0
    with which its mean is the middle; a single point is the middle."""
    k = np.arange(count) + 0.5
    y = k * GOLDEN % 1.0
    turns = (
        0.5 - y.mean() + np.arange(-count, count + 1) / count
    )  # a turn by s adds s, less 1 / n for each that wraps
    centred = [s for s in turns if abs(((y + s) % 1.0).mean() - 0.5) < 1e-9]
    return np.stack([k / count, (y + min(centred, key=abs)) % 1.0], axis=-1)


def disk(count: int) -> np.ndarray:
    """(count, 2) on the unit disk, equal areas: Vogel's sunflower; a single point is the middle.

    Vogel: A better way to construct the sunflower head. Math. Biosciences 1979.
    """
    if count == 1:
        return np.zeros((1, 2))
    k = np.arange(count) + 0.5
    r, phi = np.sqrt(k / count), 2 * np.pi * GOLDEN * k
    return np.stack([r * np.cos(phi), r * np.sin(phi)], axis=-1)


def shuffled(points: np.ndarray, seed: int) -> np.ndarray:
    """The same points in another order, so that those of one lamp do not go along with the pixel's or another's."""
    return points[np.random.default_rng(seed).permutation(len(points))]

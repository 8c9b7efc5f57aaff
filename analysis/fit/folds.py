"""What is held out to see whether a fit foretells: whole incidence angles, unless asked otherwise.

Samples of one incidence angle share their errors (alignment, the lamp, the footprint), and neighbours in exitance say
nearly the same: a random fold would test interpolation between them. A scene asks for other angles than were measured,
so whole ones are left out; the first and the last are then extrapolation, and are told apart in the report.
Breiman et al. 1984 for the smallest model within one standard error of the best.
"""

from dataclasses import dataclass

import numpy as np

from interchange.problems import BrightfieldError
from interchange.reflectance import ReflectanceSamples

MOST = 12  # more incidence angles than this are put together into MOST // 2 + 2 groups


@dataclass(frozen=True, eq=False)
class Folds:
    """``held`` (N,): the fold in which a sample is left out. ``labels``: one a fold."""

    held: np.ndarray
    labels: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.labels)


def folds_of(samples: ReflectanceSamples, how: str = "incidence", count: int = 8, seed: int = 0) -> Folds:
    """``how``: "incidence" or "random" (``count`` folds). Raises BrightfieldError for a single incidence angle."""
    degrees = np.degrees(samples.theta[0])
    if how == "random":
        if not 2 <= count <= len(samples):
            raise BrightfieldError(
                f"Random folds must number from 2 to the {len(samples)} samples; got {count}."
            )
        held = np.random.default_rng(seed).permutation(len(samples)) % count
        return Folds(held, tuple(f"part {k + 1}" for k in range(count)))
    if how != "incidence":
        raise BrightfieldError(f'Folds must be "incidence" or "random"; got "{how}".')
    angles, held = np.unique(np.round(degrees), return_inverse=True)
    if len(angles) > MOST:
        edges = np.unique(np.quantile(degrees, np.linspace(0, 1, MOST // 2 + 3)[1:-1]))
        held = np.searchsorted(edges, degrees)
        numbers = np.unique(held)
        held = np.searchsorted(numbers, held)
        labels = tuple(
            f"{degrees[held == k].min():.0f}-{degrees[held == k].max():.0f}°" for k in range(len(numbers))
        )
        return Folds(held, labels)
    if len(angles) < 2:
        raise BrightfieldError(
            f"Folds by incidence need two incidence angles; there is one, so ask for random folds. ({samples.file})"
        )
    return Folds(held, tuple(f"{a:.0f}°" for a in angles))

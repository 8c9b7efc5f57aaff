"""Designs: which combinations of its axes a plan looks at, and the weight of each.

| method            | points                                                                                        |
|-------------------|-----------------------------------------------------------------------------------------------|
| grid              | every combination of the ranges' steps and of the lists                                       |
| list              | the k-th entries of all lists together                                                        |
| latin_hypercube   | each axis cut into N equal shares, one point in each (McKay, Beckman, Conover 1979)            |
| sobol             | scrambled Sobol' points (Owen 1998; Joe, Kuo 2008)                                            |
| random            | independent points                                                                            |

Points of the unit cube become values by each axis' law (analysis.sweep.laws); weights are the laws' ratios.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from analysis.sweep.laws import Choice, Law


class Method(StrEnum):
    GRID = "grid"
    LIST = "list"
    LATIN_HYPERCUBE = "latin_hypercube"
    SOBOL = "sobol"
    RANDOM = "random"

    @property
    def goes_on(self) -> bool:
        """Whether there are always more points where some were rejected."""
        return self in (Method.SOBOL, Method.RANDOM)

    @property
    def counts(self) -> bool:
        """Whether the plan says how many points there are."""
        return self.goes_on or self is Method.LATIN_HYPERCUBE


@dataclass(frozen=True)
class Axis:
    """``steps``: points of a range in a grid. ``nature``: the law that the world follows, None as sampled. ``names``:
    of something that is chosen by name; its values are numbers of names."""

    address: str
    law: Law
    steps: int = 0
    nature: Law | None = None
    names: tuple[str, ...] = ()

    def value(self, x: float) -> float | str:
        """What is set where the design has ``x``."""
        return self.names[round(x)] if self.names else x

    @property
    def size(self) -> int:
        """Points of a grid or a list."""
        return len(self.law.values) if isinstance(self.law, Choice) else self.steps

    def weight(self, x: np.ndarray) -> np.ndarray:
        """p(x) / q(x)."""
        if self.nature is None:
            return np.ones(np.shape(x))
        return self.nature.density(x) / self.law.density(x)


def points(axes: Sequence[Axis], method: Method, count: int, seed: int) -> Iterator[np.ndarray]:
    """Rows (P,) of values, in the order of ``axes``. ``sobol`` and ``random`` never end."""
    match method:
        case Method.GRID:
            yield from map(np.array, itertools.product(*(_steps(axis) for axis in axes)))
        case Method.LIST:
            yield from np.stack([_steps(axis) for axis in axes], axis=-1)
        case _:
            for u in _unit(len(axes), method, count, seed):
                yield np.array([float(axis.law.quantile(x)) for axis, x in zip(axes, u, strict=True)])


def weights(axes: Sequence[Axis], rows: np.ndarray) -> np.ndarray:
    """(N,) of values (N, P): by how much a sample stands for more cases of the world than were sampled like it."""
    product = np.ones(len(rows))
    for axis, x in zip(axes, rows.T, strict=True):
        product = product * axis.weight(x)
    return product


def _steps(axis: Axis) -> np.ndarray:
    if isinstance(axis.law, Choice):
        return np.array(axis.law.values)
    if axis.steps == 1:
        return axis.law.quantile(np.array([0.5]))
    return axis.law.quantile(np.linspace(0, 1, axis.steps))


def _unit(dimensions: int, method: Method, count: int, seed: int) -> Iterator[np.ndarray]:
    """Points (P,) in [0, 1)."""
    if dimensions == 0:
        yield from itertools.repeat(np.zeros(0)) if method.goes_on else np.zeros((count, 0))
        return
    from scipy.stats import qmc  # takes longer than all else that a worker starts with

    match method:
        case Method.LATIN_HYPERCUBE:
            yield from qmc.LatinHypercube(dimensions, seed=seed).random(count)
        case Method.SOBOL:
            engine = qmc.Sobol(dimensions, scramble=True, seed=seed)
            while True:
                yield from engine.random(1024)
        case _:
            rng = np.random.default_rng(seed)
            while True:
                yield rng.random(dimensions)

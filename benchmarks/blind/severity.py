"""How strong a cause is: rms of what it does to the mean images over their mean signal; and the amplitude for that."""

from collections.abc import Callable, Sequence

import numpy as np

SATURATED = 0.95


def severity(without: Sequence[np.ndarray], with_: Sequence[np.ndarray], full_well: float) -> float:
    """Over all pixels of all shots that are not saturated; images in e-."""
    square, signal, count = 0.0, 0.0, 0
    for a, b in zip(without, with_, strict=True):
        ok = a.max(axis=2) < SATURATED * full_well
        square += float(np.sum((b[ok] - a[ok]) ** 2))
        signal += float(np.sum(a[ok]))
        count += 3 * int(ok.sum())
    return float(np.sqrt(square / count) / (signal / count))


class OutOfReach(ValueError):
    """No amplitude within the bounds gives the severity."""


def solve(
    of: Callable[[float], float],
    target: float,
    low: float,
    high: float,
    start: float,
    tolerance: float = 0.02,
) -> tuple[float, float]:
    """Amplitude within [low, high] whose severity is ``target`` to the share ``tolerance``, and that severity.

    ``of`` rises with the amplitude. A secant in logarithms, kept inside a bracket. Raises OutOfReach.
    """
    a = float(np.clip(start, low, high))
    bracket = [low, high]
    power = 1.0
    before: tuple[float, float] | None = None
    for _ in range(24):
        s = of(a)
        if abs(s / target - 1) <= tolerance:
            return a, s
        if s < target and a >= high * (1 - 1e-9):
            raise OutOfReach(f"The most that {high:g} gives is {s:.2e}; wanted {target:.2e}.")
        bracket[0 if s < target else 1] = a
        if before is not None and a != before[0] and s > 0 and before[1] > 0:
            slope = np.log(s / before[1]) / np.log(a / before[0])
            power = float(np.clip(slope, 0.3, 4.0))
        before = (a, s)
        guess = a * (target / s) ** (1 / power) if s > 0 else 4 * a
        if not bracket[0] < guess < bracket[1]:
            guess = (
                high
                if guess >= high and bracket[1] == high
                else float(np.sqrt(max(bracket[0], low, 1e-12) * bracket[1]))
            )
        a = float(guess)
    raise OutOfReach(f"No amplitude in [{low:g}, {high:g}] gives {target:.2e}; the last gave {s:.2e}.")

"""What each of several causes takes off the gap: Shapley's shares, which add up whatever the causes share.

    φ_i = Σ over S without i of  |S|! (k - |S| - 1)! / k!  (v(S + i) - v(S)),     Σ φ_i = v(all) - v(none)

With v(S) the mean χ² that the causes of S close together. All 2^k sets are simulated, so the sum is exact.
Shapley: A value for n-person games. In: Contributions to the theory of games II, 1953.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import factorial


@dataclass(frozen=True)
class Step:
    """One step of the waterfall from the scene file as written to noise. ``chi2``: mean χ² that it takes off.

    ``kind``: "calibration", "effect", "unknown", "rest" or "noise".
    """

    name: str
    kind: str
    chi2: float


def shares(players: Sequence[str], value: Callable[[frozenset[str]], float]) -> dict[str, float]:
    """φ of each player; ``value`` is asked once for each of the 2^k sets."""
    k = len(players)
    known = {frozenset(s): value(frozenset(s)) for n in range(k + 1) for s in combinations(players, n)}
    out = {}
    for player in players:
        without = [s for s in known if player not in s]
        out[player] = sum(
            factorial(len(s)) * factorial(k - len(s) - 1) / factorial(k) * (known[s | {player}] - known[s])
            for s in without
        )
    return out

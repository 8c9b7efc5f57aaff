"""What a cause that lets something stand elsewhere may have been taken for.

From home an edge that is some pixels off tells no linearisation which of two causes moved it: a box that is higher and
one that lies higher have one upper edge. Where one of them stands, the other can be told from it.
"""

import numpy as np

from analysis.gap.evidence.stand import Stand, Start
from analysis.gap.search.search import MOVES, RIVAL, Search

DAMPING = 1e-3  # of what numbers of one cause tell alike


def beside_rivals(search: Search, stand: Stand) -> Stand:
    """The stand, or the best of those that have another cause in place of one of its own."""
    best = stand
    for k, rival in enumerate(rivals(search, stand)):
        there = search.followed(stand, rival, f"rival {k + 1}", [best])
        if there.is_its_own and there.best.score > best.best.score:
            best = there
    return best


def rivals(search: Search, stand: Stand) -> list[Start]:
    """The best hypothesis with another cause in place of one that lets something stand elsewhere, where that alone
    explains nearly as much of what the one does: the ``MOVES`` that explain most, from where they do."""
    every, theta = stand.evidence.members, stand.evidence.theta(stand.best)
    movers = {c: index for c, index in every.items() if search.moving(index)}
    found = []
    for c in (c for c in stand.best.causes if c in movers):
        own = movers[c]
        least = RIVAL * _explained(stand, theta, own, own)[0]
        for rival, index in movers.items():
            gain, x = _explained(stand, theta, index, own)
            if rival in stand.best.causes or gain < least:
                continue
            causes = tuple(rival if k == c else k for k in stand.best.causes)
            there = theta[: search.q].copy()
            there[own], there[index] = 0.0, x
            at = search.start({k: every[k] for k in causes}, there)
            found.append((gain / least, Start(stand.evidence.best(causes, {}), at)))
    return [start for _, start in sorted(found, key=lambda x: -x[0])[:MOVES]]


def _explained(
    stand: Stand, theta: np.ndarray, index: np.ndarray, instead: np.ndarray
) -> tuple[float, np.ndarray]:
    """What the terms ``index`` explain, sigma², and where they stand for it, with the terms ``instead`` at nothing."""
    e, others = stand.evidence.e, theta.copy()
    others[np.union1d(index, instead)] = 0.0
    b, G = e.b[index] - e.G[index] @ others, e.G[np.ix_(index, index)]
    x = np.linalg.solve(G + DAMPING * np.diag(np.diag(G)), b)
    return float(b @ x), x

"""Which causes are there: marginal likelihood of every hypothesis from one set of normal equations.

A hypothesis M is a set of causes. Every term has a normal prior around zero: as wide as calibration leaves it
(spike), or, where its cause is in M, as wide as effects are (slab). With P = diag(sd⁻²) and A = G + P

    log Z_M = ½ b' A⁻¹ b - ½ log|A| + ½ log|P|

and p(M) ∝ prior(M) Z_M^(1/τ). A hypothesis whose term is below what it may be does not count.

George, McCulloch: Variable selection via Gibbs sampling. JASA 1993.
MacKay: Bayesian interpolation. Neural Computation 1992.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from analysis.gap.normal_equations import NormalEquations
from analysis.gap.terms import Term

SLABS = (0.01, 0.03, 0.1)  # rms of an effect over the signal
TAU = 3.0
NONE, SINGLE, PAIR, TRIPLE = 0.5, 0.35, 0.12, 0.03  # prior of a number of causes
TOP = 12  # causes that are tried in pairs with all others
ENOUGH = 3.0  # gain of log Z, over τ, that keeps a further cause

Cause = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Hypothesis:
    causes: tuple[Cause, ...]
    log_Z: float
    log_prior: float
    theta: np.ndarray  # posterior mean of every term
    slabs: tuple[float, ...] = ()

    @property
    def score(self) -> float:
        return self.log_prior + self.log_Z / TAU


class Evidence:
    def __init__(self, equations: NormalEquations, terms: Sequence[Term]) -> None:
        self.e, self.terms = equations, list(terms)
        share = np.maximum(equations.share, 1e-12)
        self.seen = equations.share > 0
        self.spike = np.array(
            [t.spike / s if t.relative else t.spike for t, s in zip(terms, share, strict=True)]
        )
        self.share = share
        self.members: dict[Cause, np.ndarray] = {}
        for i, term in enumerate(terms):
            if self.seen[i]:
                self.members.setdefault(term.candidate, np.array([], int))
                self.members[term.candidate] = np.append(self.members[term.candidate], i)
        # in units of the spikes' widths the matrix is I + D G D, which is as well conditioned as it can be
        A = np.eye(len(terms)) + equations.G * self.spike[:, None] * self.spike[None, :]
        factor = cho_factor(A, lower=True, check_finite=False)
        self.C = cho_solve(factor, np.eye(len(A)), check_finite=False)
        self.z = self.C @ (equations.b * self.spike)
        self.log_Z = 0.5 * float(equations.b * self.spike @ self.z) - float(np.log(np.diag(factor[0])).sum())
        self.known: dict[tuple[tuple[Cause, ...], tuple[float, ...]], Hypothesis] = {}

    def at(self, causes: Iterable[Cause], slabs: Sequence[float]) -> Hypothesis:
        """One hypothesis, with a slab for each cause: all at their spikes, corrected for the k terms that are wide.

        A_M = A + U Δ U' with Δ = spike²/slab² - 1, hence A_M⁻¹ = C - C U (Δ⁻¹ + U'CU)⁻¹ U'C. Woodbury 1950.
        """
        causes = tuple(causes)
        key = (causes, tuple(slabs))
        if key in self.known:
            return self.known[key]
        wide = np.concatenate([self.members[c] for c in causes]) if causes else np.array([], int)
        sd = np.concatenate(
            [slab / self.share[i] / np.sqrt(len(i)) for c, slab in zip(causes, slabs, strict=True)
             for i in [self.members[c]]]
        ) if causes else np.array([])  # fmt: skip
        ratio = np.maximum(sd / self.spike[wide], 2.0)
        delta = ratio**-2 - 1.0
        inner = np.linalg.inv(np.diag(1 / delta) + self.C[np.ix_(wide, wide)])
        z = self.z - self.C[:, wide] @ (inner @ self.z[wide])
        _, log_det = np.linalg.slogdet(np.eye(len(wide)) + delta[:, None] * self.C[np.ix_(wide, wide)])
        log_Z = self.log_Z - 0.5 * float(self.z[wide] @ inner @ self.z[wide])
        log_Z += -0.5 * float(log_det) - float(np.log(ratio).sum()) - len(causes) * float(np.log(len(SLABS)))
        theta = z * self.spike
        if any(theta[i] < self.terms[i].low - 2 * self.spike[i] for i in wide):
            log_Z = -np.inf
        out = Hypothesis(causes, log_Z, self._prior(causes), theta, tuple(slabs))
        self.known[key] = out
        return out

    def sigma(self, h: Hypothesis) -> np.ndarray:
        """(q,): standard deviation of every term under a hypothesis."""
        variance = np.diag(self.C).copy()
        if h.causes:
            wide = np.concatenate([self.members[c] for c in h.causes])
            sd = np.concatenate(
                [slab / self.share[i] / np.sqrt(len(i)) for c, slab in zip(h.causes, h.slabs, strict=True)
                 for i in [self.members[c]]]
            )  # fmt: skip
            delta = np.maximum(sd / self.spike[wide], 2.0) ** -2 - 1.0
            inner = np.linalg.inv(np.diag(1 / delta) + self.C[np.ix_(wide, wide)])
            variance -= np.einsum("ij,jk,ik->i", self.C[:, wide], inner, self.C[:, wide])
        return np.asarray(self.spike * np.sqrt(np.maximum(variance, 0)))

    def best(self, causes: Iterable[Cause], wide: dict[Cause, float]) -> Hypothesis:
        """Over the slabs of the causes that ``wide`` does not fix."""
        causes = tuple(sorted(causes))
        slabs = [wide.get(c, 0.0) for c in causes]
        for i, cause in enumerate(causes):
            if cause in wide:
                continue
            options = [
                self.at(causes, [*slabs[:i], s, *[x or SLABS[1] for x in slabs[i + 1 :]]]) for s in SLABS
            ]
            k = int(np.argmax([h.log_Z for h in options]))
            slabs[i] = SLABS[k]
            wide[cause] = SLABS[k]
        return self.at(causes, slabs)

    def _prior(self, causes: tuple[Cause, ...]) -> float:
        n, k = len(causes), max(len(self.members), 2)
        mass = (NONE, SINGLE, PAIR, TRIPLE)[min(n, 3)] * 0.1 ** max(n - 3, 0)
        ways = 1.0
        for i in range(n):
            ways *= (k - i) / (i + 1)
        return float(np.log(mass / max(ways, 1.0)))

    def search(self) -> list[Hypothesis]:
        """None, singles, pairs of the best with all, then greedily more and fewer; best first."""
        wide: dict[Cause, float] = {}
        none = self.at((), ())
        singles = [self.best((c,), wide) for c in self.members]
        singles.sort(key=lambda h: -h.score)
        found: dict[tuple[Cause, ...], Hypothesis] = {h.causes: h for h in [none, *singles]}
        top = [h.causes[0] for h in singles[:TOP]]
        if singles and singles[0].score > none.score:
            for a in top:
                for b in self.members:
                    if a != b:
                        h = self.best((a, b), wide)
                        found[h.causes] = h
        current = max(found.values(), key=lambda h: h.score)
        for _ in range(4):
            if not current.causes:
                break
            more = [self.best((*current.causes, c), wide) for c in self.members if c not in current.causes]
            best = max(more, key=lambda h: h.score)
            found.update({h.causes: h for h in more})
            if best.score < current.score + ENOUGH / TAU:
                break
            current = best
        for size in range(len(current.causes) - 1, 0, -1):
            for fewer in combinations(current.causes, size):
                h = self.best(fewer, wide)
                found[h.causes] = h
        return sorted(found.values(), key=lambda h: -h.score)


def posterior(hypotheses: Sequence[Hypothesis]) -> dict[Cause, float]:
    """Probability of each cause: of all hypotheses that have it."""
    score = np.array([h.score for h in hypotheses])
    p = np.exp(score - score.max())
    p /= p.sum()
    out: dict[Cause, float] = {}
    for h, share in zip(hypotheses, p, strict=True):
        for cause in h.causes:
            out[cause] = out.get(cause, 0.0) + float(share)
    return out

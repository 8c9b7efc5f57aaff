"""Which causes are there: marginal likelihood of every hypothesis from one set of normal equations.

A hypothesis M is a set of causes. Every term has a normal prior around zero: as wide as calibration leaves it
(spike), or, where its cause is in M, as wide as effects are (slab). With P = diag(sd⁻²) and A = G + P

    log Z_M = ½ Σ log w - ½ r' W r + ½ b' A⁻¹ b - ½ log|A| + ½ log|P|

and p(M) ∝ prior(M) Z_M^(1/τ). All are told from one inverse: with C = A⁻¹ of some widths, and the terms U wider,

    A_M = A + U Δ U',  Δ = slab⁻² - spike⁻²,  A_M⁻¹ = C - C U (Δ⁻¹ + U'CU)⁻¹ U'C

A hypothesis whose term is below what it may be, by more than errors reach, does not count, nor one whose path is as
wide as it is long, or whose fall-off rises. A term that is ``held`` stands at its least instead, as others of its
cause have the rest: that costs half the square of how many standard deviations it is moved by.

George, McCulloch: Variable selection via Gibbs sampling. JASA 1993.
MacKay: Bayesian interpolation. Neural Computation 1992.
Woodbury: Inverting modified matrices. 1950.
"""

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from analysis.gap.evidence.bounded import raised
from analysis.gap.evidence.prior import Prior
from analysis.gap.evidence.widened import Widened, inverse, woodbury
from analysis.gap.terms.base import FORM, NUISANCE, Cause, Term
from analysis.gap.terms.fall_off import fall_offs, falls
from analysis.gap.terms.normal_equations import NormalEquations
from analysis.gap.terms.subpixel import is_path, paths

SLABS = (0.01, 0.03, 0.1)  # rms of an effect over the signal
FAR = 0.3  # the same, of what stands elsewhere: edges that are off by their width change an image by as much
SLIGHT = 0.004  # the same, of effects that have a formula: what has a number for each place would be noise with that
TAU = 1.0
WIDEST = 40.0  # times its tolerance that a calibrated number may be off
REACH = 2.0  # spikes, or standard deviations, that a term may be below what it may be
UNSEEN = 1e6  # times as wide as what shows nothing, but for rounding, is at most: 1 - UNSEEN⁻² is not 1
FURTHEST = 400.0  # the same of what stands elsewhere, such as a lens that was written down as none at all

Given = Mapping[Cause, np.ndarray]  # how many times wider than its spike each term of a cause is


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """``slabs``: how wide each cause is, rms over the signal."""

    causes: tuple[Cause, ...]
    slabs: tuple[float, ...]
    log_Z: float
    log_prior: float

    @property
    def score(self) -> float:
        return self.log_prior + self.log_Z / TAU

    def of(self, causes: Sequence[Cause]) -> "Hypothesis":
        """Some of its causes, as wide as here; not weighed."""
        slabs = dict(zip(self.causes, self.slabs, strict=True))
        return replace(self, causes=tuple(causes), slabs=tuple(slabs[c] for c in causes))


class Evidence:
    """``in_force``: the causes of ``equations.bends``, in their order. ``spikes``: those of the first terms, where they
    are known."""

    def __init__(
        self,
        equations: NormalEquations,
        terms: Sequence[Term],
        in_force: Sequence[Cause] = (),
        spikes: np.ndarray | None = None,
    ) -> None:
        self.e, self.terms, self.in_force = equations, list(terms), tuple(in_force)
        self.share = np.maximum(equations.share, 1e-12)
        self.seen = equations.share > 0
        sized = self._sized()
        share = self.share[sized]
        self.low = np.array([t.low for t in terms])
        self.held = np.array([t.held for t in terms])
        self.relative = np.array([t.relative for t in terms])
        self.part = np.array([t.part for t in terms])
        self.members: dict[Cause, np.ndarray] = {}
        self.ways: dict[Cause, int] = {}
        self.slabs: dict[Cause, tuple[float, ...]] = {}  # widths that each cause may have
        for i, term in enumerate(terms):
            if self.seen[i] and term.cause not in (FORM, NUISANCE):
                self.members.setdefault(term.candidate, np.array([], int))
                self.members[term.candidate] = np.append(self.members[term.candidate], i)
                self.ways[term.candidate] = term.ways
                free = term.generic or term.family is not None
                moves = term.kind in ("flow", "scene")
                self.slabs[term.candidate] = SLABS if free else (SLIGHT, *SLABS, *[FAR] * moves)
        first = {c: terms[i[0]] for c, i in self.members.items()}
        self.prior = Prior({c: t.camera for c, t in first.items()}, {c: t.usual for c, t in first.items()})
        self.paths = {c: i for c, i in paths(self.terms).items() if self.seen[i].all()}
        self.fall_offs = {c: i for c, i in fall_offs(self.terms).items() if self.seen[i].all()}
        # what a unit of every term of a cause gives to the image together: cells have one width, however large they are
        together = share.copy()
        for index in self.members.values():
            root = np.linalg.norm(self.part[index])
            cell = terms[index[0]].family is not None
            together[index] = np.linalg.norm(share[index]) if cell else share[index] * root
        self.together = together
        # what calibration leaves is told where a term shows: one capture's gain is as far off where there are many
        # and what is not seen stays where it is
        own = np.where(self.seen, np.maximum(equations.own_share, 1e-12)[sized], 1.0)
        for index in self.members.values():
            if terms[index[0]].family is not None:
                own[index] = np.linalg.norm(own[index])
        self._declared = np.array(
            [t.spike / s if t.relative else t.spike for t, s in zip(terms, own, strict=True)]
        )
        self._weigh(spikes)

    def _sized(self) -> np.ndarray:
        """(q,): of each term the one whose share tells its widths. What is in one unit is as large in all its parts,
        however little of one shows: light from a window is no more than all light of a room."""
        place = {t.key: i for i, t in enumerate(self.terms) if self.seen[i]}
        return np.array(
            [place.get((t.cause, t.target, t.sized_by), i) for i, t in enumerate(self.terms)], dtype=int
        )

    def with_spikes(self, spikes: np.ndarray | None) -> "Evidence":
        """The same equations with other ``spikes``."""
        other = copy(self)
        other._weigh(spikes)
        return other

    def on(self, equations: NormalEquations) -> "Evidence":
        """Other ``equations`` of the same terms, with these widths: shares of the signal are not told anew."""
        other = copy(self)
        other.e = equations
        other._weigh(self.spike)
        return other

    def _weigh(self, spikes: np.ndarray | None) -> None:
        terms, equations = self.terms, self.e
        self.spike = self._declared.copy()
        if spikes is not None:
            self.spike[: len(spikes)] = spikes
        # in units of the spikes' widths the matrix is I + D G D, which is as well conditioned as it can be
        A = np.eye(len(terms)) + equations.G * self.spike[:, None] * self.spike[None, :]
        self.C, half_log_det = inverse(A)
        self.constant = 0.5 * equations.log_w - half_log_det
        self._ratios: dict[tuple[Cause, float], np.ndarray] = {}
        self._residuals: dict[frozenset[Cause], tuple[np.ndarray, np.ndarray, float]] = {}
        self.nothing = self.leant = Widened(self, {}, np.array([], int), np.array([]))
        self._averaged: dict[tuple[Cause, frozenset[Cause]], float] = {}
        self.known: dict[tuple[tuple[Cause, ...], tuple[float, ...]], Hypothesis] = {}

    def lacked(self, causes: Iterable[Cause]) -> frozenset[Cause]:
        """The causes in force that a hypothesis lacks: what they bend goes into its residual."""
        return frozenset(self.in_force) - frozenset(causes)

    def residual(self, absent: frozenset[Cause]) -> tuple[np.ndarray, np.ndarray, float]:
        """X' W r and C X' W r (q,), in units of spikes, and r' W r of a hypothesis without the causes ``absent`` that
        are in force."""
        if absent not in self._residuals:
            b, rr, bends = self.e.b, self.e.rr, self.e.bends
            if absent and bends is not None:
                k = [i for i, c in enumerate(self.in_force) if c in absent]
                b = b + bends.b[k].sum(axis=0)
                rr = rr + 2 * float(bends.r[k].sum()) + float(bends.N[np.ix_(k, k)].sum())
            self._residuals[absent] = b * self.spike, self.C @ (b * self.spike), rr
        return self._residuals[absent]

    def _wide(
        self, causes: Sequence[Cause], slabs: Sequence[float], given: Given = MappingProxyType({})
    ) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the terms that are wide, and how many times wider than their spikes they are: as the slabs say, or
        ``given``."""
        if not causes:
            return np.array([], int), np.array([])
        ratios = [
            given[c] if c in given else self._ratio(c, slab) for c, slab in zip(causes, slabs, strict=True)
        ]
        return np.concatenate([self.members[c] for c in causes]), np.concatenate(ratios)

    def _ratio(self, cause: Cause, slab: float) -> np.ndarray:
        """How many times wider than its spike each term of a cause is."""
        if (cause, slab) not in self._ratios:
            i = self.members[cause]
            ratio = np.clip(slab * self.part[i] / self.together[i] / self.spike[i], 2.0, UNSEEN)
            widest = FURTHEST if slab == FAR else WIDEST
            self._ratios[cause, slab] = np.where(self.relative[i], ratio, np.minimum(ratio, widest))
        return self._ratios[cause, slab]

    def at(self, causes: Iterable[Cause], slabs: Sequence[float]) -> Hypothesis:
        """One hypothesis, with a slab for each cause."""
        causes = tuple(causes)
        key = (causes, tuple(slabs))
        if key not in self.known:
            log_Z = self.log_Z(causes, slabs) - self.chosen(causes) + self.averaged(causes)
            self.known[key] = Hypothesis(causes, tuple(slabs), log_Z, self.prior(causes))
        return self.known[key]

    def log_Z(
        self,
        causes: tuple[Cause, ...],
        slabs: Sequence[float],
        given: Given = MappingProxyType({}),
        absent: frozenset[Cause] | None = None,
    ) -> float:
        """With a slab for each cause, or its terms as many times wider than their spikes as ``given``; ``absent``: the
        causes in force whose bends are charged, if not those that it lacks."""
        base, rest, own = self._nearest(causes, slabs, given)
        wide, ratio = self._wide(rest, own, given)
        z, log_Z = base.standing(self.lacked(causes) if absent is None else absent)
        inside = base.C(wide, wide)
        solved, log_det = woodbury(inside, z[wide], ratio)
        log_Z += -0.5 * float(z[wide] @ solved) - 0.5 * log_det - float(np.log(ratio).sum())
        every = np.concatenate([base.wide, wide])
        bounded = every[np.isfinite(self.low[every])]
        along = [self.paths[c] for c in causes if c in self.paths]
        outwards = [self.fall_offs[c] for c in causes if c in self.fall_offs]
        if not len(bounded) and not along and not outwards:
            return log_Z
        told = np.concatenate([bounded, *along, *outwards])
        beside = base.C(told, wide)
        theta = (z[told] - beside @ solved) * self.spike[told]
        gone = beside @ np.linalg.solve(np.diag(1 / (ratio**-2 - 1.0)) + inside, beside.T)
        covariance = (base.C(told, told) - gone) * np.outer(self.spike[told], self.spike[told])
        n = len(bounded)
        sigma = np.sqrt(np.maximum(np.diag(covariance)[:n], 0))
        least = self.low[bounded] - REACH * np.maximum(self.spike[bounded], sigma)
        if (theta[:n] < least).any():
            log_Z -= raised(theta, covariance, self.low[bounded], least, self.held[bounded])
        last = n + 3 * len(along)
        for k in range(n, last, 3):
            if not is_path(theta[k : k + 3], covariance[k : k + 3, k : k + 3]):
                return -np.inf
        for k, index in zip(range(last, len(told), 2), outwards, strict=True):
            written = np.array([self.terms[i].start for i in index])
            if not falls(written + theta[k : k + 2], covariance[k : k + 2, k : k + 2]):
                return -np.inf
        return log_Z

    def _nearest(
        self, causes: Sequence[Cause], slabs: Sequence[float], given: Given
    ) -> tuple["Widened", tuple[Cause, ...], tuple[float, ...]]:
        """What log Z is told from: the causes that are leant on, or none; and the causes and slabs that those lack."""
        pairs = dict(zip(causes, slabs, strict=True))
        leant = self.leant
        if any(c in given or pairs.get(c) != slab for c, slab in leant.slabs.items()):
            leant = self.nothing
        rest = tuple(c for c in causes if c not in leant.slabs)
        return leant, rest, tuple(pairs[c] for c in rest)

    def lean(self, causes: Sequence[Cause] = (), width: Mapping[Cause, float] = MappingProxyType({})) -> None:
        """Tell log Z of hypotheses that have ``causes``, as wide as ``width`` says, from there: what they have besides
        is all that has to be solved for."""
        slabs = {c: width[c] for c in causes}
        self.leant = (
            Widened(self, slabs, *self._wide(causes, list(slabs.values()))) if causes else self.nothing
        )

    def chosen(self, causes: Iterable[Cause]) -> float:
        """What it costs that causes' widths, and the causes themselves, were chosen among several."""
        return float(sum(np.log(len(self.slabs[c]) * self.ways[c]) for c in causes))

    def averaged(self, causes: Sequence[Cause]) -> float:
        """What log Z averaged over widths is above that of the best, which was ``chosen``: as for each cause alone,
        what the hypothesis lacks being lacking."""
        absent = self.lacked(causes)
        for key in [(c, absent) for c in causes if (c, absent) not in self._averaged]:
            c = key[0]
            found = np.array([self.log_Z((c,), (s,), absent=absent) for s in self.slabs[c]])
            best = found.max()
            self._averaged[key] = float(np.log(np.exp(found - best).sum())) if np.isfinite(best) else 0.0
        return sum(self._averaged[c, absent] for c in causes)

    def alone(
        self, cause: Cause, slab: float, given: Given = MappingProxyType({})
    ) -> tuple[np.ndarray, float]:
        """Of captures that differ from the scene by θ (k,) of a cause alone: Q (k, k), its log Z over none's being
        θ' Q θ less the second."""
        wide, ratio = self._wide((cause,), (slab,), given)
        delta = ratio**-2 - 1.0
        inner = np.eye(len(wide)) + delta[:, None] * self.C[np.ix_(wide, wide)]
        A = self.C[wide] @ (self.e.G[:, wide] * self.spike[:, None])
        Q = -0.5 * A.T @ np.linalg.solve(inner, delta[:, None] * A)
        cost = 0.5 * float(np.linalg.slogdet(inner)[1]) + float(np.log(ratio).sum())
        return (Q + Q.T) / 2, cost

    def theta(self, h: Hypothesis) -> np.ndarray:
        """(q,): posterior mean of every term under a hypothesis."""
        wide, ratio = self._wide(h.causes, h.slabs)
        z, _ = self.nothing.standing(self.lacked(h.causes))
        return np.asarray(
            (z - self.C[:, wide] @ woodbury(self.C[np.ix_(wide, wide)], z[wide], ratio)[0]) * self.spike
        )

    def left(self, h: Hypothesis) -> float:
        """r' W r of what a hypothesis leaves, over what was to be expected of the weights."""
        theta = self.theta(h)
        left = self.e.rr - 2 * theta @ self.e.b + theta @ self.e.G @ theta
        return float(left) / max(self.e.count, 1e-30)

    def _inner(self, h: Hypothesis) -> tuple[np.ndarray, np.ndarray]:
        """The wide terms (m,), and Δ⁻¹ + U'CU (m, m)."""
        wide, ratio = self._wide(h.causes, h.slabs)
        return wide, np.diag(1 / (ratio**-2 - 1.0)) + self.C[np.ix_(wide, wide)]

    def sigma(self, h: Hypothesis) -> np.ndarray:
        """(q,): standard deviation of every term under a hypothesis."""
        wide, inner = self._inner(h)
        gone = np.einsum("ij,jk,ik->i", self.C[:, wide], np.linalg.inv(inner), self.C[:, wide])
        return np.asarray(self.spike * np.sqrt(np.maximum(np.diag(self.C) - gone, 0)))

    def variance(self, h: Hypothesis, along: np.ndarray) -> float:
        """Of ``along``' θ, (q,)."""
        wide, inner = self._inner(h)
        x = along * self.spike
        z = self.C[wide] @ x
        return float(x @ self.C @ x - z @ np.linalg.solve(inner, z))

    def covariance(self, h: Hypothesis, index: Sequence[int] | np.ndarray) -> np.ndarray:
        """(q, k): of every term with the terms ``index`` under a hypothesis."""
        wide, inner = self._inner(h)
        told = np.asarray(index)
        columns: np.ndarray = self.C[:, told] - self.C[:, wide] @ np.linalg.solve(
            inner, self.C[np.ix_(wide, told)]
        )
        return np.asarray(self.spike[:, None] * columns * self.spike[told])

    def best(self, causes: Iterable[Cause], wide: dict[Cause, float]) -> Hypothesis:
        """Over the slabs of the causes that ``wide`` does not fix."""
        causes = tuple(sorted(causes))
        slabs = [wide.get(c, 0.0) for c in causes]
        for i, cause in enumerate(causes):
            if cause in wide:
                continue
            options = [
                self.at(causes, [*slabs[:i], s, *[x or SLABS[1] for x in slabs[i + 1 :]]])
                for s in self.slabs[cause]
            ]
            k = int(np.argmax([h.log_Z for h in options]))
            slabs[i] = self.slabs[cause][k]
        return self.at(causes, slabs)

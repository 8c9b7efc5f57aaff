"""What a hypothesis comes to in numbers, where it stands.

The evidence doubts the causes' formulas, and weighs down what they change most; numbers are as the formulas alone give
them.
"""

import numpy as np
from scipy.optimize import lsq_linear

from analysis.gap.compared import lens_flow
from analysis.gap.evidence.likelihood import Evidence, Hypothesis
from analysis.gap.evidence.stand import Stand
from analysis.gap.search.model import Model
from analysis.gap.search.search import FOLLOWED, Search
from analysis.gap.terms.base import Cause
from analysis.gap.terms.normal_equations import total_of
from analysis.gap.terms.subpixel import along, width_gradient

ROUNDS = 3
SLIGHT = 2e-5  # rms of a calibration error over the signal that is not drawn: 400 of them are less than noise
STRAIGHT = 0.003  # rms over the signal that a number may change the image by from where it was linearised
ALIKE = 1e-9  # of what numbers vary by: the least that is more than rounding
TURNS = 8  # times that a path's width is taken off: it turns as it is
MOST_BENT, STEPS = 4.0, 41  # standard deviations of k2 that a lens which folds may be off by, and tries


def numbers(search: Search, stand: Stand, h: Hypothesis) -> Model:
    """A hypothesis of a stand, followed and linearised where it is. Of calibration's errors those that are slight are
    not drawn."""
    q = search.q
    members = {c: stand.evidence.members[c] for c in h.causes}
    if not h.causes and not stand.evidence.in_force:  # no formula is in doubt there
        return search.model(_drawn(stand.evidence.theta(h), stand.at, stand.evidence.share), stand.at)
    cause = np.isin(np.arange(q), [i for index in members.values() for i in index])
    theta, kept = stand.evidence.theta(h)[:q], stand.kept
    gone = {c for c in stand.best.causes if c not in members}
    at = np.where([t.candidate in gone for t in search.terms], 0.0, stand.at)
    anew: set[int] = set()  # where the stand is nothing has to be drawn anew
    for left in reversed(range(ROUNDS)):
        parts, kept = search.linearised(search.model(at, at), search.terms, at, kept, anew)
        there = Evidence(total_of(parts), search.terms, spikes=stand.evidence.spike[:q])
        if not set(h.causes) <= set(there.members):  # one of them cannot be seen there
            return search.model(possible(stand.evidence, h)[:q], stand.at)
        found = there.best(h.causes, dict(zip(h.causes, h.slabs, strict=True)))
        theta, folded = _unfolded(search, there, found, members)
        aim = search.start(members, theta)
        if not left or (np.abs(aim - at) * there.share)[cause].max(initial=0.0) < STRAIGHT:
            break
        at = aim if folded else search.refined(h.causes, members, theta, at, kept)[1]
        anew = {i for index in members.values() for i in index if search.terms[i].kind in FOLLOWED}
    return search.model(np.where(cause, theta, _drawn(theta, at, there.share)), at)


def possible(there: Evidence, h: Hypothesis) -> np.ndarray:
    """θ (q,): the likeliest where no number of the causes may be below its least: a scene has no glare of less than
    nothing, and what is beside it is another number without."""
    mean = there.theta(h)
    own = np.array([i for c in h.causes for i in there.members[c] if np.isfinite(there.low[i])], int)
    if not len(own) or (mean[own] >= there.low[own]).all():
        return mean
    covariance = there.covariance(h, own)
    unit = np.sqrt(np.maximum(np.diag(covariance[own]), 1e-30))
    alike = covariance[own] / np.outer(unit, unit)
    values, ways = np.linalg.eigh((alike + alike.T) / 2)
    root = ways / np.sqrt(np.maximum(values, ALIKE))  # root root' is the inverse
    bounds = (there.low[own] - mean[own]) / unit, np.full(len(own), np.inf)
    off = lsq_linear(root.T, np.zeros(len(own)), bounds).x
    theta = mean + (covariance / unit) @ (root @ (root.T @ off))
    theta[own] = np.maximum(mean[own] + unit * off, there.low[own])
    return np.asarray(theta)


def straightened(there: Evidence, h: Hypothesis, theta: np.ndarray) -> np.ndarray:
    """θ (q,): the likeliest near ``theta`` where every path is straight, as the file has it: what captures show of its
    width is a blur beside it, as far as they do not tell the two apart. No blur is less than none."""
    paths = {c: there.paths[c] for c in h.causes if c in there.paths}
    if not paths:
        return theta
    for index in paths.values():
        covariance = there.covariance(h, index)
        for _ in range(TURNS):
            slope = width_gradient(theta[index])
            off = covariance @ slope
            theta = theta - off * float(slope @ theta[index]) / max(float(slope @ off[index]), 1e-30)
    own = np.concatenate([there.members[c] for c in h.causes])
    theta[own] = np.maximum(theta[own], there.low[own])
    for index in paths.values():
        theta[index] = along(theta[index])
    return theta


def _drawn(theta: np.ndarray, at: np.ndarray, share: np.ndarray) -> np.ndarray:
    """θ (q,) of which what is slight stays where it stands."""
    return np.where(np.abs(theta - at) * share < SLIGHT, at, theta)


def _unfolded(
    search: Search, there: Evidence, h: Hypothesis, members: dict[Cause, np.ndarray]
) -> tuple[np.ndarray, bool]:
    """θ (q,) of a hypothesis, and whether a lens of its mean folds within the image: then it is the mean where k2 is as
    large as it must be for that. What was compared need not reach the corners, the lens does."""
    theta, folded = straightened(there, h, possible(there, h)), False
    for cause in members:
        lens = {search.terms[i].parameter: int(i) for i in members[cause] if cause[0] == lens_flow.CAUSE}
        if "k2" not in lens:
            continue
        along = there.covariance(h, [lens["k2"]])[:, 0]
        along = along / along[lens["k2"]]
        ways = np.linspace(0, MOST_BENT, STEPS) * there.sigma(h)[lens["k2"]]
        more = next((x for x in ways if not _folds(search, theta + x * along)), 0.0)
        theta, folded = theta + more * along, folded or more > 0
    return theta, folded


def _folds(search: Search, theta: np.ndarray) -> bool:
    model = search.model(theta, theta)
    cameras = {c.camera.name: c for c in search.conditions if lens_flow.has_numbers(c.camera)}
    return any(lens_flow.folds(c.camera, model.lens(c)) for c in cameras.values())

"""How far edges lie from where the simulation has them, px: what gauging asks for.

Where the scene's objects or materials meet, the profile across the edge is fitted in capture and simulation by

    y(t) = a + b t + c Φ((t - t0) / s)

(Φ: the normal distribution's integral; b t: shading beside the edge), by Gauss-Newton with Levenberg's damping. The
offset is t0 of the capture less t0 of the simulation, towards the brighter side. An edge counts where both fits have
enough contrast over noise and end near the profile's middle.

Hagara, Kulla: Edge detection with sub-pixel accuracy based on approximation of edge with Erf function.
Radioengineering 20(2), 2011.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import ndtr

from analysis.gap.parallel import each

REACH, SAMPLES = 4.0, 25  # px on either side; samples of a profile
CONTRAST = 8.0  # least step over the noise of a pixel
MOST = 4000  # edges an image
NEAR, WIDEST = 2.5, 2.5  # px: t0 and s of an edge that counts
MISFIT = 0.03  # of the step, rms: a profile that differs more is no lone edge
SURE = 0.15  # px: most that noise may move an edge that counts


@dataclass(frozen=True, eq=False)
class Fitted:
    """One number a profile, each (n,): place and width px, step and rms misfit DN, and the place's variance for unit
    noise a sample."""

    t0: np.ndarray
    width: np.ndarray
    step: np.ndarray
    misfit: np.ndarray
    variance: np.ndarray


@dataclass(frozen=True)
class EdgeOffsets:
    """px across the edges, capture less simulation: mean and rms over ``count`` edges, and the rms that the sensor's
    noise alone gives (``floor``)."""

    mean: float
    rms: float
    floor: float
    count: int


@dataclass(frozen=True)
class Edges:
    """Where edges of objects and materials lie on the held-out captures, against each simulation."""

    as_written: EdgeOffsets
    before: EdgeOffsets
    after: EdgeOffsets


def offsets(
    captures: Sequence[np.ndarray],
    simulations: Sequence[Sequence[np.ndarray]],
    regions: Sequence[np.ndarray],
    usable: Sequence[np.ndarray],
    noise: Sequence[np.ndarray],
) -> list[EdgeOffsets] | None:
    """Of each of ``simulations`` (a list of images, one a capture), on the same edges for all of them; None where no
    edge can be measured.

    ``captures`` (H, W, C) DN; ``regions`` (H, W) int: edges are where it changes; ``usable`` (H, W) bool;
    ``noise`` (H, W) DN, rms of the mean of the channels.
    """

    def of(k: int) -> tuple[list[np.ndarray], np.ndarray] | None:
        images = [i[k].mean(axis=2).astype(np.float32) for i in (captures, *simulations)]
        return _measured(images[0], images[1:], regions[k], usable[k], noise[k])

    found = [x for x in each(of, range(len(captures))) if x is not None and len(x[1])]
    if not found:
        return None
    floor = float(np.sqrt(np.mean(np.concatenate([own for _, own in found]) ** 2)))
    joined = [np.concatenate([own[i] for own, _ in found]) for i in range(len(simulations))]
    return [EdgeOffsets(float(d.mean()), float(np.sqrt(np.mean(d**2))), floor, len(d)) for d in joined]


def _measured(
    capture: np.ndarray, images: Sequence[np.ndarray], region: np.ndarray, ok: np.ndarray, sigma: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray] | None:
    """Offsets of each image on the edges that all of them show, and each edge's σ by noise."""
    points = _points(images[0], region, ok)
    if not len(points[0]):
        return None
    x, y, normal = points
    t = np.linspace(-REACH, REACH, SAMPLES)
    column = (x[:, None] + t * normal[:, :1]).astype(np.float32)
    row = (y[:, None] + t * normal[:, 1:]).astype(np.float32)
    fits = [fit_edges(t, cv2.remap(i, column, row, cv2.INTER_CUBIC)) for i in (capture, *images)]
    inside = sigma[np.rint(y).astype(int), np.rint(x).astype(int)]
    good = np.ones(len(x), bool)
    for f in fits:
        good &= (np.abs(f.t0) < NEAR) & (f.width < WIDEST) & (f.step > CONTRAST * inside)
        good &= f.misfit < np.hypot(MISFIT * f.step, 2 * inside)
    per_sample = 2 * REACH / (SAMPLES - 1)  # px: neighbouring samples share pixels
    own = fits[0]
    floor = inside * np.sqrt(own.variance / per_sample)
    good &= floor < SURE
    return [(own.t0 - f.t0)[good] for f in fits[1:]], floor[good]


def _points(
    image: np.ndarray, region: np.ndarray, ok: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns, rows and normals (n, 2), towards the brighter side, of places where ``region`` changes and profiles
    stay within the image and cross no second edge."""
    h, w = region.shape
    step = np.zeros(region.shape, bool)
    step[:, 1:] |= region[:, 1:] != region[:, :-1]
    step[1:] |= region[1:] != region[:-1]
    wide = cv2.erode(ok.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    margin = int(REACH) + 2
    wide[:margin], wide[h - margin :], wide[:, :margin], wide[:, w - margin :] = False, False, False, False
    row, column = np.nonzero(step & wide)
    if len(row) > MOST:
        keep = np.linspace(0, len(row) - 1, MOST).astype(int)
        row, column = row[keep], column[keep]
    smooth = cv2.GaussianBlur(image, (0, 0), 1.0)
    gy, gx = np.gradient(smooth)
    g = np.stack([gx[row, column], gy[row, column]], axis=-1).astype(np.float64)
    length = np.linalg.norm(g, axis=1)
    has = length > 0
    row, column, normal = row[has], column[has], g[has] / length[has, None]
    t = np.linspace(-REACH, REACH, 2 * int(REACH) + 1)
    c = np.rint(column[:, None] + t * normal[:, :1]).astype(int)
    r = np.rint(row[:, None] + t * normal[:, 1:]).astype(int)
    crossings = (region[r[:, 1:], c[:, 1:]] != region[r[:, :-1], c[:, :-1]]).sum(axis=1)
    alone = crossings == 1
    return column[alone].astype(np.float64), row[alone].astype(np.float64), normal[alone]


def fit_edges(t: np.ndarray, profiles: np.ndarray) -> Fitted:
    """``t`` (m,) px, ``profiles`` (n, m) DN."""
    y = profiles.astype(np.float64)
    low, high = y[:, :4].mean(axis=1), y[:, -4:].mean(axis=1)
    slope = np.gradient(y, t, axis=1)
    weight = np.maximum(slope, 0) ** 2 + 1e-12
    t0 = (weight * t).sum(axis=1) / weight.sum(axis=1)
    p = np.stack([low, np.zeros(len(y)), high - low, t0, np.full(len(y), 0.7)], axis=1)
    damping = np.full(len(y), 1e-3)
    error, J = _edge(t, y, p)
    cost = (error**2).sum(axis=1)
    for _ in range(15):
        H = np.einsum("nmi,nmj->nij", J, J)
        diagonal = np.einsum("nii->ni", H)
        H = H + (damping[:, None] * diagonal + 1e-9 * diagonal.max(axis=1, keepdims=True) + 1e-30)[
            :, :, None
        ] * np.eye(5)
        move = np.linalg.solve(H, np.einsum("nmi,nm->ni", J, error)[..., None])[..., 0]
        new = p + move
        new[:, 3] = np.clip(new[:, 3], -REACH, REACH)
        new[:, 4] = np.clip(np.abs(new[:, 4]), 0.15, 2 * REACH)
        there, slopes = _edge(t, y, new)
        now = (there**2).sum(axis=1)
        better = now < cost
        p[better], error[better], J[better], cost[better] = (
            new[better],
            there[better],
            slopes[better],
            now[better],
        )
        damping = np.where(better, damping / 5, damping * 5)
    H = np.einsum("nmi,nmj->nij", J, J)
    H = H + 1e-9 * np.einsum("nii->n", H)[:, None, None] * np.eye(5)
    return Fitted(p[:, 3], p[:, 4], p[:, 2], np.sqrt(cost / len(t)), np.linalg.inv(H)[:, 3, 3])


def _edge(t: np.ndarray, y: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is left of ``y`` (n, m), and the model's derivatives (n, m, 5)."""
    a, b, c, t0, s = (p[:, k : k + 1] for k in range(5))
    z = (t - t0) / s
    step, bell = ndtr(z), np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)
    J = np.stack(
        [np.ones_like(z), np.broadcast_to(t, z.shape), step, -c * bell / s, -c * bell * z / s], axis=-1
    )
    return y - (a + b * t + c * step), J

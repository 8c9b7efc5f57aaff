"""Fixed patterns: what is left at the same pixels under different light.

Two conditions a, b of one camera that share no rendered light have residuals r (less the mean of the eight neighbours,
so that what is smooth goes) whose product is, at a pixel with s DN above black,

    E[r_a r_b] = h (PRNU² s_a s_b + DSNU² K_a K_b),    h = 9/8

by least squares over all pixels away from edges and all such pairs; errors by leaving out blocks of the image.
"""

from collections.abc import Sequence
from itertools import combinations

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.noise.finding import NoiseFinding, Number, probability
from analysis.gap.parallel import each

NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.float32) / 8
KEPT = 9 / 8  # h: variance of white noise less the mean of its neighbours
BLOCKS = 8  # a side of the image, for the jackknife
EDGE = 0.03  # step to a neighbour, over the signal, above which a pixel is at an edge
RELATIVE = 0.25  # error of PRNU and DSNU that a data sheet leaves
LEAST = (5e-4, 0.3)  # and of those that are small: 1, e-
WIDE = (0.01, 5.0)  # of patterns that are there
MOST_PAIRS = 30


def fixed_pattern(conditions: Sequence[Condition], simulations: Sequence[np.ndarray]) -> NoiseFinding | None:
    """None where no two conditions of a camera have light of their own each, or share no pixels away from edges."""
    pairs = [
        (a, b)
        for a, b in combinations(range(len(conditions)), 2)
        if conditions[a].camera.name == conditions[b].camera.name
        and conditions[a].mean.shape == conditions[b].mean.shape
        and _apart(conditions[a], conditions[b])
    ]
    if not pairs:
        return None
    pairs = [pairs[i] for i in np.linspace(0, len(pairs) - 1, min(len(pairs), MOST_PAIRS)).astype(int)]
    seen = sorted({i for pair in pairs for i in pair})
    left = dict(zip(seen, each(lambda i: _white(conditions[i], simulations[i]), seen), strict=True))
    total = np.sum(each(lambda pair: _block_sums(conditions, left, *pair), pairs), axis=0)
    if (total[:, 0] > 0).sum() < 2:
        return None
    estimate, covariance = _jackknifed(total)
    sensor = conditions[pairs[0][0]].camera.sensor
    sheet = np.array([sensor.prnu, sensor.dsnu])
    spike = 2 * np.maximum(RELATIVE * sheet, LEAST) * np.maximum(sheet, LEAST)
    slab = np.maximum(3 * sheet, WIDE) ** 2
    p = probability(estimate - sheet**2, covariance, spike, slab)
    rms = np.sqrt(np.maximum(estimate, 0))
    sd = np.sqrt(np.diag(covariance))
    sigma = sd / (2 * np.maximum(rms, 0.5 * np.sqrt(sd)))
    numbers = {
        "prnu": Number(float(rms[0]), float(sigma[0]), "1"),
        "dsnu": Number(float(rms[1]), float(sigma[1]), "e-"),
    }
    return NoiseFinding("fixed_pattern", p, numbers)


def _apart(a: Condition, b: Condition) -> bool:
    """Whether nothing that was rendered is in both: another view, or other lamps."""
    same = a.rendered is not None and b.rendered is not None and a.shown.scene is b.shown.scene
    return not same or (not set(a.lamps) & set(b.lamps) and bool(a.lamps) and bool(b.lamps))


def flat(c: Condition, simulation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(H, W, C) float32: DN above black, and weight; 0 at edges and what is not compared."""
    s = (simulation - c.camera.sensor.black_out).astype(np.float32)
    step = np.abs(s - cv2.filter2D(s, -1, NEIGHBOURS).reshape(s.shape))
    around = np.ones((3, 3), np.uint8)
    inside = cv2.erode(c.usable(c.simulated()).astype(np.uint8), around)[..., None] > 0
    floor = EDGE * np.maximum(s, float(np.median(s)) / 4)
    edge = cv2.dilate((step > floor).max(axis=2).astype(np.uint8), around)[..., None] > 0
    temporal, fixed = c.variance_at(simulation)
    return s, np.where(inside & ~edge, 1 / (temporal / len(c.captures) + fixed), 0).astype(np.float32)


def _white(c: Condition, simulation: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(H, W, C): residual less its neighbours', and what ``flat`` tells."""
    r = (c.mean - simulation).astype(np.float32)
    return (r - cv2.filter2D(r, -1, NEIGHBOURS).reshape(r.shape), *flat(c, simulation))


def _block_sums(
    conditions: Sequence[Condition],
    left: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]],
    a: int,
    b: int,
) -> np.ndarray:
    """(BLOCKS², 5): normal equations of every block: x1 x1, x1 x2, x2 x2, x1 y, x2 y."""
    (r_a, s_a, w_a), (r_b, s_b, w_b) = left[a], left[b]
    w = w_a * w_b
    x1 = KEPT * s_a * s_b
    x2 = np.full_like(x1, KEPT * conditions[a].camera.sensor.K_out * conditions[b].camera.sensor.K_out)
    y = r_a * r_b
    planes = [(w * p).sum(axis=2) for p in (x1 * x1, x1 * x2, x2 * x2, x1 * y, x2 * y)]
    h, v = planes[0].shape
    rows = np.minimum(np.arange(h) * BLOCKS // h, BLOCKS - 1)[:, None]
    columns = np.minimum(np.arange(v) * BLOCKS // v, BLOCKS - 1)[None, :]
    block = (rows * BLOCKS + columns).reshape(-1)
    return np.stack([np.bincount(block, p.reshape(-1).astype(np.float64), BLOCKS**2) for p in planes], axis=1)


def _jackknifed(total: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """PRNU², DSNU² and their covariance."""
    everything = total.sum(axis=0)
    fewer = np.array([_solved(everything - block) for block in total if block[0] > 0])
    n = len(fewer)
    off = fewer - fewer.mean(axis=0)
    return _possible(everything), (n - 1) / max(n, 1) * off.T @ off + np.diag([1e-16, 1e-8])


def _possible(sums: np.ndarray) -> np.ndarray:
    """Least squares of what is no less than 0: a square that is told below is noise of the estimate, which the other
    has a part of."""
    both = _solved(sums)
    if (both >= 0).all():
        return both
    alone = np.maximum(sums[3:], 0) / np.maximum(sums[[0, 2]], 1e-300)
    return np.where(np.arange(2) == np.argmax(alone * np.maximum(sums[3:], 0)), alone, 0.0)


def _solved(sums: np.ndarray) -> np.ndarray:
    A = np.array([[sums[0], sums[1]], [sums[1], sums[2]]])
    scale = 1 / np.sqrt(np.maximum(np.diag(A), 1e-300))
    B = A * scale[:, None] * scale[None, :] + 1e-9 * np.eye(2)
    return np.asarray(scale * np.linalg.solve(B, scale * sums[3:]))

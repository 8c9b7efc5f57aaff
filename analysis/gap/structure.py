"""Whether what is left has structure: covariance of (mean of captures - simulated) / σ with itself a few pixels on.

Noise of pixels, a sensor's as a path tracer's, is white: pixels share none of it. What an effect leaves is smooth, or
follows surfaces: pixels near each other share most of it. Away from edges,

    S_d = mean of z(u) z(u + d) along columns and along rows, d = 1, 2, 4, 8 px,      W = mean of z² - 1 - S_1

S of each condition by itself, and of the mean over a camera's conditions, where what is fixed to the image stands out.
In units of the sensor's variance of a condition's mean; 0 where nothing but noise is left.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.gap.conditions import Condition
from analysis.gap.fixed_pattern import flat
from analysis.gap.parallel import each

STEPS = (1, 2, 4, 8)  # px


@dataclass(frozen=True)
class Structure:
    """``white``: beyond the sensor's noise, from pixel to pixel; ``near``: S_d of each of ``STEPS``, mean over
    conditions; ``fixed``: the same of the mean over a camera's conditions, times their number."""

    white: float
    near: tuple[float, ...]
    fixed: tuple[float, ...]


def structure(conditions: Sequence[Condition], simulated: Sequence[np.ndarray]) -> Structure:
    """Of conditions whose expected DN are ``simulated``, (H, W, C) each."""

    def left(both: tuple[Condition, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        c, dn = both
        _, w = flat(c, dn)
        return (c.mean - dn) * np.sqrt(w), w > 0

    planes = each(left, list(zip(conditions, simulated, strict=True)))
    near = np.array([_near(z, ok) for z, ok in planes])
    square = np.array([[(z**2).sum() - ok.sum(), ok.sum()] for z, ok in planes]).sum(axis=0)
    cameras = dict.fromkeys(c.camera.name for c in conditions)
    fixed = []
    for camera in cameras:
        own = [p for c, p in zip(conditions, planes, strict=True) if c.camera.name == camera]
        if len({z.shape for z, _ in own}) == 1:
            count = np.sum([ok for _, ok in own], axis=0)
            total = np.sum([np.where(ok, z, 0) for z, ok in own], axis=0) / np.sqrt(np.maximum(count, 1))
            fixed.append(_near(total, count > 0))
    everything = near.sum(axis=0)
    shares = everything[:, 0] / np.maximum(everything[:, 1], 1)
    of_cameras = np.sum(fixed, axis=0) if fixed else np.zeros((len(STEPS), 2))
    return Structure(
        float(square[0] / max(square[1], 1) - shares[0]),
        tuple(float(x) for x in shares),
        tuple(float(x) for x in of_cameras[:, 0] / np.maximum(of_cameras[:, 1], 1)),
    )


def _near(z: np.ndarray, ok: np.ndarray) -> np.ndarray:
    """(n, 2): sum of products of values ``STEPS`` apart, and how many there are."""
    z = np.where(ok, z, 0.0)
    found = []
    for d in STEPS:
        products = [(z[d:] * z[:-d]).sum(), (z[:, d:] * z[:, :-d]).sum()]
        counts = [(ok[d:] & ok[:-d]).sum(), (ok[:, d:] & ok[:, :-d]).sum()]
        found.append((float(sum(products)), float(sum(counts))))
    return np.array(found)

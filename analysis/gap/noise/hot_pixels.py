"""Hot pixels: single ones that are the brighter the longer the exposure, whatever the light.

Of condition c of a camera, exposed for t_c, with s_c DN above black at a pixel, the residual less the median of its
neighbours' is

    r_c = K_c (t_c I + d) + s_c p + noise

I its dark current beyond its neighbours', d its offset, p its gain's: least squares a pixel, of all its conditions.
A pixel is hot where I is ``SURE`` of its standard deviations, by the noise or by what the line leaves, whichever is
more. A speck on a surface is none (p), nor a highlight of one lamp (the line leaves it). Under one and the same light
nothing tells I from p.

Dark currents of hot pixels are exponential (Widenhorn et al. 2002), so that those beyond a limit exceed it by their
mean, and exp(-limit / mean) of them are beyond it. Where that is less than half of them it is extrapolation, and they
are told as those that are seen, and no more.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.finding import PRESENT
from analysis.gap.noise.finding import Number, certainty
from analysis.gap.sensor.expected import noise_variance, rounding
from interchange.effects.parts import called

APART = 2.0  # times the shortest exposure that the longest is, from which on exposures tell
CANDIDATE = 4.0  # of noise, in a longest exposure: what is looked at by itself
SURE = 6.0
BY_CHANCE = 0.5  # of a camera's pixels that look hot and are not
GAIN, OFFSET = (
    1e3,
    50.0,
)  # priors of p (1) and d (e-): none, as a gain does what I does where light is the same, and little
# what a picture shows of one pixel besides: what its surface has that no p tells, over the signal, and edges, px
TEXTURE, SHIFT = 0.02, 0.1
HALF = 0.455  # of a squared standard normal number, its median
SEEN = 0.5  # of those that there are, that must be beyond the limit to tell of the others
MOST = 0.01  # of all pixels: what more have is something else
FEWEST = 4  # conditions that see a pixel, one more than numbers that are told
LISTED = 20  # pixels
HOT = "hot_"  # what numbers of them are called by, before those of the effect
AROUND = 3  # px, of the median


@dataclass(frozen=True, eq=False)
class HotPixels:
    """Of one camera: ``current`` (H, W, C) e-/s beyond the neighbours', 0 where a pixel is not hot, ``limit`` what the
    ``count`` of those that are could be told from; ``mean`` e-/s and ``share`` of all pixels: of the exponential
    distribution that they are the tail of."""

    current: np.ndarray
    limit: np.ndarray

    @property
    def sites(self) -> np.ndarray:
        """(H, W) bool."""
        return np.asarray((self.current > 0).any(axis=2))

    @property
    def count(self) -> int:
        return len(self.limit)

    @property
    def mean(self) -> float:
        own = self.current[self.current > 0]
        return float(own.mean() - (self.limit.mean() if self._beyond >= SEEN else 0.0))

    @property
    def share(self) -> float:
        beyond = self._beyond
        return float(self.count / (beyond if beyond >= SEEN else 1.0) / self.current.size)

    @property
    def _beyond(self) -> float:
        """Which part of an exponential distribution is beyond the limit."""
        mean = float((self.current[self.current > 0] - self.limit).mean())
        return float(np.exp(-self.limit / mean).mean())

    @property
    def probability(self) -> float:
        """That they are not by chance."""
        n = self.count
        return certainty(n * np.log(n / BY_CHANCE) - (n - BY_CHANCE))


def hot_pixels(conditions: Sequence[Condition], simulations: Sequence[np.ndarray]) -> dict[str, HotPixels]:
    """Of each camera that has some. ``simulations``: (H, W, C) DN of each condition with all that is known of it."""
    cameras = dict.fromkeys(c.camera.name for c in conditions)
    found = {name: _of_one([k for k, c in enumerate(conditions) if c.camera.name == name], conditions, simulations)
             for name in cameras}  # fmt: skip
    return {name: hot for name, hot in found.items() if hot is not None and hot.probability >= PRESENT}


def numbers(hot: Mapping[str, HotPixels]) -> dict[str, Number]:
    """Of all cameras that have some."""
    each = np.array([x.count for x in hot.values()])
    share, mean = (
        float(np.average([getattr(x, n) for x in hot.values()], weights=each)) for n in ("share", "mean")
    )
    off = 1 / np.sqrt(each.sum())
    return {f"{HOT}share": Number(share, share * off, "1"), f"{HOT}current": Number(mean, mean * off, "e-/s")}


def places(hot: Mapping[str, HotPixels]) -> tuple[str, ...]:
    """A sentence of each camera, the hottest pixels first."""
    out = []
    for name, x in hot.items():
        order = np.argsort(-x.current, axis=None)[: x.count]
        rows, columns, _ = np.unravel_index(order, x.current.shape)
        listed = [
            f"({u}, {v}) {i:.0f}" for u, v, i in zip(columns, rows, x.current.reshape(-1)[order], strict=True)
        ][:LISTED]
        more = f" and {x.count - LISTED} more" if x.count > LISTED else ""
        out.append(
            f"Of {called(name)} {x.count} pixels are hot, brighter the longer the exposure whatever the light; column, "
            f"row and dark current in e-/s beyond their neighbours': {', '.join(listed)}{more}."
        )
    return tuple(out)


def less_hot(conditions: Sequence[Condition], hot: Mapping[str, HotPixels]) -> list[Condition]:
    """The conditions without pixels that are hot: of these noise and fixed patterns say nothing."""
    return [
        replace(c, mask=c.mask & ~hot[c.camera.name].sites) if c.camera.name in hot else c for c in conditions
    ]


def _of_one(
    own: Sequence[int], conditions: Sequence[Condition], simulations: Sequence[np.ndarray]
) -> HotPixels | None:
    times = np.array([conditions[k].camera.t_exp for k in own])
    alike = len({simulations[k].shape for k in own}) == 1
    if not alike or len(own) < FEWEST or times.max() < APART * times.min():
        return None
    seen = [_residual(conditions[k], simulations[k]) for k in own]
    longest = [
        r > CANDIDATE * np.sqrt(v) for (r, v, _), t in zip(seen, times, strict=True) if t == times.max()
    ]
    place = np.nonzero(np.any(longest, axis=0))
    if not len(place[0]):
        return None
    current, sigma = _currents(seen, place, [conditions[k] for k in own], times)
    sure = current > SURE * sigma
    n = int(sure.sum())
    if not 0 < n <= MOST * simulations[own[0]].size:
        return None
    plane = np.zeros(simulations[own[0]].shape, np.float32)
    plane[tuple(p[sure] for p in place)] = current[sure]
    order = np.argsort(np.ravel_multi_index(tuple(p[sure] for p in place), plane.shape))
    return HotPixels(plane, SURE * sigma[sure][order])


def _residual(c: Condition, simulation: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(H, W, C): residual less its neighbours' median, DN; its variance, infinite where nothing is compared; DN above
    black."""
    r = (c.mean - simulation).astype(np.float32)
    around = np.stack(
        [cv2.medianBlur(np.ascontiguousarray(r[..., k]), AROUND) for k in range(r.shape[2])], axis=2
    )
    off = r - around
    variance = noise_variance(simulation, c.camera)[0] / len(c.captures) + c.step**2 * rounding(
        c.camera.sensor
    )
    s = (simulation - c.camera.sensor.black_out).astype(np.float32)
    down, along = np.gradient(s, axis=(0, 1))
    variance = variance + (TEXTURE * s) ** 2 + SHIFT**2 * (down**2 + along**2)
    usable = c.usable(c.simulated())[..., None] & np.ones(off.shape, bool)
    if usable.any():  # no data sheet is believed that most pixels do not keep to
        variance = variance * max(float(np.median(off[usable] ** 2 / variance[usable])) / HALF, 1.0)
    return off, np.where(usable, variance, np.inf).astype(np.float32), s


def _currents(
    seen: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]],
    place: tuple[np.ndarray, ...],
    own: Sequence[Condition],
    times: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """I (n,) e-/s of the pixels at ``place``, and its standard deviation."""
    r, v, s = (
        np.stack([plane[place] for plane in planes], axis=1).astype(float)
        for planes in zip(*seen, strict=True)
    )
    K = np.array([c.camera.sensor.K_out for c in own])
    X = np.stack([np.broadcast_to(K * times, s.shape), s, np.broadcast_to(K, s.shape)], axis=2)
    w = 1 / v
    A = np.einsum("nc,nci,ncj->nij", w, X, X) + np.diag([0.0, GAIN**-2, OFFSET**-2])
    A[:, 0, 0] += 1e-12 * (1 + A[:, 0, 0])  # where nothing is seen
    covariance = np.linalg.inv(A)
    theta = np.einsum("nij,nc,ncj,nc->ni", covariance, w, X, r)
    count = (w > 0).sum(axis=1)
    left = (w * (r - np.einsum("nci,ni->nc", X, theta)) ** 2).sum(axis=1) / np.maximum(count - 3, 1)
    sigma = np.sqrt(covariance[:, 0, 0] * np.maximum(left, 1))
    return theta[:, 0], np.where(count >= FEWEST, sigma, np.inf)

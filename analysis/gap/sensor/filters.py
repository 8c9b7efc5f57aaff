"""n x n pixels of a colour sensor as one, n even: each channel is measured by the pixels that have its filter alone.

A channel's light is the mean over the squares of those pixels, a quarter of what a pixel without filters would see,
and lies aside of the middle: by 1/2n of what is one pixel here, red and blue to opposite sides. On the grid that light
is rendered on, which is finer than the sensor's, that is the mean over a part of it; what is rendered on the sensor's
own grid is moved by as much.
"""

from dataclasses import dataclass

import numpy as np

from interchange.camera import Camera
from interchange.effects.mosaic import phases
from interchange.filtering import resample
from interchange.sensor import Mosaic, Sensor


@dataclass(frozen=True)
class Averaging(Sensor):
    """A sensor whose values are means of so many ``codes``, each rounded and dithered by its own noise."""

    codes: int = 1


@dataclass(frozen=True)
class BehindFilters(Averaging):
    """A sensor of three channels; each pixel is ``across`` x ``across`` of a mosaic's with this ``pattern``."""

    pattern: Mosaic = Mosaic.RGGB
    across: int = 2


def sites(pattern: Mosaic) -> list[tuple[int, int]]:
    """(row, column) in the pattern of the pixels that red, green and blue are measured by; one of both greens, so that
    all three have the same noise."""
    found: dict[int, tuple[int, int]] = {}
    for i, j, channel in phases(pattern):
        found.setdefault(channel, (i, j))
    return [found[channel] for channel in range(3)]


def offsets(camera: Camera) -> np.ndarray | None:
    """(3, 2) px, columns and rows: how far from a pixel's middle each channel is measured; None where it is there."""
    sensor = camera.sensor
    if not isinstance(sensor, BehindFilters):
        return None
    return np.array([[(j - 0.5), (i - 0.5)] for i, j in sites(sensor.pattern)]) / sensor.across


def shares(sensor: BehindFilters, finer: int) -> np.ndarray:
    """(3, finer, finer): of each part of a pixel in what a channel measures, those of one channel with sum 1."""
    n = sensor.across
    ends = np.arange(finer + 1) / finer
    by_place = []
    for first in (0, 1):
        starts = (first + 2 * np.arange(n // 2)) / n
        covered = np.clip(ends[:, None] - starts, 0, 1 / n).sum(axis=1)  # of the pixel's side, up to there
        by_place.append(2 * np.diff(covered))
    return np.array([np.outer(by_place[i], by_place[j]) for i, j in sites(sensor.pattern)])


def seen_through(fine: np.ndarray, finer: int, sensor: BehindFilters) -> np.ndarray:
    """(H, W, 3) float32 of (finer H, finer W, 3)."""
    h, w = fine.shape[0] // finer, fine.shape[1] // finer
    whole = fine[: h * finer, : w * finer]
    out = np.zeros((h, w, 3), np.float32)
    for channel, share in enumerate(shares(sensor, finer)):
        for a, b in np.argwhere(share > 0):
            out[..., channel] += np.float32(share[a, b]) * whole[a::finer, b::finer, channel]
    return out


def at_filters(plane: np.ndarray, camera: Camera) -> np.ndarray:
    """(H, W, 3) of what is rendered on the sensor's own grid, each channel where it is measured."""
    aside = offsets(camera)
    if aside is None or not plane.any():
        return plane
    column, row = (
        x.astype(np.float32) for x in np.meshgrid(np.arange(plane.shape[1]), np.arange(plane.shape[0]))
    )
    own = [
        resample(np.ascontiguousarray(plane[..., c : c + 1], np.float32), column + u, row + v)
        for c, (u, v) in enumerate(aside.astype(np.float32))
    ]
    return np.concatenate(own, axis=2)

"""Whether captures were interpolated from a mosaic of colours where the scene says that every pixel measures all of
them: most colour cameras have one. Two of a pixel's three numbers are made of the neighbours' then and have less noise
than what it measured, which would be taken for a sensor with less noise.

What was interpolated follows from what was measured nearby: by least squares, with weights of its own for each place of
the 2 x 2 pixels. Only where the pattern is the right one; by any other, and in captures where every pixel measured all,
noise is left. Linear ways of interpolating leave rounding alone, those that choose by edges or that a curve follows
still less than half. A JPEG hides it.

Popescu, Farid: Exposing digital forgeries in color filter array interpolated images. IEEE Transactions on Signal
Processing 53(10), 2005.
"""

from collections.abc import Sequence

import numpy as np

from interchange.camera import Camera
from interchange.captures import Capture
from interchange.effects.demosaic import Demosaic as Interpolation
from interchange.effects.mosaic import phases
from interchange.image import Image
from interchange.sensor import Demosaic, Mosaic

AROUND = 2  # px that interpolation looks at on each side
LOOKED_AT = 6000  # pixels of each place of the pattern, of a capture
LEAST = 500  # the same, at least: 26 weights are fitted to them
SHARP = 0.2  # of the pixels, those that follow least: edges, which some ways of interpolating treat apart
# times as much is left by any other pattern. Without a mosaic all leave within 2 % the same (10,000 pixels); with one
# 1.4 (8 bits, variable number of gradients), 2.5 (8 bits, sRGB's curve) to 70 times
CLEAR = 1.25


def mosaic_of(captures: Sequence[Capture], camera: Camera) -> tuple[Mosaic, Demosaic] | None:
    """The mosaic that ``captures`` by one camera were interpolated from, and which way of interpolating is the nearest;
    None where the scene says one, or they were not."""
    if camera.sensor.mosaic is not Mosaic.NONE or any(c.pixels.shape[2] != 3 for c in captures):
        return None
    pixels = max(captures, key=lambda c: float(c.pixels.mean())).pixels
    if min(pixels.shape[:2]) <= 2 * AROUND or pixels.shape[0] * pixels.shape[1] < 4 * LEAST:
        return None
    left = {pattern: _left(pixels, pattern) for pattern in Mosaic if pattern.is_bayer}
    pattern, second = sorted(left, key=lambda p: left[p])[:2]
    if left[second] < CLEAR * left[pattern]:
        return None
    ways = (Demosaic.BILINEAR, Demosaic.EDGE_AWARE)
    return pattern, min(ways, key=lambda way: _missed(pixels, camera, pattern, way))


def _measured(pixels: np.ndarray, pattern: Mosaic) -> np.ndarray:
    """(H, W): of each pixel what a mosaic would have measured."""
    own = np.empty(pixels.shape[:2], np.float32)
    for i, j, channel in phases(pattern):
        own[i::2, j::2] = pixels[i::2, j::2, channel]
    return own


def _left(pixels: np.ndarray, pattern: Mosaic) -> float:
    """Mean difference, DN, of what ``pattern`` says was interpolated from what nearby measurements make of it."""
    side = 2 * AROUND + 1
    around = np.lib.stride_tricks.sliding_window_view(_measured(pixels, pattern), (side, side))
    inside = pixels[AROUND:-AROUND, AROUND:-AROUND]
    rng = np.random.default_rng(0)
    left = []
    for i, j, measured in phases(pattern):  # AROUND is even: places are the same inside
        near, there = around[i::2, j::2], inside[i::2, j::2]
        count = there.shape[0] * there.shape[1]
        chosen = rng.choice(count, min(count, LOOKED_AT), replace=False)
        row, column = np.unravel_index(chosen, there.shape[:2])
        a = near[row, column].reshape(len(chosen), -1).astype(np.float64)
        a = np.concatenate([a, np.full((len(a), 1), max(a.mean(), 1.0))], axis=1)
        for channel in {0, 1, 2} - {measured}:
            left.append(_not_followed(a, there[row, column, channel].astype(np.float64)))
    return float(np.mean(left)) + 1e-6


def _not_followed(a: np.ndarray, y: np.ndarray) -> float:
    """Mean of |y - a w| (n,), w (m,) by least squares, without the ``SHARP`` that follow least."""
    kept = np.ones(len(y), bool)
    for _ in range(2):
        off = np.abs(y - a @ np.linalg.lstsq(a[kept], y[kept], rcond=None)[0])
        kept = off <= np.quantile(off, 1 - SHARP)
    return float(off[kept].mean())


def _missed(pixels: np.ndarray, camera: Camera, pattern: Mosaic, way: Demosaic) -> float:
    """Mean difference, DN, of a capture and of what a way of interpolating makes of what its pixels measured."""
    made = (
        Interpolation(way, pattern).apply(Image(_measured(pixels, pattern)[..., None]), camera, None).pixels
    )
    return float(np.abs(made - pixels)[AROUND:-AROUND, AROUND:-AROUND].mean())

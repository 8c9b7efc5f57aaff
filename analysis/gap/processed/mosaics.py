"""Whether captures are of a mosaic of colours where the scene says that every pixel measures all of them: most colour
cameras have one.

Interpolated, two of a pixel's three numbers are made of the neighbours' and have less noise than what it measured,
which would be taken for a sensor with less noise. What was interpolated follows from what was measured nearby: by least
squares, with weights of its own for each place of the 2 x 2 pixels. Only where the pattern is the right one; by any
other, and in captures where every pixel measured all, noise is left. Linear ways of interpolating leave rounding alone,
those that choose by edges or that a curve follows still less than half. A JPEG hides it from that:
analysis.gap.processed.processing tells it there.

Raw, neighbours differ in colour: a pixel and the mean of the four around it, which leaves neither even light nor a
gradient, differ in the same way all over a surface, the two greens of 2 x 2 pixels alike. Which of the other two is red
the captures alone do not say, so it is asked for.

Popescu, Farid: Exposing digital forgeries in color filter array interpolated images. IEEE Transactions on Signal
Processing 53(10), 2005.
"""

from collections.abc import Sequence

import cv2
import numpy as np

from interchange.camera import Camera
from interchange.captures import Capture, Captures
from interchange.effects.demosaic import Demosaic as Interpolation
from interchange.effects.mosaic import phases
from interchange.image import Image
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.sensor import Demosaic, Mosaic

TILE, TILES = 16, 12  # px along a side, within which raw neighbours differ alike; that many at least
COLOURED = 0.01  # of the signal, that raw neighbours of different colours differ by at least, rms over tiles
ALIKE = 0.4  # of that, that both greens differ by at most
AROUND = 2  # px that interpolation looks at on each side
LOOKED_AT = 6000  # pixels of each place of the pattern, of a capture
LEAST = 500  # the same, at least: 26 weights are fitted to them
SHARP = 0.2  # of the pixels, those that follow least: edges, which some ways of interpolating treat apart
# times as much is left by any other pattern. Without a mosaic all leave within 2 % the same (10,000 pixels); with one
# 1.4 (8 bits, variable number of gradients), 2.5 (8 bits, sRGB's curve) to 70 times
CLEAR = 1.25

CROSS = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.float32) / 4


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


def must_say_its_mosaic(captures: Captures, scene: Scene) -> None:
    """Raise BrightfieldError for a camera without a mosaic in the scene whose captures are raw, of one."""
    silent = {c.name for c in scene.cameras if c.sensor.mosaic is Mosaic.NONE}
    for name in dict.fromkeys(c.camera for c in captures.captures if c.camera in silent):
        own = [c for c in captures.captures if c.camera == name and c.pixels.shape[2] == 1]
        if own and (maybe := _raw_of(max(own, key=lambda c: float(c.pixels.mean())).pixels[..., 0])):
            raise BrightfieldError(
                f"The captures of {name} have one channel, and neighbouring pixels differ by colour as those of a raw "
                f"mosaic do: say which it is in the scene file, sensor:mosaic = {' or '.join(maybe)}. "
                f"({own[0].where.file})"
            )


def _raw_of(pixels: np.ndarray) -> tuple[Mosaic, ...]:
    """The mosaics that (H, W) may be raw values of: two with the same greens, all four where red and blue differ as
    little, or none."""
    h, w = (n // TILE * TILE for n in pixels.shape)
    plane = np.ascontiguousarray(pixels, np.float32)
    beside = (plane - cv2.filter2D(plane, -1, CROSS, borderType=cv2.BORDER_REFLECT_101))[:h, :w]
    tiles = beside.reshape(h // TILE, TILE // 2, 2, w // TILE, TILE // 2, 2).transpose(2, 5, 0, 3, 1, 4)
    off = np.median(tiles.reshape(2, 2, -1, (TILE // 2) ** 2), axis=3)  # of each place of 2 x 2, in each tile
    if off.shape[2] < TILES:
        return ()

    signal = float(pixels.mean())
    found: list[Mosaic] = []
    for a, b, maybe in (
        (off[0, 0], off[1, 1], (Mosaic.GRBG, Mosaic.GBRG)),
        (off[0, 1], off[1, 0], (Mosaic.RGGB, Mosaic.BGGR)),
    ):
        shared = float(np.sqrt(max(np.mean(a * b), 0.0)))
        if shared > COLOURED * signal and float(np.sqrt(np.mean((a - b) ** 2))) < ALIKE * shared:
            found += maybe
    return tuple(found)


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

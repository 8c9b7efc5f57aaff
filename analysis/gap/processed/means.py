"""Means over n x n pixels of JPEGs: what compressing, and what a colour camera did to its pixels before, leave in them.

What is interpolated shares its neighbours' noise, of which means keep up to four times as much as of pixels that
measured every channel; edges are a part of a pixel wider, and a matrix adds channels' noise. All of it is simulated on
the sensor's own pixels: the simulation, with edges as sharp as light was rendered, and noise of its size go through the
camera's processing, and means are taken of that as of the captures. What that is off by in the mean is taken off the
captures, and they are weighed by what it is off by with noise (analysis.gap.compared.conditions), the mean among it:
it is only as true as the simulation's edges are.

Whether there is a mosaic that the scene file does not say is told by noise, and which it is where colours meet, if
means are of so few pixels that they show it. Where light was rendered no finer than means are, nothing says how sharp
edges are: then they weigh less, and nothing is taken off.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.radiance import means, single
from analysis.gap.parallel import each
from analysis.gap.processed.compressed import Compressed, compressed
from analysis.gap.processed.declared import of_bits
from analysis.gap.processed.matrices import Matrix, encoded_above, linear_above
from analysis.gap.processed.processing import BAYER, Processing, mosaic_shown
from analysis.gap.processed.taken_as import Told, taken_for
from analysis.gap.sensor.expected import noise_variance, rounding
from interchange.camera import Camera
from interchange.captures import Captures
from interchange.effects.jpeg import Jpeg
from interchange.scene import Scene
from interchange.sensor import Mosaic

DARK = 1e-3  # of the brightest light, beside which a share of it says nothing
PAIRS = 2  # of draws, with noise and with the same noise less
SOME_MOSAIC = Mosaic.RGGB  # means of all are alike


@dataclass(frozen=True, eq=False)
class Own:
    """The sensors' own pixels, n x n of which are one: ``cameras`` by name, as their files are."""

    n: int
    cameras: Mapping[str, Camera]

    def told(self, told: Sequence[Told]) -> "Own":
        return replace(self, cameras={name: taken_for(c, told) for name, c in self.cameras.items()})


def own_pixels(captures: Captures, scene: Scene, n: int) -> Own:
    bits = {x.camera: x.bits for x in captures.captures}
    return Own(n, {c.name: of_bits(c, bits[c.name]) for c in scene.cameras if c.name in bits})


def compressed_files(captures: Captures, own: Own) -> list[Compressed]:
    """The cameras whose captures are JPEGs of which the scene does not say, told by their own pixels."""
    return compressed([(own.cameras[x.camera], x) for x in captures.captures])


def with_errors_of_means(
    found: Sequence[Condition], own: Own, said: Mapping[str, Processing], mixed: Sequence[Matrix] = ()
) -> tuple[list[Condition], list[Processing]]:
    """The conditions of cameras whose images are JPEGs, with what processing is off by in their means; and by camera
    what that is: ``said`` by the scene file, through ``mixed`` matrices, which were taken back besides, and through a
    mosaic where none is said and their noise is nearer to one's."""
    packed = [c for c in found if own.cameras[c.camera.name].sensor.jpeg_quality]
    of = {m.camera: m for m in mixed}
    by: dict[str, Processing] = {}
    for c in sorted(packed, key=lambda c: -float(c.mean.mean())):
        name, camera = c.camera.name, own.cameras[c.camera.name]
        if name not in by:
            plain = replace(said.get(name, Processing(camera)), camera=camera).mixed_further(of.get(name))
            by[name] = plain
            if c.mean.shape[2] == 3 and camera.sensor.mosaic is plain.mosaic is Mosaic.NONE:
                by[name] = _with_mosaic(c, own.n, plain)

    def one(c: Condition) -> Condition:
        name = c.camera.name
        if name not in by:
            return c
        draws = _off(c, own.n, by[name], PAIRS)
        mean = draws.mean(axis=0)
        if not c.shown.fine:  # nothing says where in a mean its edges lie
            return replace(c, packed=draws[0])
        return replace(c, mean=c.mean - mean, packed=draws[0])

    return each(one, found), list(by.values())


def _with_mosaic(c: Condition, n: int, plain: Processing) -> Processing:
    """What a camera does that may have a mosaic, by the noise of its captures."""
    behind = {p: replace(plain, mosaic=p, mosaic_is_said=False) for p in BAYER}
    pure, interpolated = (_rough(_off(c, n, p, 1)[0]) for p in (plain, behind[SOME_MOSAIC]))
    if _rough(c.mean - c.simulated().dn) ** 2 < pure * interpolated:  # by logarithms
        return plain
    if not c.shown.fine:
        return behind[SOME_MOSAIC]

    def off(pattern: Mosaic) -> np.ndarray:
        by = plain if pattern is Mosaic.NONE else behind[pattern]
        return np.asarray(_off(c, n, by, 1).mean(axis=0))

    shown = mosaic_shown(c, off)
    return behind[shown if shown.is_bayer else SOME_MOSAIC]


def enlarged(c: Condition, n: int, camera: Camera) -> np.ndarray:
    """(n H, n W, C) DN of ``camera``, n x n pixels of which are one of the condition's: the simulation, as sharp as its
    light was rendered."""
    dn = c.simulated().dn
    h, w = dn.shape[:2]
    above = linear_above(dn, camera).astype(np.float32)
    each_pixel = np.repeat(np.repeat(above, n, 0), n, 1)
    if not c.shown.fine:
        return encoded_above(each_pixel, camera)
    rows, columns = c.shown.frame
    light = np.zeros((rows.stop - rows.start, columns.stop - columns.start, 3), np.float32)
    for name, weight in c.shown.weights(c.scene).items():
        if weight.any() and name in c.shown.fine:
            light += single(c.shown.fine[name][rows, columns]) * weight.astype(np.float32)
    if dn.shape[2] == 1:
        light = light.mean(axis=2, keepdims=True)
    least = DARK * float(light.max()) or 1.0
    sharp = _resized(light, (n * w, n * h), cv2.INTER_AREA)
    ratio = (sharp + least) / (np.repeat(np.repeat(means(sharp, n), n, 0), n, 1) + least)
    return encoded_above(each_pixel * ratio, camera)


def _off(c: Condition, n: int, before: Processing, pairs: int) -> np.ndarray:
    """(2 ``pairs``, H, W, C) float32 DN by which means of processed pixels are off those of the same as they were, with
    noise and with the same noise less in turn: in their mean what processing does to noise in proportion is undone, and
    codes are dithered."""
    camera, rng = before.camera, np.random.default_rng(0)
    camera = replace(
        camera, t_exp=c.camera.t_exp, sensor=replace(camera.sensor, gain_dB=c.camera.sensor.gain_dB)
    )
    dn, top, by = enlarged(c, n, camera), 2**camera.sensor.bits_out - 1, Jpeg.of(camera)
    variance, pure = np.add(*noise_variance(dn, camera)), _means(dn, n, camera)
    sigma = np.sqrt(np.maximum(variance - rounding(camera.sensor), 0))  # codes are rounded below

    def again(noise: np.ndarray) -> np.ndarray:
        there = np.clip(np.rint(before.applied(dn + noise)), 0, top).astype(np.uint8)
        return _means(before.taken_back(by.compressed(there)), n, camera) - pure

    off = np.zeros((2 * pairs, *pure.shape), np.float32)
    for k in range(pairs):
        for _ in c.captures:
            noise = sigma * rng.standard_normal(dn.shape, np.float32)
            off[2 * k : 2 * k + 2] += np.stack([again(noise), again(-noise)]) / len(c.captures)
    return off


def _means(dn: np.ndarray, n: int, camera: Camera) -> np.ndarray:
    """(H, W, C) DN of the mean light of n x n pixels (as analysis.gap.processed.binned takes it of captures)."""
    return encoded_above(means(linear_above(dn, camera).astype(np.float32), n), camera)


def _rough(off: np.ndarray) -> float:
    """Median square of what pixels are beside the mean of the four around them, DN²: noise, where most is even."""
    cross = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.float32) / 4
    beside = off - cv2.filter2D(np.ascontiguousarray(off, np.float32), -1, cross).reshape(off.shape)
    return float(np.median(np.square(beside[1:-1, 1:-1]))) + 1e-12


def _resized(plane: np.ndarray, size: tuple[int, int], how: int) -> np.ndarray:
    return np.asarray(cv2.resize(plane, size, interpolation=how).reshape(size[1], size[0], -1))

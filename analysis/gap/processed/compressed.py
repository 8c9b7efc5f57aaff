"""Captures that are JPEGs where the scene file says of none: told by the files' tables, or by the pixels alone of what
was unpacked since, and taken so before anything is fitted. Colour at half the resolution moves the mean image wherever
colours meet (analysis.gap.sensor.halved_colour), and what repeats differ by is no longer the sensor's noise.

Compressing once more changes least at the quality that an image was compressed by.

Farid: Exposing digital forgeries from JPEG ghosts. IEEE Trans. Information Forensics and Security 4(1), 2009.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.finding import Estimate
from analysis.gap.parallel import each
from analysis.gap.processed.matrices import Matrix
from analysis.gap.processed.processing import Processing, mosaic_shown
from analysis.gap.sensor.halved_colour import LUMA
from interchange.camera import Camera
from interchange.captures import Capture
from interchange.effects.jpeg import Jpeg, decoded
from interchange.effects.parts import called
from interchange.image import Image
from interchange.sensor import Mosaic

QUALITIES = range(20, 101)
BESIDE = 2  # steps of quality on either side that a dip is held against
BLOCK = 8  # px
LEAST = 0.1  # DN that compressing changes: what is dark and even stays as it is at any quality
STRIP = 256  # px
ROUNDED = 1.4  # DN, of a colour's difference from brightness: rounding red, green and blue leaves 0.7 at most
SHALLOW = (
    0.7  # dip of what compressing once more changes: chance makes 0.97, what was compressed 0.35 and less
)
DRAWS = 8
FEW = 2  # draws, to tell a mosaic
TWIN = 0.01  # of the signal, that a twin is off: whole images are not rounded alike
OF_FILES = (
    "The captures are JPEG files, which say their quality: they were taken so before anything was fitted."
)
GROUNDS = (
    "Compressing the captures once more changes least at one quality, as of what was compressed by it: they were taken "
    "as JPEGs before anything was fitted."
)


@dataclass(frozen=True)
class Compressed:
    """A camera whose captures are JPEGs; ``halved``: colour at half the resolution, 4:2:0; ``stated`` by the files."""

    camera: str
    quality: int
    halved: bool
    stated: bool = False

    def of(self, camera: Camera) -> Camera:
        """The camera as its captures are."""
        if camera.name != self.camera:
            return camera
        sensor = camera.sensor if camera.sensor.bits_out == 8 else replace(camera.sensor, output_bit_depth=8)
        return replace(
            camera, sensor=replace(sensor, jpeg_quality=self.quality, jpeg_subsampling=self.halved)
        )


def is_looked_for(camera: Camera, capture: Capture) -> bool:
    """Whether a file can be a JPEG that the scene does not say."""
    eight = capture.bits == 8 and capture.has_codes and camera.sensor.bits_out == 8
    return eight and not camera.sensor.jpeg_quality


def compressed(files: Sequence[tuple[Camera, Capture]]) -> list[Compressed]:
    """The cameras whose files are JPEGs of which the scene does not say, by the brightest capture of each."""
    brightest: dict[str, Capture] = {}
    for camera, x in files:
        name = camera.name
        if is_looked_for(camera, x) and (
            name not in brightest or x.pixels.mean() > brightest[name].pixels.mean()
        ):
            brightest[name] = x
    told = each(lambda x: x.jpeg or _told(x.pixels), brightest.values())
    return [
        Compressed(name, *t, stated=x.jpeg is not None)
        for (name, x), t in zip(brightest.items(), told, strict=True)
        if t is not None
    ]


def with_errors(found: Sequence[Condition], before: Mapping[str, Processing]) -> list[Condition]:
    """The conditions of cameras whose images are JPEGs without what compressing takes off their simulation in the mean
    (weak detail, of colours above all), and with what it is off by in one of ``DRAWS``: of the simulation with
    noise of its size, a twin's error of ``TWIN`` and as many repeats. Captures are weighed by all of that, the mean
    among it: it is only as true as the simulation is, and hardly is where that has another renderer's edges.

    ``before``: as ``processings`` tells it."""
    rng = np.random.default_rng(0)

    def one(c: Condition) -> Condition:
        if not c.camera.sensor.jpeg_quality:
            return c
        draws = _off(c, before[c.camera.name], rng, DRAWS)
        mean = draws.mean(axis=0)
        return replace(c, mean=(c.mean - mean).astype(np.float32), packed=draws[0].astype(np.float32))

    return [one(c) for c in found]


def processings(
    found: Sequence[Condition], mixed: Sequence[Matrix] = (), said: Mapping[str, Processing] | None = None
) -> dict[str, Processing]:
    """By name what the cameras whose images are JPEGs do before: what the scene file has ``said``; what goes through
    the matrices ``mixed``, which were taken back besides; and through a mosaic, if none is said and the brightest
    capture shows one."""
    of = {m.camera: m for m in mixed}
    told: dict[str, Processing] = {}
    for c in sorted(found, key=lambda c: -float(c.mean.mean())):
        camera, sensor = c.camera, c.camera.sensor
        if camera.name in told or not sensor.jpeg_quality:
            continue
        plain = replace((said or {}).get(camera.name, Processing(camera)), camera=camera)
        plain = plain.mixed_further(of.get(camera.name))
        if c.mean.shape[2] == 3 and sensor.mosaic is plain.mosaic is Mosaic.NONE:

            def off(pattern: Mosaic, c: Condition = c, plain: Processing = plain) -> np.ndarray:
                by = replace(plain, mosaic=pattern)
                return np.asarray(_off(c, by, np.random.default_rng(0), FEW).mean(axis=0))

            plain = replace(plain, mosaic=mosaic_shown(c, off), mosaic_is_said=False)
        told[camera.name] = plain
    return told


def _off(c: Condition, before: Processing, rng: np.random.Generator, draws: int) -> np.ndarray:
    """(draws, H, W, C) DN by which a condition's mean is off its simulation, compressed and ``before``."""
    sensor = c.camera.sensor
    raw = replace(c, camera=replace(c.camera, sensor=replace(sensor, jpeg_quality=0))).simulated()
    by, sigma, simulated = Jpeg.of(c.camera), np.sqrt(raw.variance), c.simulated().dn

    def off() -> np.ndarray:
        scale = 1 + TWIN * rng.standard_normal()
        dn = raw.black + scale * (raw.dn - raw.black)
        again = np.zeros(dn.shape)
        for _ in c.captures:
            noisy = before.applied(dn + sigma * rng.standard_normal(sigma.shape, np.float32))
            again += before.taken_back(by.compressed(np.clip(np.rint(noisy), 0, raw.top).astype(np.uint8)))
        return again / len(c.captures) - scale * (simulated - raw.black) - raw.black

    return np.stack([off() for _ in range(draws)])


def qualities(by: Sequence[Compressed]) -> dict[str, Estimate]:
    return {
        f"{called(x.camera)} quality" if len(by) > 1 else "quality": Estimate(
            x.quality, 0.0 if x.stated else 1.0, "1"
        )
        for x in by
    }


def grounds(by: Sequence[Compressed]) -> str:
    return OF_FILES if all(x.stated for x in by) else GROUNDS


def notes(by: Sequence[Compressed], mixed: Sequence[str] = ()) -> list[str]:
    """``mixed``: cameras whose colour matrix is taken back."""
    if not by:
        return []
    both = " and ".join(called(x.camera) for x in by if x.camera in mixed)
    weighed = (
        f"A colour matrix is taken back from the JPEGs of {both}, and what that makes of their errors is simulated and "
        f"weighed: colours that it cut a channel off tell little there."
    )
    names = " and ".join(called(x.camera) for x in by)
    halved = any(x.halved for x in by)
    colour = ", colour at half the resolution among it," if halved else ""
    return [
        f"The captures of {names} are JPEGs, and the scene says of none: they are taken as such{colour} and the "
        f"corrected scene says so. What is weak and fine is gone from such images, and repeats tell nothing of the "
        f"sensor's noise: images that were not compressed tell more.",
        *([weighed] if both else []),
    ]


def _told(pixels: np.ndarray) -> tuple[int, bool] | None:
    quality, depth = dip(pixels)
    return (quality, is_halved(pixels)) if depth < SHALLOW else None


def dip(pixels: np.ndarray) -> tuple[int, float]:
    """The quality at which compressing (H, W, C) once more changes brightness least, and how deep that dips: the change
    there over the mean of those beside it."""
    bright = np.rint(pixels @ LUMA if pixels.shape[2] == 3 else pixels[..., 0])[..., None]
    found = np.array([_changed(bright.astype(np.float32), Jpeg(float(q))) for q in QUALITIES])
    around = (found[: -2 * BESIDE] + found[2 * BESIDE :]) / 2
    depth = np.where(around > LEAST, found[BESIDE:-BESIDE] / np.maximum(around, LEAST), 1.0)
    k = int(np.argmin(depth))
    return QUALITIES[k + BESIDE], float(depth[k])


def _changed(bright: np.ndarray, by: Jpeg) -> float:
    """Mean absolute change, DN, less that of blocks as a whole: even ones are rounded now this way and now that."""
    h, w = (x // BLOCK * BLOCK for x in bright.shape[:2])
    change = (decoded(by.encoded(Image(bright))).astype(np.float32) - bright)[:h, :w, 0]
    blocks = change.reshape(h // BLOCK, BLOCK, w // BLOCK, BLOCK)
    return float(np.abs(blocks - blocks.mean(axis=(1, 3), keepdims=True)).mean())


def is_halved(pixels: np.ndarray) -> bool:
    """Whether colour (H, W, 3) is what a triangle draws from half the resolution, along columns and along rows, but for
    what rounding leaves; of an even colour, of which that says nothing, as well."""
    if pixels.shape[2] != 3:
        return False
    colour = pixels[..., [0, 2]] - (pixels @ LUMA)[..., None]
    left = [_left(along) for along in (colour, colour.swapaxes(0, 1))]
    return max(left) < ROUNDED


def _left(colour: np.ndarray) -> float:
    """A high percentile of what is left of (n, m, C) where columns are told by half as many numbers."""
    n = min(len(colour), STRIP) // 2 * 2
    up = np.zeros((n, n // 2 + 2))  # libjpeg's: three quarters of the nearer one, a quarter of the one beyond
    row = np.arange(n)
    up[row, row // 2 + 1] = 0.75
    up[row, row // 2 + np.where(row % 2, 2, 0)] = 0.25
    beyond = np.eye(n) - up @ np.linalg.pinv(up)
    strips = [colour[k : k + n].reshape(n, -1) for k in range(0, len(colour) - n + 1, n)]
    return float(np.percentile(np.abs(np.concatenate([beyond @ x for x in strips])), 99.5))

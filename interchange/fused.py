"""The image chain in few passes over memory, where it is made of effects that are known here; else ``exposure`` runs
them one after the other, which is the definition.

    optics     in bands of rows, from radiance to the electrons of each site, with sums for the glare (``local``)
    read-out   glare, noise, fixed patterns, full well, gain, rounding, white balance: one pass over the sites
    colours    mosaic to colours, matrix and curve: one pass; then JPEG

Light is linear up to the site: glare E' = (1 - g) E + V is drawn from sums of E and added in electrons.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from interchange.bands import BAND, each_band
from interchange.camera import Camera
from interchange.effects import Effect, Stage
from interchange.effects.black_level import BlackLevel
from interchange.effects.color_correction import ColorCorrection
from interchange.effects.color_crosstalk import ColorCrosstalk
from interchange.effects.demosaic import Demosaic
from interchange.effects.exposure import Exposure
from interchange.effects.fixed_pattern import FixedPattern
from interchange.effects.hot_pixels import HotPixels
from interchange.effects.jpeg import Jpeg
from interchange.effects.line_noise import LineNoise
from interchange.effects.mosaic import Mosaic, phases
from interchange.effects.quantization import Quantization
from interchange.effects.response_curve import ResponseCurve
from interchange.effects.saturation import Saturation
from interchange.effects.sensor_noise import EXACT_BELOW, SensorNoise, seed_of
from interchange.effects.veiling_glare import VeilingGlare
from interchange.effects.white_balance import WhiteBalance
from interchange.filtering import applied, combined, convolution
from interchange.image import Image, Quantity
from interchange.local import ROWS, Local, banded
from interchange.problems import BrightfieldError
from interchange.sensor import Demosaic as Method
from interchange.sensor import Mosaic as Pattern
from interchange.steps import Step, in_order

NOT_FINITE = "Radiance must be finite to be exposed; the image has values that are not."
TO_SITES = (Exposure, ColorCrosstalk, Mosaic)
READ_OUT = (HotPixels, SensorNoise, LineNoise, FixedPattern, Saturation, BlackLevel, Quantization)
NONE, LINE = np.empty((0, 0), np.float32), np.empty(0, np.float32)


def weights_of(effects: Sequence[Effect], electrons: np.ndarray, camera: Camera) -> np.ndarray:
    """(2, 2, 3) float64: electrons of a site by row and column parity, of each channel's irradiance: exposure,
    crosstalk and mosaic at once. A monochrome sensor's sites are alike and see the mean."""
    matrix, scale, pattern = np.eye(3), 1.0, camera.sensor.mosaic
    for effect in effects:
        match effect:
            case Exposure():
                scale *= effect.factor(camera.t_exp)
            case ColorCrosstalk():
                matrix = effect.matrix
    out = np.empty((2, 2, 3))
    if not pattern.is_bayer:
        out[:, :] = scale * electrons / 3
        return out
    for i, j, channel in phases(pattern):
        out[i, j] = scale * matrix[channel] * electrons
    return out


@dataclass(frozen=True)
class Sites:
    """From irradiance, in units of ``factor`` W/m², to mean electrons of sites (H, W)."""

    steps: tuple[Local, ...]
    glare: VeilingGlare | None
    weights: np.ndarray

    def __call__(self, pixels: np.ndarray) -> np.ndarray:
        from interchange import readout_kernels, site_kernels  # Numba comes with them

        height, width, channels = pixels.shape
        glare = self.glare if self.glare and self.glare.is_there else None
        weights = self.weights if channels == 3 else self.weights.sum(axis=2, keepdims=True)
        here = np.zeros((2, 2, 3), np.float32)
        here[..., :channels] = (1 - (glare.share if glare else 0.0)) * weights
        alike = channels == 1 and bool(np.all(here == here[0, 0]))
        cells = glare.cells(height, width) if glare else (1, 1)
        out = np.empty((height, width), np.float32)
        sums: dict[int, np.ndarray] = {}

        def work(start: int, stop: int) -> None:
            planes, pad = banded(pixels, self.steps, start, stop)
            if alike:
                site_kernels.scaled(planes[0], out[start:stop], float(here[0, 0, 0]), pad)
            else:
                a, b, c = planes if channels == 3 else planes * 3
                site_kernels.measured(a, b, c, out[start:stop], start, here, pad)
            if glare:
                sums[start] = part = np.zeros((channels, *cells))
                for k in range(channels):
                    site_kernels.binned(planes[k], start, height, part[k], pad)

        each_band(work, height, BAND // ROWS)
        if glare:
            light = np.sum([sums[start] for start in sorted(sums)], axis=0) * (
                cells[0] * cells[1] / (height * width)
            )
            spread = glare.spread(np.moveaxis(light, 0, -1).astype(np.float32), height, width)
            veil = np.einsum("ijc,hwc->ijhw", weights, spread).astype(np.float32)

            def veiled(start: int, stop: int) -> None:
                readout_kernels.veiled(out[start:stop], start, height, veil)

            each_band(veiled, height, width)
        return out


@dataclass(frozen=True)
class ReadOut:
    """Mean electrons (H, W) to electrons or whole DN, by effects of ``READ_OUT`` and a white balance of sites."""

    effects: tuple[Effect, ...]
    camera: Camera
    digital: bool

    def __call__(self, electrons: np.ndarray, rng: np.random.Generator | None, kind: Any) -> np.ndarray:
        """(H, W) of dtype ``kind``. ``electrons`` are used up."""
        from interchange import readout_kernels  # Numba comes with it

        height, width = electrons.shape
        sensor = self.camera.sensor
        named: dict[type, Any] = {type(e): e for e in self.effects}
        full = named[Saturation].full_well if Saturation in named else np.inf
        black = named[BlackLevel].black_level if BlackLevel in named else 0.0
        top = 2.0 ** named[Quantization].bits - 1 if self.digital else 0.0
        balance = np.ones((2, 2), np.float32)
        if (white := named.get(WhiteBalance)) is not None and sensor.mosaic.is_bayer:
            for i, j, channel in phases(sensor.mosaic):
                balance[i, j] = (white.red, white.green, white.blue)[channel]
        if (hot := named.get(HotPixels)) is not None:
            hot.add(electrons, self.camera)
        noise, fixed = named.get(SensorNoise, SensorNoise()), named.get(FixedPattern, FixedPattern())
        gain, offset = fixed.patterns((height, width, 1))
        lines, rows, columns, seed = named.get(LineNoise), LINE, LINE, seed_of(rng)
        if lines is not None and rng is not None:
            rows, columns = lines.lines(height, width, rng)
        out = np.empty((height, width), kind)

        def work(start: int, stop: int) -> None:
            readout_kernels.read_out(
                electrons[start:stop], start, out[start:stop], noise.dark_current * self.camera.t_exp,
                rng is not None, seed, noise.read_noise, EXACT_BELOW,
                NONE if gain is None else gain[start:stop, :, 0],
                NONE if offset is None else offset[start:stop, :, 0],
                rows[start:stop], columns, full, sensor.K, black, top, balance,
            )  # fmt: skip

        each_band(work, height, width)
        return out


@dataclass(frozen=True)
class Colours:
    """Whole DN of a raw mosaic to colours (H, W, 3), as the camera has them; ``effects`` end with a JPEG or not."""

    pattern: Pattern
    correction: ColorCorrection | None
    curve: ResponseCurve | None
    jpeg: Jpeg | None
    camera: Camera

    def __call__(self, raw: np.ndarray) -> np.ndarray:
        from interchange import readout_kernels  # Numba comes with it

        sensor = self.camera.sensor
        matrix, offset = np.eye(3, dtype=np.float32), np.zeros(3, np.float32)
        if self.correction is not None:
            matrix, offset = self.correction.transform(sensor.black_level)
        if self.curve is not None:
            table = self.curve.table(sensor.bit_depth, sensor.black_level)
        else:
            table = np.arange(2**sensor.bit_depth, dtype=np.float32)
        kind: Any = np.uint8 if self.jpeg is not None else np.float32
        out = np.empty((*raw.shape, 3), kind)
        row, column = next((i, j) for i, j, channel in phases(self.pattern) if channel == 0)

        def work(start: int, stop: int) -> None:
            readout_kernels.developed(raw, start, stop, row, column, matrix, offset, table.astype(kind), out)

        each_band(work, len(raw), 3 * raw.shape[1])
        return out if self.jpeg is None else self.jpeg.compressed(out).astype(np.float32)


def colours(effects: Sequence[Effect], camera: Camera, height: int, width: int) -> Colours | None:
    """Where ``effects`` are a bilinear demosaic and what may follow it."""
    kinds = [type(e) for e in effects]
    order = [k for k in (Demosaic, ColorCorrection, ResponseCurve, Jpeg) if k in kinds]
    if kinds != order or not kinds or kinds[0] is not Demosaic or min(height, width) < 3:
        return None
    named: dict[type, Any] = dict(zip(kinds, effects, strict=True))
    if named[Demosaic].method is not Method.BILINEAR:
        return None
    if Jpeg in named and camera.sensor.bits_out != 8:
        return None
    return Colours(
        named[Demosaic].pattern, named.get(ColorCorrection), named.get(ResponseCurve), named.get(Jpeg), camera
    )


def through(
    image: Image,
    camera: Camera,
    effects: Sequence[Effect],
    until: Quantity,
    steps: Sequence[Step],
    electrons: np.ndarray,
    rng: np.random.Generator | None,
) -> Image:
    """Radiance through ``steps``, which are those of ``effects``; ``electrons`` (3,) per irradiance of a channel."""
    optics = [e for e in effects if e.stage is Stage.OPTICS]
    # what needs other passes, and all before it, is done whole
    whole = max((k + 1 for k, e in enumerate(optics) if not _is_known(e, image, camera)), default=0)
    early = mean_first(camera, electrons, optics, until)
    scale = camera.lens.projected_solid_angle
    if whole:
        image, scale = in_order(steps[: 1 + whole], image, rng), 1.0
    elif early and image.pixels.shape[2] == 3:
        image = replace(image, pixels=mean_of_channels(image.pixels))
    glare = optics[-1] if len(optics) > whole and isinstance(optics[-1], VeilingGlare) else None
    local = locals_of([e for e in optics[whole:] if e is not glare], image, camera)
    sensor = [e for e in effects if e.stage is Stage.SENSOR]
    first = [e for e in sensor if e.order <= Mosaic.order]
    if until is Quantity.IRRADIANCE or not _has_sites(camera, first, image):
        if local:
            image = replace(image, pixels=applied(image.pixels, local))
        if not whole:
            image = replace(image, pixels=image.pixels * np.float32(scale), quantity=Quantity.IRRADIANCE)
        return in_order(steps[len(optics) + (glare is None) :], image, rng)
    if camera.sensor.mosaic.is_bayer and image.pixels.shape[2] != 3:
        raise BrightfieldError(
            f"A colour mosaic needs an image of three channels; got {image.pixels.shape[2]}."
        )
    weights = weights_of(first, scale * electrons.astype(np.float64), camera)
    sites = Sites(local, glare, weights)(image.pixels)
    if np.isnan(np.sum(sites)):
        raise BrightfieldError(NOT_FINITE)  # before it becomes a whole number
    return _read_out(sites, image, camera, effects, until, steps, rng)


def _read_out(
    sites: np.ndarray,
    image: Image,
    camera: Camera,
    effects: Sequence[Effect],
    until: Quantity,
    steps: Sequence[Step],
    rng: np.random.Generator | None,
) -> Image:
    """Mean electrons of sites (H, W), read out; effects that are not known by their own steps."""
    digital = until is Quantity.DN
    charges = [e for e in effects if e.stage is Stage.SENSOR and e.order > Mosaic.order]
    readout = [e for e in effects if e.stage is Stage.READOUT and digital]
    early = [e for e in readout if e.order <= WhiteBalance.order]
    late = readout[len(early) :]
    if {type(e) for e in (*charges, *early)} - {*READ_OUT, WhiteBalance} or (
        digital and not any(isinstance(e, Quantization) for e in early)
    ):
        names = {e.name() for e in (*charges, *readout)} | {"gain", "rounding"}
        image = replace(image, pixels=sites[..., None], quantity=Quantity.ELECTRONS)
        return in_order([s for s in steps if s.name in names], image, rng)
    read = ReadOut((*charges, *early), camera, digital)
    to_colours = colours(late, camera, *sites.shape)
    if to_colours is not None:
        return replace(image, pixels=to_colours(read(sites, rng, np.uint16)), quantity=until)
    image = replace(image, pixels=read(sites, rng, np.float32)[..., None], quantity=until)
    names = {e.name() for e in late} | ({"rounding"} if late else set())
    return in_order([s for s in steps if s.name in names], image, rng)


def mean_first(camera: Camera, electrons: np.ndarray, optics: Sequence[Effect], until: Quantity) -> bool:
    """Whether a monochrome sensor's mean over channels may be taken before the optics."""
    mono = camera.sensor.mosaic is Pattern.MONO and bool(np.all(electrons == electrons[0]))
    return mono and until is not Quantity.IRRADIANCE and all(e.achromatic for e in optics)


def mean_of_channels(pixels: np.ndarray) -> np.ndarray:
    from interchange import kernels  # Numba comes with it

    out = np.empty((*pixels.shape[:2], 1), np.float32)
    third = np.full(3, 1 / 3, np.float32)

    def work(start: int, stop: int) -> None:
        out[start:stop] = kernels.weighted_sum(pixels[start:stop], third)

    each_band(work, len(pixels), 3 * pixels.shape[1])
    return out


def locals_of(effects: Sequence[Effect], image: Image, camera: Camera) -> tuple[Local, ...]:
    """The effects as steps for bands; neighbouring convolutions are made one."""
    out: list[Local] = []
    kernels: list[list[np.ndarray]] = []
    for effect in effects:
        own = effect.kernels(image, camera)
        if own is None:
            if (step := effect.local(image, camera)) is not None:
                out.append(step)
            kernels = []
            continue
        if kernels:
            out.pop()
        kernels.append(own)
        count = max(map(len, kernels))
        out.append(convolution([combined([k[c % len(k)] for k in kernels]) for c in range(count)]))
    return tuple(step for step in out if any(f is not None for f in step.functions))


def _is_known(effect: Effect, image: Image, camera: Camera) -> bool:
    return (
        isinstance(effect, VeilingGlare)
        or effect.kernels(image, camera) is not None
        or effect.local(image, camera) is not None
    )


def _has_sites(camera: Camera, first: Sequence[Effect], image: Image) -> bool:
    """Whether electrons of a site are a weighted sum of the channels' irradiance there."""
    mono = camera.sensor.mosaic is Pattern.MONO
    known = (Exposure, Mosaic) if mono and image.pixels.shape[2] == 3 else TO_SITES
    return (mono or camera.sensor.mosaic.is_bayer) and all(isinstance(e, known) for e in first)

"""The DN that a sensor is expected to give, not rounded, and their variance: what captures are compared with.

    var(DN) = K² (e + µ_I t + σ_d²) + 1/12       temporal, EMVA 1288
            + K² ((PRNU e)² + DSNU²)             fixed pattern, which is not known pixel by pixel

times the square of the response curve's slope. Noise that is less than a DN does not dither rounding, which then adds
more than 1/12 where a mean lies half way between two codes (8 bits of a camera that has 12, in the dark).

Widrow, Kollár: Quantization noise. Cambridge 2008.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from analysis.gap.sensor import cut
from analysis.gap.sensor.filters import Averaging
from analysis.gap.sensor.halved_colour import halved_colour
from interchange.camera import Camera, Sensor
from interchange.effects import Effect, chain
from interchange.effects.response_curve import ResponseCurve
from interchange.exposure import steps_of
from interchange.image import Image, Quantity

DRAWN_BY_LOT = ("fixed_pattern", "quantization", "jpeg")  # no part of the mean
SATURATED = 0.95  # of the highest DN


@dataclass(frozen=True, eq=False)
class Expected:
    """``dn``, ``temporal`` and ``fixed`` (variances, DN²), (H, W, C) float32; ``black`` and ``top``: the lowest and
    the highest DN. All of the image that leaves the camera."""

    dn: np.ndarray
    temporal: np.ndarray
    fixed: np.ndarray
    black: float
    top: float

    @property
    def variance(self) -> np.ndarray:
        return self.temporal + self.fixed


@dataclass(frozen=True)
class Noise:
    """What captures show of a sensor's noise where that is not its data sheet's. ``gain``: of photon transfer, over the
    data sheet's K; ``read_noise`` and ``dsnu`` e-, ``prnu`` 1."""

    gain: float
    read_noise: float
    prnu: float
    dsnu: float

    def of(self, sensor: Sensor) -> Sensor:
        """A sensor whose noise is this one's; what it makes of light is another's too."""
        return replace(
            sensor,
            full_well=sensor.full_well / self.gain,
            read_noise=self.read_noise,
            prnu=self.prnu,
            dsnu=self.dsnu / self.gain,
        )


def mean_dn(image: Image, camera: Camera, effects: Sequence[Effect] = ()) -> np.ndarray:
    """(H, W, C) float32: the mean DN of many frames, not rounded; what is cut off at DN 0 is
    (analysis.gap.sensor.cut)."""
    return _compressed(cut.mean(*_linear_dn(image, camera, effects)), camera)


def _compressed(dn: np.ndarray, camera: Camera) -> np.ndarray:
    """What a JPEG makes of it, if the camera's images are some."""
    sensor = camera.sensor
    halves = bool(sensor.jpeg_quality) and sensor.jpeg_subsampling
    return np.asarray(halved_colour(dn) if halves else dn, np.float32)


def dn_per_radiance(image: Image, camera: Camera, effects: Sequence[Effect] = ()) -> np.ndarray:
    """(H, W, C) float32: by how much ``mean_dn`` of each pixel grows with its radiance, taken as if each pixel were
    alone."""
    one = replace(image, pixels=np.ones_like(image.pixels))
    none = replace(image, pixels=np.zeros_like(image.pixels))
    ends = [_linear_dn(x, camera, effects) for x in (one, none)]
    _, sensor, curve = ends[0]
    linear = ends[0][0] - ends[1][0]
    if curve is not None or cut.is_cut(sensor):
        linear = linear * cut.slope(*_linear_dn(image, camera, effects))
    return np.asarray(linear, np.float32)


def _linear_dn(
    image: Image, camera: Camera, effects: Sequence[Effect]
) -> tuple[np.ndarray, Sensor, ResponseCurve | None]:
    """The DN before the curve and the cut, and what makes these."""
    through, camera = chain(camera, effects)
    curve = next((e for e in through if isinstance(e, ResponseCurve)), None)
    steps = steps_of(camera, [e for e in through if e.name() not in (*DRAWN_BY_LOT, "response_curve", "saturation")],
                     Quantity.DN)  # fmt: skip
    out = image
    for step in steps:
        if step.name != "rounding":
            out = step.function(out, None)
    return out.pixels, camera.sensor, curve


def expected(
    radiance: np.ndarray, camera: Camera, effects: Sequence[Effect] = (), noise: Noise | None = None
) -> Expected:
    """The expectation of a capture of ``radiance`` (H, W, 3) by ``camera`` at its exposure and gain; ``noise``: what is
    known of it, instead of the data sheet's."""
    linear, sensor, curve = _linear_dn(Image(radiance, Quantity.RADIANCE, camera), camera, effects)
    dn = _compressed(cut.mean(linear, sensor, curve), camera)
    slope = np.ones(1)
    if curve is not None:
        linear = np.minimum(linear, 2**sensor.bit_depth - 1)
        slope = _slopes(curve, sensor)(linear)
    temporal, fixed = _variance(linear, slope, sensor if noise is None else noise.of(sensor), curve)
    return Expected(dn, temporal, fixed, sensor.black_out, float(2**sensor.bits_out - 1))


def noise_variance(dn: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Temporal and fixed-pattern variance, DN², float32, of pixels whose mean is ``dn``."""
    return _variance(*_linear(dn, camera), camera.sensor, ResponseCurve.of(camera))


def _variance(
    linear: np.ndarray, slope: np.ndarray, sensor: Sensor, curve: ResponseCurve | None
) -> tuple[np.ndarray, np.ndarray]:
    light, still = _per_electron(linear, slope, sensor)
    temporal = light + still * sensor.read_noise**2
    electrons = np.divide(light, still, out=np.zeros_like(light), where=still > 0)
    fixed = still * ((sensor.prnu * electrons) ** 2 + sensor.dsnu**2)
    if cut.is_cut(sensor) and not (curve and curve.bends_in_the_dark):  # in whose slopes it is
        u = linear / cut.of_codes(linear, sensor)
        temporal, fixed = temporal * cut.kept(u), fixed * cut.seen(u) ** 2
    codes = codes_of(sensor)
    rounded, lasting = rounding(sensor), _undithered(codes * temporal) / codes
    return (temporal + rounded).astype(np.float32), (fixed + lasting).astype(np.float32)


def codes_of(sensor: Sensor) -> int:
    """How many codes a sensor's values are means of."""
    return sensor.codes if isinstance(sensor, Averaging) else 1


def rounding(sensor: Sensor) -> float:
    """DN² that codes add to a value."""
    return 1 / 12 / codes_of(sensor)


def _undithered(variance: np.ndarray) -> np.ndarray:
    """DN² by which rounding may add more than 1/12 to noise of this ``variance`` that is less than a DN, where the mean
    lies half way between two codes: the first harmonic of the variance of a rounded normal variable, or all that two
    codes make of hardly any noise. Repeats are rounded alike."""
    first = (4 * variance + 1 / np.pi**2) * np.exp(-2 * np.pi**2 * variance)
    return np.maximum(first, 1 / 4 - variance - 1 / 12)


def per_electron(dn: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """K² e s² and K² s², DN²: photon noise of pixels whose mean is ``dn``, and what an electron² of other noise adds. s
    is the slope of the response curve, for noise."""
    return _per_electron(*_linear(dn, camera), camera.sensor)


def _linear(dn: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """The linear DN whose mean is ``dn``, and the slope of the response curve there."""
    sensor, curve = camera.sensor, ResponseCurve.of(camera)
    dn = np.asarray(dn, np.float64)
    if not curve.is_there:
        return cut.level(dn, sensor), np.ones(1)
    if cut.is_cut(sensor) or curve.bends_in_the_dark:
        x, y, _ = cut.table(sensor, curve)
        linear = np.interp(dn, y, x)
    else:
        x = _bright(sensor.bit_depth, sensor.black_level)
        linear = np.interp(dn, curve.output(x, sensor.bit_depth, sensor.black_level), x)
    return linear, _slopes(curve, sensor)(linear)


def _bright(bits: int, black: float) -> np.ndarray:
    """Linear DN above the black level, rising."""
    return np.linspace(black, 2**bits - 1, 4096)[1:]


@lru_cache(maxsize=64)
def _slopes(curve: ResponseCurve, sensor: Sensor) -> cut.Even:
    """Of the curve at linear DN, for noise."""
    if curve.bends_in_the_dark:
        return cut.slopes(sensor, curve)
    x = _bright(sensor.bit_depth, sensor.black_level)
    return cut.Even.of(x, np.gradient(curve.output(x, sensor.bit_depth, sensor.black_level), x))


def _per_electron(linear: np.ndarray, slope: np.ndarray, sensor: Sensor) -> tuple[np.ndarray, np.ndarray]:
    electrons = np.maximum((linear - sensor.black_level) / sensor.K, 0)
    still = np.broadcast_to(sensor.K**2 * slope**2, electrons.shape)
    return electrons * still, still

"""The DN that a sensor is expected to give, not rounded, and their variance: what captures are compared with.

    var(DN) = K² (e + µ_I t + σ_d²) + 1/12       temporal, EMVA 1288
            + K² ((PRNU e)² + DSNU²)             fixed pattern, which is not known pixel by pixel

times the square of the response curve's slope.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects import Effect, chain
from interchange.effects.response_curve import ResponseCurve
from interchange.exposure import steps_of
from interchange.image import Image, Quantity
from interchange.sensor import Response

DRAWN_BY_LOT = ("fixed_pattern", "quantization", "jpeg")  # no part of the mean
SATURATED = 0.95  # of the highest DN


@dataclass(frozen=True, eq=False)
class Expected:
    """``dn``, ``temporal`` and ``fixed`` (variances, DN²), (H, W, C) float32; ``top``: the highest DN."""

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

    def of(self, camera: Camera) -> Camera:
        """A camera whose noise is this one's; what it makes of light is another's too."""
        s = camera.sensor
        own = replace(
            s,
            full_well=s.full_well / self.gain,
            read_noise=self.read_noise,
            prnu=self.prnu,
            dsnu=self.dsnu / self.gain,
        )
        return replace(camera, sensor=own)


def mean_dn(image: Image, camera: Camera, effects: Sequence[Effect] = ()) -> np.ndarray:
    """(H, W, C) float32: the mean DN of many frames, neither rounded nor clipped."""
    through, camera = chain(camera, effects)
    curve = next((e for e in through if isinstance(e, ResponseCurve)), None)
    steps = steps_of(camera, [e for e in through if e.name() not in (*DRAWN_BY_LOT, "response_curve", "saturation")],
                     Quantity.DN)  # fmt: skip
    out = image
    for step in steps:
        if step.name != "rounding":
            out = step.function(out, None)
    pixels = out.pixels
    if curve is not None:
        pixels = _through(curve, pixels, camera)
    return np.asarray(pixels, np.float32)


def _through(curve: ResponseCurve, linear: np.ndarray, camera: Camera) -> np.ndarray:
    """The mean of what a curve makes of ``linear`` DN and their noise. Of one that bends much that is not what it makes
    of their mean: Gauss-Hermite quadrature of three points, exact for curves of the fifth order."""
    sensor = camera.sensor
    if curve.response is not Response.SRGB:  # a table may end in a corner, which no polynomial follows
        return curve.output(linear, sensor.bit_depth, sensor.black_level)
    signal = np.maximum(linear - np.float32(sensor.black_level), 0)
    pattern = np.square(sensor.prnu * signal) + (sensor.K * sensor.dsnu) ** 2
    sigma = np.sqrt(sensor.K * signal + (sensor.K * sensor.read_noise) ** 2 + 1 / 12 + pattern)
    points = ((-np.sqrt(3), 1 / 6), (0.0, 2 / 3), (np.sqrt(3), 1 / 6))
    parts = [w * curve.output(linear + z * sigma, sensor.bit_depth, sensor.black_level) for z, w in points]
    return np.asarray(sum(parts[1:], parts[0]))


def expected(
    radiance: np.ndarray, camera: Camera, effects: Sequence[Effect] = (), noise: Noise | None = None
) -> Expected:
    """The expectation of a capture of ``radiance`` (H, W, 3) by ``camera`` at its exposure and gain; ``noise``: what is
    known of it, instead of the data sheet's."""
    dn = mean_dn(Image(radiance, Quantity.RADIANCE, camera), camera, effects)
    camera = chain(camera, effects)[1]
    temporal, fixed = noise_variance(dn, camera if noise is None else noise.of(camera))
    return Expected(dn, temporal, fixed, camera.sensor.black_level, float(2**camera.sensor.bits_out - 1))


def noise_variance(dn: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Temporal and fixed-pattern variance, DN², float32, of pixels whose mean is ``dn``."""
    sensor = camera.sensor
    light, still = per_electron(dn, camera)
    temporal = light + still * sensor.read_noise**2 + 1 / 12
    electrons = np.divide(light, still, out=np.zeros_like(light), where=still > 0)
    fixed = still * ((sensor.prnu * electrons) ** 2 + sensor.dsnu**2)
    return temporal.astype(np.float32), fixed.astype(np.float32)


def per_electron(dn: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """K² e s² and K² s², DN²: photon noise of pixels whose mean is ``dn``, and what an electron² of other noise adds. s
    is the slope of the response curve."""
    sensor = camera.sensor
    linear, slope = np.asarray(dn, np.float64), np.ones(1)
    curve = ResponseCurve.of(camera)
    if curve.is_there:
        x = np.linspace(sensor.black_level, 2**sensor.bit_depth - 1, 4096)[1:]
        y = curve.output(x, sensor.bit_depth, sensor.black_level)
        linear = np.interp(dn, y, x)
        slope = np.interp(dn, y, np.gradient(y, x))
    electrons = np.maximum((linear - sensor.black_level) / sensor.K, 0)
    still = np.broadcast_to(sensor.K**2 * slope**2, electrons.shape)
    return electrons * still, still

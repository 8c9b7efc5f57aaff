"""Effects of noise do not move the mean image: they are judged on the variance of repeats, on what stays at the same
pixels in different scenes, and on which DN occur at all.

Sensor noise, by photon transfer: variance of repeats on their mean, put together by the brightness of the simulation,
which does not know the noise (bins of a noisy mean would bias the gain):

    var(DN) - 1/12 = g K² e s² + g² σ_d² K² s²      g: gain over the data sheet's, s: slope of the response curve

EMVA Standard 1288, release 4.0 Linear, 2021, section 6.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.finding import PRESENT
from analysis.gap.noise.codes import code_findings
from analysis.gap.noise.finding import NoiseFinding, Number, probability
from analysis.gap.noise.fixed_pattern import fixed_pattern
from analysis.gap.noise.hot_pixels import HotPixels, hot_pixels, less_hot, places
from analysis.gap.noise.hot_pixels import numbers as hot_numbers
from analysis.gap.sensor.expected import Noise, per_electron, rounding
from interchange.effects.sensor_noise import SensorNoise
from interchange.parameter import parameters

WEIGHING = {"sensor_noise", "fixed_pattern"}  # what captures are weighed by
# relative errors of gain and read noise that a data sheet leaves: no source; the first was 0.03 before set 2026-11-22g
GAIN, READ = 0.02, 0.1
WIDE = 0.2  # relative error of a gain that is off
LEAST_READ = 0.5  # e-, error of a read noise that is small
LINEAR = 0.7  # of saturation, up to which the standard takes the line whose slope is K
LEVELS = 24  # of brightness that variances are put together by
DITHER = (
    0.6  # of a step from code to code: rounding adds 1/12 of its square to more noise, wherever the mean lies
)


def noise_findings(
    conditions: Sequence[Condition],
    simulations: Sequence[np.ndarray],
    offsets: Mapping[str, float] = MappingProxyType({}),
) -> list[NoiseFinding]:
    """Every effect of this class that can be judged, whatever its probability; of JPEGs what codes show alone.

    ``simulations``: (H, W, C) DN of each condition with all that the fit corrects; ``offsets``: DN by which cameras'
    black levels are not their data sheets'.
    """
    codes = code_findings(conditions, simulations)
    plain = [k for k, c in enumerate(conditions) if c.packed is None and not c.camera.sensor.jpeg_quality]
    conditions, simulations = [conditions[k] for k in plain], [simulations[k] for k in plain]
    if not plain:
        return codes
    repeated = next((c.camera.name for c in conditions if c.spread is not None), "")
    hot = hot_pixels(conditions, simulations)
    cool = less_hot(conditions, hot)
    judged = (
        sensor_noise(cool, simulations, offsets.get(repeated, 0.0)),
        pattern(conditions, simulations, hot),
    )
    return [*(n for n in judged if n is not None), *codes]


def pattern(
    conditions: Sequence[Condition], simulations: Sequence[np.ndarray], hot: Mapping[str, HotPixels]
) -> NoiseFinding | None:
    """A fixed pattern, and ``hot`` pixels, which are told by themselves."""
    told = fixed_pattern(less_hot(conditions, hot), simulations)
    if not hot:
        return told
    p, own = (told.probability, told.parameters) if told else (0.0, {})
    return NoiseFinding(
        "fixed_pattern", max(p, *(x.probability for x in hot.values())), own | hot_numbers(hot), places(hot)
    )


def with_noise(
    conditions: list[Condition], simulations: Sequence[np.ndarray], found: Sequence[NoiseFinding]
) -> list[Condition]:
    """The conditions with the noise that is ``found`` probably, each camera's fixed pattern what its own pixels show;
    the same list where it is the data sheet's. ``simulations``: as for ``noise_findings``."""
    probable = {n.name: n for n in found if n.probability >= PRESENT}
    if not WEIGHING & set(probable):
        return conditions
    out = []
    patterns: dict[str, NoiseFinding | None] = {}
    for c in conditions:
        s, name = c.camera.sensor, c.camera.name
        noise = Noise(1.0, s.read_noise, s.prnu, s.dsnu)
        if told := probable.get("sensor_noise"):
            numbers = told.parameters
            sheet = next(x.camera.sensor for x in conditions if x.spread is not None)
            gain = numbers["K"].value / sheet.K
            noise = replace(noise, gain=gain, read_noise=numbers["read_noise"].value)
        if "fixed_pattern" in probable:
            if name not in patterns:
                own = [k for k, x in enumerate(conditions) if x.camera.name == name]
                some, shown = [conditions[k] for k in own], [simulations[k] for k in own]
                patterns[name] = fixed_pattern(less_hot(some, hot_pixels(some, shown)), shown)
            if told := patterns[name]:
                prnu, dsnu = (told.parameters[n].value for n in ("prnu", "dsnu"))
                noise = replace(noise, prnu=max(prnu, s.prnu), dsnu=max(dsnu, s.dsnu))
        out.append(replace(c, noise=noise))
    return out


def with_black_level(conditions: Sequence[Condition], off: Mapping[str, float]) -> list[Condition]:
    """The conditions with each camera's black level ``off`` DN from the data sheet's: electrons count from there, else
    what the dark shows would pass for light, and its share of the noise for photons' own."""

    def one(c: Condition) -> Condition:
        sensor = c.camera.sensor
        black = min(sensor.black_level + off[c.camera.name], 2.0**sensor.bit_depth - 2)
        return replace(c, camera=replace(c.camera, sensor=sensor.with_black_level(black)))

    return [one(c) if off.get(c.camera.name) else c for c in conditions]


def sensor_noise(
    conditions: Sequence[Condition], simulations: Sequence[np.ndarray], offset: float = 0.0
) -> NoiseFinding | None:
    """None without repeats, where noise does not grow with the light (denoised images), and where what there is of
    light and of codes does not tell it: photons tell no gain there.
    ``offset`` (DN): what lifts the black level, or lowers it, may be electrons, with a noise of their own or with
    theirs gone, or none; either is that offset's."""
    rows = [
        row
        for c, simulation in zip(conditions, simulations, strict=True)
        if c.spread is not None
        for row in _levels(c, simulation)
    ]
    if len(rows) < 2:
        return None
    light, still, measured, count = np.array(rows).T
    X = np.stack([light, still], axis=1)
    sheet = next(c.camera.sensor for c in conditions if c.spread is not None)
    theta = np.array([1.0, sheet.read_noise**2])
    for _ in range(4):
        sd = np.maximum(X @ np.maximum(theta, [1e-3, 0]), 1e-9) * np.sqrt(2 / count)
        A = X / sd[:, None]
        theta, *_ = np.linalg.lstsq(A, measured / sd, rcond=None)
    covariance = np.linalg.inv(A.T @ A)
    theta[0], square = _line(
        light, measured - theta[1] * still, sd, light <= LINEAR * sheet.full_well * still
    )
    covariance *= max(square / covariance[0, 0], 1.0)
    if theta[0] <= 0 or covariance[0, 0] > WIDE**2:
        return None
    gain, square = float(theta[0]), float(theta[1] / theta[0] ** 2)
    turned = np.array([[1.0, 0.0], [-2 * theta[1] / theta[0] ** 3, 1 / theta[0] ** 2]])
    covariance = turned @ covariance @ turned.T  # of gain and σ_d²
    left = 2 * max(READ * sheet.read_noise, LEAST_READ) * max(sheet.read_noise, LEAST_READ)
    spike = np.array([GAIN, float(np.hypot(left, abs(offset) / sheet.K))])
    slab = np.hypot(spike, [WIDE, 3 * max(sheet.read_noise, 2.0) ** 2])
    above = max(square, 0.0)  # below is noise of the estimate
    p = probability(np.array([gain - 1, above - sheet.read_noise**2]), covariance, spike, slab)
    read = float(np.sqrt(above))
    sigma = float(np.sqrt(covariance[1, 1])) / (2 * max(read, 0.5 * covariance[1, 1] ** 0.25))
    about = parameters(SensorNoise)["read_noise"]
    numbers = {
        "K": Number(gain * sheet.K, float(np.sqrt(covariance[0, 0])) * sheet.K, "DN/e-"),
        "read_noise": Number(read, sigma, about.unit),
    }
    return NoiseFinding("sensor_noise", p, numbers)


def _line(light: np.ndarray, measured: np.ndarray, sd: np.ndarray, linear: np.ndarray) -> tuple[float, float]:
    """Slope of a line through the origin and its variance: the standard's, every ``linear`` level with the same weight
    whatever its own error ``sd``. Levels that lie off the line by more than that make it wider."""
    if linear.sum() < 2:
        linear = np.ones(len(light), bool)
    x, y, own = light[linear], measured[linear], sd[linear]
    slope = float(x @ y / (x @ x))
    left = (y - slope * x) ** 2 * len(x) / (len(x) - 1)
    return slope, float(max(x**2 @ own**2, x**2 @ left) / (x @ x) ** 2)


def _levels(c: Condition, simulation: np.ndarray) -> list[tuple[float, float, float, float]]:
    """Mean K² e s² and K² s² of pixels of like brightness, their measured variance less the converter's, and how many
    degrees of freedom it has."""
    assert c.spread is not None
    ok = c.usable(c.simulated()) & c.above_zero
    if not ok.any():
        return []
    light, still = per_electron(c.mean[ok], c.camera)
    light, still = light.reshape(-1), np.broadcast_to(still, light.shape).reshape(-1)
    whole = [float((capture.pixels - c.mean)[ok].mean()) for capture in c.captures]
    drift = float(np.var(whole, ddof=1))  # of the light from repeat to repeat: no noise, as EMVA 1288 has it
    measured = c.spread[ok].reshape(-1) - drift - c.step**2 * rounding(c.camera.sensor)
    order = np.argsort(simulation[ok].reshape(-1), kind="stable")
    dithered = light + still * c.camera.sensor.read_noise**2 >= (DITHER * c.step) ** 2
    parts = [i for i in np.array_split(order, LEVELS) if len(i) and dithered[i].all()]
    degrees = len(c.captures) - 1
    return [
        (float(light[i].mean()), float(still[i].mean()), float(measured[i].mean()), degrees * len(i))
        for i in parts
    ]

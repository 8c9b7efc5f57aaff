"""Radiance becomes digital numbers: the one definition of what a camera makes of an image, for every renderer.

    E    = L Ω,   Ω = τ π / (4 N²)                       irradiance on the sensor, W/m²;     then effects of the OPTICS
    µ_e  = R s_c L t_exp = (R / Ω) s_c E t_exp           electrons a channel;                then those of the SENSOR
    DN   = black + g e / fullWell (2^bits - 1 - black)   g = 10^(gain / 20 dB), rounded;     in and after READOUT

R is the sensor's responsivity, lens included, as calibrated; a monochrome sensor takes the mean of the channels.
A lens without an f-number has Ω = τ · 1 sr, which DN do not depend on.

EMVA Standard 1288, Release 4.0 Linear, 2021.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from interchange import fused
from interchange.camera import Camera, Lens, Projection
from interchange.effects import Effect, Stage, chain
from interchange.effects.color_crosstalk import ColorCrosstalk
from interchange.effects.exposure import Exposure
from interchange.effects.mosaic import Mosaic as MosaicEffect
from interchange.image import Image, Quantity
from interchange.lamps.exposed import check_shutter
from interchange.problems import BrightfieldError
from interchange.sensor import Mosaic, Sensor
from interchange.steps import Function, Step, in_order

PLANCK, LIGHT = 6.62607015e-34, 299792458.0  # J s, m/s: exact by the SI


def expose(
    image: Image,
    camera: Camera | None = None,
    t_exp: float | None = None,
    gain_dB: float | None = None,
    rng: np.random.Generator | None = None,
    effects: Sequence[Effect] = (),
    until: Quantity = Quantity.DN,
    step_by_step: bool = False,
) -> Image:
    """What ``camera`` (default: the image's own) makes of an image of radiance (H, W, 3) or (H, W, 1).

    ``t_exp`` s and ``gain_dB`` stand for the camera's own. ``rng`` draws the temporal noise; without it the result is
    the mean of many frames, rounded. ``effects`` stand for the camera's own effects of their kinds. ``until`` asks
    for an earlier quantity: IRRADIANCE after the optics, or ELECTRONS that are read out. ``step_by_step`` applies one
    effect after the other, which is the definition; without it known ones are taken together (``fused``), which gives
    the same mean to a rounding and other draws of the same noise.

    Returns (H, W, 3), or (H, W, 1) from a monochrome or raw mosaic sensor, float32; DN are whole numbers. The same
    arguments and the same state of ``rng`` give the same numbers, whatever the number of threads. Raises
    BrightfieldError where a camera is missing, does not fit the image, or cannot be, and where lamps that flash were
    drawn for another exposure.
    """
    camera = camera or image.camera
    if camera is None:
        raise BrightfieldError("An exposure needs a camera; the image has none, and none was given.")
    if image.quantity is not Quantity.RADIANCE:
        raise BrightfieldError(f"An exposure starts from radiance; got an image of {image.quantity}.")
    camera = replace(
        camera,
        t_exp=camera.t_exp if t_exp is None else t_exp,
        sensor=replace(camera.sensor, gain_dB=camera.sensor.gain_dB if gain_dB is None else gain_dB),
    )
    through, camera = chain(camera, effects)
    (width, height), shape = camera.sensor.resolution, image.pixels.shape
    if shape[:2] != (height, width) or shape[2] not in (1, 3):
        raise BrightfieldError(
            f"An image must have the camera's {width} x {height} px and 1 or 3 channels; got {shape[1]} x {shape[0]} "
            f"px and {shape[2]}."
        )
    if not camera.t_exp >= 0:
        raise BrightfieldError(f"An exposure time must not be negative; got {camera.t_exp:g} s.")
    check_shutter(image, camera)
    out = Image(
        pixels=np.ascontiguousarray(image.pixels, np.float32),
        quantity=Quantity.RADIANCE,
        camera=image.camera,
        made_by=image.made_by,
        passes=image.passes,
    )
    steps = steps_of(camera, through, until)
    out = (
        in_order(steps, out, rng)
        if step_by_step
        else fused.through(out, camera, through, until, steps, _electrons(camera, until), rng)
    )
    if np.isnan(np.sum(out.pixels)):
        raise BrightfieldError(fused.NOT_FINITE)
    made_by = {**image.made_by, "t_exp_s": camera.t_exp, "gain_dB": camera.sensor.gain_dB}
    return replace(image, pixels=out.pixels, quantity=until, camera=camera, made_by=made_by)


def responsivity(lens: Lens, sensor: Sensor, where: str = "") -> tuple[float, float, float]:
    """Electrons per radiance and second of each channel, e- m² sr / (W s).

    As calibrated, or where ``sensor.responsivity`` is 0: η λ / (h c) · pixel area · Ω. Raises BrightfieldError where
    that needs a number that is not there.
    """
    s = sensor.spectral_response
    if sensor.responsivity > 0:
        return tuple(sensor.responsivity * x for x in s)  # type: ignore[return-value]
    if not any(sensor.quantum_efficiency):
        raise BrightfieldError(f"A sensor needs a responsivity or a quantum efficiency.{where}")
    if lens.f_stop <= 0 or lens.projection is not Projection.PERSPECTIVE:
        raise BrightfieldError(
            f"A quantum efficiency needs a perspective lens with an f-number to become a responsivity.{where}"
        )
    area = sensor.pixel_pitch[0] * sensor.pixel_pitch[1]
    photons = [1e-9 * w / (PLANCK * LIGHT) * area * lens.projected_solid_angle for w in sensor.wavelength_nm]
    return tuple(n * eta * x for n, eta, x in zip(photons, sensor.quantum_efficiency, s, strict=True))  # type: ignore[return-value]


def steps_of(camera: Camera, through: Sequence[Effect], until: Quantity) -> list[Step]:
    """What is done to radiance one after the other: the effects ``through``, and the conversions between stages."""
    lens, sensor = camera.lens, camera.sensor
    stages = {stage: [e for e in through if e.stage is stage] for stage in Stage}
    optics = stages[Stage.OPTICS]
    solid_angle = lens.projected_solid_angle
    electrons = _electrons(camera, until)
    mono = sensor.mosaic is Mosaic.MONO
    early = fused.mean_first(camera, electrons, optics, until)

    def light(image: Image, rng: np.random.Generator | None) -> Image:
        L = image.pixels
        E = (
            _weighted(L, np.full(3, solid_angle / 3))
            if early and L.shape[2] == 3
            else L * np.float32(solid_angle)
        )
        return replace(image, pixels=E, quantity=Quantity.IRRADIANCE)

    def charge(image: Image, rng: np.random.Generator | None) -> Image:
        E = image.pixels
        if E.shape[2] == 1:
            e = E * electrons.mean()
        elif mono:
            e = _weighted(E, electrons / 3)
        else:
            h, w, _ = E.shape
            e = (E.reshape(h, -1) * np.tile(electrons, w)).reshape(E.shape)  # long rows, not threes
        return replace(image, pixels=e, quantity=Quantity.ELECTRONS)

    def convert(image: Image, rng: np.random.Generator | None) -> Image:
        return replace(image, pixels=image.pixels * np.float32(sensor.K), quantity=Quantity.DN)

    steps = [Step("irradiance", True, light), *(_step(e, camera) for e in optics)]
    if until is Quantity.IRRADIANCE:
        return steps
    early_ones = [e for e in stages[Stage.SENSOR] if e.order <= MosaicEffect.order]
    if (
        sensor.mosaic.is_bayer
        and any(isinstance(e, ColorCrosstalk) for e in early_ones)
        and all(isinstance(e, (Exposure, ColorCrosstalk, MosaicEffect)) for e in early_ones)
    ):
        later = stages[Stage.SENSOR][len(early_ones) :]
        steps += [
            Step("electrons", True, _at_sites(early_ones, electrons, camera)),
            *(_step(e, camera) for e in later),
        ]
    else:
        steps += [Step("electrons", True, charge), *(_step(e, camera) for e in stages[Stage.SENSOR])]
    if until is Quantity.ELECTRONS:
        return steps
    steps += [Step("gain", True, convert), *(_step(e, camera) for e in stages[Stage.READOUT])]

    def whole(image: Image, rng: np.random.Generator | None) -> Image:
        pixels = np.rint(image.pixels)
        return replace(image, pixels=np.clip(pixels, 0, 2**sensor.bits_out - 1, out=pixels))

    exact = ("quantization", "demosaic", "response_curve", "jpeg")
    return steps if through and through[-1].name() in exact else [*steps, Step("rounding", True, whole)]


def _electrons(camera: Camera, until: Quantity) -> np.ndarray:
    """(3,) float32: electrons of a channel per irradiance."""
    if until is Quantity.IRRADIANCE:
        return np.ones(3, np.float32)
    place = f" ({camera.where})" if str(camera.where) else ""
    R = np.array(responsivity(camera.lens, camera.sensor, place))
    return (R * camera.t_exp / camera.lens.projected_solid_angle).astype(np.float32)


def _at_sites(effects: Sequence[Effect], electrons: np.ndarray, camera: Camera) -> Function:
    """Electrons, their scale, crosstalk and mosaic at once: a pixel needs the sum of its own channel alone."""

    def charge(image: Image, rng: np.random.Generator | None) -> Image:
        from interchange import kernels  # Numba comes with it

        if image.pixels.shape[2] != 3:
            raise BrightfieldError(
                f"A colour mosaic needs an image of three channels; got {image.pixels.shape[2]}."
            )
        weights = np.roll(fused.weights_of(effects, electrons, camera), -(image.first_row % 2), axis=0)
        e = kernels.at_sites(np.ascontiguousarray(image.pixels), weights.astype(np.float32))
        return replace(image, pixels=e, quantity=Quantity.ELECTRONS)

    return charge


def _step(effect: Effect, camera: Camera) -> Step:
    return Step(effect.name(), effect.pointwise, lambda image, rng: effect.apply(image, camera, rng), effect)


def _weighted(pixels: np.ndarray, weights: np.ndarray) -> np.ndarray:
    from interchange import kernels  # Numba comes with it

    return kernels.weighted_sum(np.ascontiguousarray(pixels), weights.astype(np.float32))

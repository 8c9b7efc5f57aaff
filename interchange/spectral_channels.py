"""A spectrum as the program's three channels, such that the sensor collects the electrons that it would collect.

    electrons of channel c = ∫ S(λ) η_c(λ) λ dλ · A Ω t / (h c)  =  L_c η_c λ_c · A Ω t / (h c)

The left is the physics, the right what ``expose`` makes of a channel's L_c; hence

    L_c = ∫ S(λ) η_c(λ) λ dλ / (η_c λ_c)

with η_c and λ_c as the sensor has them. The same for every radiometric quantity: a lamp's W/sr a nm become its
``Light.intensity``. Light at λ_c alone keeps its watts. EMVA 1288, release 4.0 linear, 2.2.
"""

from collections.abc import Sequence
from dataclasses import replace

from interchange.problems import BrightfieldError
from interchange.sensor import Sensor
from interchange.spectrum import Spectrum

Color = tuple[float, float, float]


def sensor_with(sensor: Sensor, efficiency: Sequence[Spectrum]) -> Sensor:
    """``sensor`` with each channel's mean wavelength and the quantum efficiency there, from measured curves.

    ``efficiency``: electrons per photon over wavelength, one curve a channel, or one for all. Raises BrightfieldError
    for another number of curves, ParameterError where one exceeds 1.
    """
    curves = _three(efficiency)
    r, g, b = (c.mean_wavelength() for c in curves)
    at_r, at_g, at_b = (float(c(w)) for c, w in zip(curves, (r, g, b), strict=True))
    return replace(sensor, wavelength_nm=(r, g, b), quantum_efficiency=(at_r, at_g, at_b))


def channels(spectrum: Spectrum, efficiency: Sequence[Spectrum], sensor: Sensor) -> Color:
    """The three channels of a spectrum, in its unit times nm, as a sensor with these curves sees it.

    ``efficiency`` as in ``sensor_with``, or relative (then a channel's value at λ_c counts as η_c). Raises
    BrightfieldError where a curve is 0 at its channel's wavelength, and nothing could be scaled.
    """
    found = []
    for curve, eta, wavelength in zip(
        _three(efficiency), sensor.quantum_efficiency, sensor.wavelength_nm, strict=True
    ):
        reference = eta or float(curve(wavelength))
        if not reference > 0:
            raise BrightfieldError(
                f"A channel's quantum efficiency must be above 0 at its mean wavelength, {wavelength:g} nm; got "
                f"{reference:g}. ({curve.name})"
            )
        product = spectrum * curve
        weighted = Spectrum(product.wavelength_nm, product.values * product.wavelength_nm)
        found.append(weighted.integral() / (reference * wavelength))
    return (found[0], found[1], found[2])


def _three(curves: Sequence[Spectrum]) -> tuple[Spectrum, ...]:
    if len(curves) not in (1, 3):
        raise BrightfieldError(f"A sensor has one spectral curve, or one a channel; got {len(curves)}.")
    return tuple(curves) * (3 // len(curves))

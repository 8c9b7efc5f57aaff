"""A camera's measured response in USD: ``asset sensor:quantumEfficiency:file``, a table of electrons per photon over
wavelength, one column for all channels or one each for red, green and blue; in per cent where the column says %.

Its sensor has the mean wavelengths and the efficiencies there (interchange.spectral_channels), and the spectra of the
scene's lamps go through it to channels, in place of linear sRGB.
"""

from pathlib import Path

from pxr import Usd, UsdGeom

from interchange.formats import measurements
from interchange.formats.usd_values import Finder, asset
from interchange.problems import BrightfieldError
from interchange.sensor import Sensor
from interchange.spectral_channels import Color, channels, sensor_with
from interchange.spectrum import Spectrum, from_measurement

ATTRIBUTE = "sensor:quantumEfficiency:file"
Curves = tuple[Spectrum, ...]


def response_file(prim: Usd.Prim, time: Usd.TimeCode) -> str:
    """The file that a camera names, "" where it names none. Raises BrightfieldError where it is not there."""
    written, file = asset(prim.GetAttribute(ATTRIBUTE), time)
    if written and not file:
        raise BrightfieldError(f'The response "{written}" is not there.')
    return file


def read_response(file: str) -> Curves:
    """One curve, or three. Raises BrightfieldError for another number, or a table that is no spectrum."""
    found = measurements.read(Path(file))
    if len(found.values) not in (1, 3):
        raise BrightfieldError(
            f"A response has one column of values, or one a channel; got {len(found.values)}. ({file})"
        )
    curves = [from_measurement(found, column.name) for column in found.values]
    return tuple(c * 0.01 if c.unit == "%" else c for c in curves)


def sensor_of(prim: Usd.Prim, time: Usd.TimeCode, find: Finder) -> Sensor | None:
    """A sensor with the mean wavelengths and efficiencies of the camera's curves; None where it has none."""
    try:
        file = response_file(prim, time)
        return sensor_with(Sensor(), read_response(file)) if file else None
    except BrightfieldError as error:
        find.error(str(error), prim, ATTRIBUTE)
        return None


def scene_response(stage: Usd.Stage, time: Usd.TimeCode) -> Curves:
    """The curves that a scene's lamps go through; none where no camera has any. Raises BrightfieldError where cameras
    differ: a lamp has one set of three channels."""
    files: dict[str, str] = {}
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
        if prim.IsA(UsdGeom.Camera) and (file := response_file(prim, time)):
            files.setdefault(file, str(prim.GetPath()))
    if len(files) > 1:
        a, b, *_ = files.values()
        raise BrightfieldError(
            f"Spectra of lamps go to channels through one response; {a} and {b} have one each of their own."
        )
    return read_response(next(iter(files))) if files else ()


def color_through(spectrum: Spectrum, curves: Curves) -> Color:
    """What 1 W of a spectrum is in each channel."""
    return channels(spectrum.normalized(), curves, sensor_with(Sensor(), curves))

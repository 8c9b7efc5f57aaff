"""The attributes ``sensor:*`` and ``lens:*`` of a camera prim: one table for reading and for writing.

Those of the file contract are single precision, as it has them; the others are double. One that is not authored is
the default, and one that is the default is not written, but for the contract's own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from pxr import Gf, Sdf, Usd

from interchange.camera import Camera, Lens
from interchange.formats import usd_response
from interchange.formats.usd_values import Finder
from interchange.parameter import ParameterError
from interchange.problems import did_you_mean
from interchange.sensor import Sensor

NAMES = Sdf.ValueTypeNames


@dataclass(frozen=True)
class Attribute:
    name: str
    kind: Any  # Sdf.ValueTypeName
    part: str  # "lens" or "sensor"
    field: str
    always: bool = False  # written even where it is the default


ATTRIBUTES = (
    Attribute("sensor:responsivity", NAMES.Float, "sensor", "responsivity", True),
    Attribute("sensor:fullWell", NAMES.Float, "sensor", "full_well", True),
    Attribute("sensor:bitDepth", NAMES.Int, "sensor", "bit_depth", True),
    Attribute("sensor:blackLevel", NAMES.Float, "sensor", "black_level", True),
    Attribute("sensor:readNoise", NAMES.Float, "sensor", "read_noise", True),
    Attribute("sensor:prnu", NAMES.Float, "sensor", "prnu", True),
    Attribute("sensor:dsnu", NAMES.Float, "sensor", "dsnu", True),
    Attribute("sensor:darkCurrent", NAMES.Float, "sensor", "dark_current", True),
    Attribute("sensor:rowNoise", NAMES.Double, "sensor", "row_noise"),
    Attribute("sensor:columnNoise", NAMES.Double, "sensor", "column_noise"),
    Attribute("sensor:prnuRow", NAMES.Double, "sensor", "prnu_row"),
    Attribute("sensor:prnuColumn", NAMES.Double, "sensor", "prnu_column"),
    Attribute("sensor:dsnuRow", NAMES.Double, "sensor", "dsnu_row"),
    Attribute("sensor:dsnuColumn", NAMES.Double, "sensor", "dsnu_column"),
    Attribute("sensor:hotPixels", NAMES.DoubleArray, "sensor", "hot_pixels"),
    Attribute("sensor:quantumEfficiency", NAMES.Double3, "sensor", "quantum_efficiency"),
    Attribute("sensor:wavelength", NAMES.Double3, "sensor", "wavelength_nm"),
    Attribute("sensor:spectralResponse", NAMES.Double3, "sensor", "spectral_response"),
    Attribute("sensor:gain", NAMES.Double, "sensor", "gain_dB"),
    Attribute("sensor:serialNumber", NAMES.String, "sensor", "serial_number"),
    Attribute("sensor:mosaic", NAMES.Token, "sensor", "mosaic"),
    Attribute("sensor:colorCrosstalk", NAMES.DoubleArray, "sensor", "color_crosstalk"),
    Attribute("sensor:lineTime", NAMES.Double, "sensor", "line_time"),
    Attribute("sensor:exposureDelay", NAMES.Double, "sensor", "exposure_delay"),
    Attribute("sensor:imagePath", NAMES.DoubleArray, "sensor", "image_path"),
    Attribute("sensor:imageSpeed", NAMES.DoubleArray, "sensor", "image_speed"),
    Attribute("sensor:imageAcceleration", NAMES.Double, "sensor", "image_acceleration"),
    Attribute("sensor:frameRate", NAMES.Double, "sensor", "frame_rate"),
    Attribute("sensor:demosaic", NAMES.Token, "sensor", "demosaic"),
    Attribute("sensor:whiteBalance", NAMES.Double3, "sensor", "white_balance"),
    Attribute("sensor:colorCorrection", NAMES.DoubleArray, "sensor", "color_correction"),
    Attribute("sensor:response", NAMES.Token, "sensor", "response"),
    Attribute("sensor:responseLut", NAMES.DoubleArray, "sensor", "response_lut"),
    Attribute("sensor:gamma", NAMES.Double, "sensor", "gamma"),
    Attribute("sensor:bow", NAMES.Double, "sensor", "bow"),
    Attribute("sensor:skew", NAMES.Double, "sensor", "skew"),
    Attribute("sensor:outputBitDepth", NAMES.Int, "sensor", "output_bit_depth"),
    Attribute("sensor:jpegQuality", NAMES.Int, "sensor", "jpeg_quality"),
    Attribute("sensor:jpegSubsampling", NAMES.Bool, "sensor", "jpeg_subsampling"),
    Attribute("lens:transmission", NAMES.Double, "lens", "transmission"),
    Attribute("lens:vignetting", NAMES.DoubleArray, "lens", "vignetting"),
    Attribute("lens:lateralChromaticAberration", NAMES.DoubleArray, "lens", "lateral_chromatic_aberration"),
    Attribute("lens:axialChromaticAberration", NAMES.DoubleArray, "lens", "axial_chromatic_aberration"),
    Attribute("lens:blur", NAMES.Double, "lens", "blur"),
    Attribute("lens:fieldBlur", NAMES.DoubleArray, "lens", "field_blur"),
    Attribute("lens:measuredBlur", NAMES.DoubleArray, "lens", "measured_blur"),
    Attribute("lens:diffraction", NAMES.Bool, "lens", "diffraction"),
    Attribute("lens:veilingGlare", NAMES.DoubleArray, "lens", "veiling_glare"),
)
OTHERS = (
    "sensor:resolution",
    "lens:distortion",
    "lens:model",
    usd_response.ATTRIBUTE,
)  # read and written with the rest of the camera


def read(prim: Usd.Prim, time: Usd.TimeCode, find: Finder) -> dict[str, dict[str, Any]]:
    """The authored fields of ``{"lens": {...}, "sensor": {...}}``; unknown attributes become losses in ``find``.

    A quantum efficiency without a responsivity stands for it (``Sensor.responsivity`` 0).
    """
    found: dict[str, dict[str, Any]] = {"lens": {}, "sensor": {}}
    known = [*(a.name for a in ATTRIBUTES), *OTHERS]
    for attribute in ATTRIBUTES:
        value = find.value(prim, attribute.name, time)
        if value is not None:
            found[attribute.part][attribute.field] = value
    for name in prim.GetAuthoredPropertyNames():
        if name.startswith(("sensor:", "lens:")) and name not in known:
            find.loss(f"{name} is not known and left out.{did_you_mean(name, known)}", prim, name)
    if (measured := usd_response.sensor_of(prim, time, find)) is not None:
        for field in ("quantum_efficiency", "wavelength_nm"):
            if field in found["sensor"]:
                find.error(
                    "A response from a file has its own efficiency and wavelength.",
                    prim,
                    usd_response.ATTRIBUTE,
                )
            found["sensor"][field] = getattr(measured, field)
    if "quantum_efficiency" in found["sensor"]:
        found["sensor"].setdefault("responsivity", 0.0)
    return found


def author(prim: Usd.Prim, camera: Camera) -> None:
    """Write what differs from the defaults, and the contract's attributes."""
    defaults = {"lens": Lens(), "sensor": Sensor()}
    for a in ATTRIBUTES:
        value = getattr(getattr(camera, a.part), a.field)
        if a.always or value != getattr(defaults[a.part], a.field):
            prim.CreateAttribute(a.name, a.kind, custom=True).Set(_usd(value, a.kind))


def check(camera: Camera) -> None:
    """Raises ParameterError where the camera's numbers make an effect that cannot be."""
    from interchange.effects import chain  # OpenCV comes with it, which most readers never need

    chain(camera)


def record(kind: type[Lens] | type[Sensor], **values: Any) -> Any:
    """A lens or sensor; a value of the wrong type is a ParameterError too."""
    try:
        return kind(**values)
    except ParameterError:
        raise
    except (TypeError, ValueError) as error:
        raise ParameterError(f"{kind.__name__}: {error}.") from None


def _usd(value: Any, kind: Any) -> Any:
    if isinstance(value, StrEnum):
        return value.value
    if kind == NAMES.Double3:
        return Gf.Vec3d(*value)
    return list(value) if isinstance(value, Sequence) and not isinstance(value, str) else value

"""The sensor: EMVA 1288's linear model, and what the camera's electronics do with its digital numbers."""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from interchange.parameter import Kind, ParameterError, freeze, parameter
from interchange.problems import did_you_mean

Color = tuple[float, float, float]  # one number a channel


class Mosaic(StrEnum):
    """What one pixel measures. A Bayer pattern is named by its upper left 2 x 2 pixels, row by row."""

    NONE = ""  # every channel of the image, as three sensors behind a prism do
    MONO = "mono"  # the mean of the channels
    RGGB = "RGGB"
    BGGR = "BGGR"
    GRBG = "GRBG"
    GBRG = "GBRG"

    @property
    def is_bayer(self) -> bool:
        return len(self.value) == 4 and self is not Mosaic.MONO


class Demosaic(StrEnum):
    NONE = "none"  # the image stays as the pixels are: one channel
    BILINEAR = "bilinear"
    EDGE_AWARE = "edge_aware"


class Response(StrEnum):
    """How an output DN follows from the linear one."""

    LINEAR = "linear"
    SRGB = "sRGB"  # IEC 61966-2-1
    REC709 = "rec709"  # ITU-R BT.709-6, of video cameras
    LUT = "lut"  # ``Sensor.response_lut``, evenly spaced from zero to the highest DN, both from 0 to 1


IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Sensor:
    """EMVA 1288's linear model, and what a camera does with its DN afterwards.

    Only the resolution and the pitch matter to a renderer; the rest is ``expose``'s. ``responsivity`` 0 stands for
    the one that follows from the quantum efficiency, the lens and the pixel (``interchange.exposure.responsivity``).
    Fixed patterns are those of ``serial_number``.
    """

    resolution: tuple[int, int] = (640, 480)  # (width, height), px
    pixel_pitch: tuple[float, float] = (3.45e-6, 3.45e-6)  # (x, y), m
    responsivity: float = parameter(
        1.0, "R", "e- m² sr / (W s)", 0, 1e12, "electrons per radiance and second"
    )
    full_well: float = parameter(1e4, "µ_e.sat", "e-", 1, 1e9, "electrons that read as the highest DN")
    bit_depth: int = 12
    black_level: float = parameter(
        0.0, "µ_y.dark", "DN", -65535, 65535, "DN of no electrons; below 0 the converter cuts it off"
    )
    read_noise: float = parameter(0.0, "σ_d", "e-", 0, 1e6, "temporal noise in the dark, rms")
    row_noise: float = parameter(0.0, "σ_row", "e-", 0, 1e6, "temporal noise that a row has in common, rms")
    column_noise: float = parameter(
        0.0, "σ_col", "e-", 0, 1e6, "temporal noise that a column has in common, rms"
    )
    prnu: float = parameter(0.0, "PRNU", "1", 0, 1, "spread of the pixels' gain, rms")
    dsnu: float = parameter(0.0, "DSNU", "e-", 0, 1e6, "spread of the pixels' offset, rms")
    prnu_row: float = parameter(0.0, "PRNU.row", "1", 0, 1, "spread of the rows' gain, rms")
    prnu_column: float = parameter(0.0, "PRNU.col", "1", 0, 1, "spread of the columns' gain, rms")
    dsnu_row: float = parameter(0.0, "DSNU.row", "e-", 0, 1e6, "spread of the rows' offset, rms")
    dsnu_column: float = parameter(0.0, "DSNU.col", "e-", 0, 1e6, "spread of the columns' offset, rms")
    hot_pixels: tuple[float, ...] = (0.0, 0.0)  # share of them, their mean dark current e-/s
    dark_current: float = parameter(0.0, "µ_I", "e-/s", 0, 1e9, "dark current")
    quantum_efficiency: Color = parameter((0, 0, 0), "η", "1", 0, 1, "electrons per photon", Kind.COLOR)
    wavelength_nm: Color = parameter(
        (610, 540, 465), "λ", "nm", 100, 1e4, "mean wavelength of each channel", Kind.COLOR
    )
    spectral_response: Color = parameter(
        (1, 1, 1), "s", "1", 0, 1e3, "each channel's responsivity over `responsivity`", Kind.COLOR
    )
    gain_dB: float = parameter(0.0, "g", "dB", -60, 120, "gain before the converter; 20 dB is tenfold")
    serial_number: str = ""
    mosaic: Mosaic = Mosaic.NONE
    color_crosstalk: tuple[float, ...] = (0.0,) * 6
    line_time: float = parameter(
        0.0, "t_l", "s", 0, 10, "a row starts that much later; 0 is a global shutter"
    )
    exposure_delay: float = parameter(
        0.0, "t_0", "s", -1, 1, "time that the shutter is open beyond the exposure that is set"
    )
    image_path: tuple[float, ...] = (0.0, 0.0)  # px that the image moves by in any exposure, columns and rows
    image_speed: tuple[float, ...] = (0.0, 0.0)  # px/s, of the same
    image_acceleration: float = parameter(
        0.0, "a", "1", -8, 8, "logarithm of both's speed at an exposure's end over that at its start"
    )
    frame_rate: float = parameter(0.0, "f_p", "1/s", 0, 1e6, "frames a second; 0 is not set")
    demosaic: Demosaic = Demosaic.BILINEAR
    white_balance: Color = parameter((1, 1, 1), "w", "1", 0, 64, "gain of each channel's DN", Kind.COLOR)
    color_correction: tuple[float, ...] = IDENTITY  # (3, 3) row by row, on DN above black
    response: Response = Response.LINEAR
    response_lut: tuple[float, ...] = ()
    gamma: float = parameter(1.0, "γ", "1", 0.1, 10, "exponent of the output over the linear signal")
    bow: float = parameter(0.0, "c", "1", -1, 1, "four times what half the range is off a straight line by")
    skew: float = parameter(
        0.0, "s", "1", -1, 1, "how much more it is bowed in the lower half than in the upper"
    )
    output_bit_depth: int = 0  # bits of the image that leaves the camera; 0 is `bit_depth`
    jpeg_quality: int = 0  # of libjpeg, 1 to 100; 0 is no compression
    jpeg_subsampling: bool = True  # colour at half the resolution, 4:2:0

    def __post_init__(self) -> None:
        freeze(self)
        freeze_numbers(
            self,
            hot_pixels=2,
            image_path=2,
            image_speed=2,
            color_crosstalk=6,
            color_correction=9,
            response_lut=None,
        )
        object.__setattr__(self, "resolution", tuple(int(n) for n in self.resolution))
        object.__setattr__(self, "pixel_pitch", tuple(float(x) for x in self.pixel_pitch))
        object.__setattr__(self, "jpeg_subsampling", bool(self.jpeg_subsampling))
        for name, kind in (("mosaic", Mosaic), ("demosaic", Demosaic), ("response", Response)):
            freeze_word(self, name, kind)
        for name, low, high in (
            ("bit_depth", 1, 16),
            ("output_bit_depth", 0, 16),
            ("jpeg_quality", 0, 100),
        ):
            value = getattr(self, name)
            if value != int(value) or not low <= value <= high:
                raise ParameterError(f"Sensor.{name} must be a whole number in [{low}, {high}]; got {value}.")
            object.__setattr__(self, name, int(value))
        if self.black_level >= 2**self.bit_depth - 1:
            raise ParameterError(
                f"Sensor.black_level must lie below the highest DN, {2**self.bit_depth - 1}; got {self.black_level:g}."
            )
        if self.response is Response.LUT and len(self.response_lut) < 2:
            raise ParameterError(
                "Sensor.response_lut must hold two or more numbers where the response is a lut."
            )
        lut = np.array(self.response_lut)
        if ((lut < 0) | (lut > 1)).any() or (np.diff(lut) < 0).any():
            raise ParameterError(
                f"Sensor.response_lut must rise and stay within [0, 1]; got {_short(self.response_lut)}."
            )
        if self.jpeg_quality and self.bits_out != 8:
            raise ParameterError(f"A JPEG must have 8 bits; the sensor's image has {self.bits_out}.")

    @property
    def bits_out(self) -> int:
        """Bits of the image that leaves the camera."""
        return self.output_bit_depth or self.bit_depth

    @property
    def black_out(self) -> float:
        """The black level, DN of the image that leaves the camera."""
        return self.black_level * self._out

    @property
    def K_out(self) -> float:
        """``K``, DN/e-, of the image that leaves the camera, by a straight curve."""
        return self.K * self._out

    @property
    def _out(self) -> float:
        """A DN of the converter in those of the image that leaves the camera."""
        return float((2**self.bits_out - 1) / (2**self.bit_depth - 1))

    @property
    def K(self) -> float:
        """EMVA 1288's overall system gain, DN/e-, of the converter's DN."""
        return float(10 ** (self.gain_dB / 20) * (2**self.bit_depth - 1 - self.black_level) / self.full_well)

    def with_black_level(self, black_level: float) -> "Sensor":
        """The same with another DN of no electrons: as many DN an electron, so that more or fewer of them read as the
        highest DN. Raises ParameterError."""
        moved = replace(self, black_level=black_level)
        return replace(moved, full_well=self.full_well * moved.K / self.K)


def _short(numbers: tuple[float, ...], most: int = 6) -> str:
    shown = ", ".join(f"{x:g}" for x in numbers[:most])
    return f"{shown}, ... ({len(numbers)})" if len(numbers) > most else shown


def freeze_numbers(model: Any, **counts: int | None) -> None:
    """Bring fields to tuples of ``count`` finite floats, zeros at the end where fewer are given; None: any number."""
    for name, count in counts.items():
        numbers = tuple(float(x) for x in getattr(model, name))
        if (count is not None and len(numbers) > count) or not np.isfinite(numbers).all():
            raise ParameterError(
                f"{type(model).__name__}.{name} must hold up to {count} finite numbers; got {numbers}."
            )
        object.__setattr__(model, name, numbers + (0.0,) * ((count or 0) - len(numbers)))


def freeze_word(model: Any, name: str, kind: type[StrEnum]) -> None:
    """Bring a field to one of the words of ``kind``."""
    word = str(getattr(model, name))
    known = [str(k) for k in kind]
    if word not in known:
        raise ParameterError(
            f"{type(model).__name__}.{name} must be one of {', '.join(k or chr(34) * 2 for k in known)}; "
            f'got "{word}".{did_you_mean(word, known)}'
        )
    object.__setattr__(model, name, kind(word))

"""Pixel formats as GenICam names them: which sensor gives them, and how their bytes lie in a buffer.

A format says what of the sensor's electronics is read out: ``Mono`` what a sensor without colour filters gives,
``Bayer`` its mosaic as it is, ``RGB`` three channels (of a mosaic, interpolated). A sensor of one kind gives its own
formats alone; one that is described by channels (``Mosaic.NONE``) can be built in all three kinds.

EMVA: GenICam Pixel Format Naming Convention 2.1; codes of AIA: GigE Vision 2.0, appendix B.
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.problems import BrightfieldError, did_you_mean
from interchange.sensor import Demosaic, Mosaic, Sensor

BAYER = {"RG": Mosaic.RGGB, "BG": Mosaic.BGGR, "GR": Mosaic.GRBG, "GB": Mosaic.GBRG}


@dataclass(frozen=True)
class PixelFormat:
    """``code``: PFNC's 32 bits; ``bits`` that count; ``channels`` of a pixel; ``mosaic`` that the sensor must have."""

    name: str
    code: int
    bits: int
    channels: int
    mosaic: Mosaic

    @property
    def dtype(self) -> type:
        """Of the samples in memory; those of more than 8 bits are little-endian, in the lower bits of 16."""
        return np.uint8 if self.bits == 8 else np.uint16

    @property
    def bytes_per_pixel(self) -> int:
        return self.channels * np.dtype(self.dtype).itemsize

    def shape(self, width: int, height: int) -> tuple[int, ...]:
        """Of the array of an image: (H, W) or (H, W, 3)."""
        return (height, width) if self.channels == 1 else (height, width, self.channels)

    def of(self, sensor: Sensor) -> Sensor:
        """The sensor as it is read out in this format. BrightfieldError where it cannot be."""
        if self not in formats(sensor):
            names = ", ".join(f.name for f in formats(sensor))
            kind = f"a {sensor.mosaic} sensor" if sensor.mosaic else "a sensor"
            raise BrightfieldError(
                f"{kind.capitalize()} of {sensor.bit_depth} bits gives {names}; got {self.name}."
            )
        mosaic = sensor.mosaic if self.channels == 3 else self.mosaic
        demosaic = sensor.demosaic
        if self.channels == 3 and demosaic is Demosaic.NONE:
            demosaic = Demosaic.BILINEAR
        return replace(
            sensor,
            mosaic=mosaic,
            demosaic=Demosaic.NONE if self.mosaic.is_bayer else demosaic,
            output_bit_depth=self.bits if self.bits != sensor.bit_depth else 0,
            jpeg_quality=0,  # compressing is the transport's
        )


MONO8 = PixelFormat("Mono8", 0x01080001, 8, 1, Mosaic.MONO)
RGB8 = PixelFormat("RGB8", 0x02180014, 8, 3, Mosaic.NONE)
ALL = (
    MONO8,
    PixelFormat("Mono10", 0x01100003, 10, 1, Mosaic.MONO),
    PixelFormat("Mono12", 0x01100005, 12, 1, Mosaic.MONO),
    PixelFormat("Mono16", 0x01100007, 16, 1, Mosaic.MONO),
    PixelFormat("BayerGR8", 0x01080008, 8, 1, Mosaic.GRBG),
    PixelFormat("BayerRG8", 0x01080009, 8, 1, Mosaic.RGGB),
    PixelFormat("BayerGB8", 0x0108000A, 8, 1, Mosaic.GBRG),
    PixelFormat("BayerBG8", 0x0108000B, 8, 1, Mosaic.BGGR),
    RGB8,
)


def formats(sensor: Sensor) -> tuple[PixelFormat, ...]:
    """What a sensor can give, its natural format first."""
    able = [f for f in ALL if f.bits <= sensor.bit_depth and _fits(f, sensor.mosaic)]
    if not able:
        raise BrightfieldError(f"A live camera's sensor must have 8 bits or more; got {sensor.bit_depth}.")
    return tuple(sorted(able, key=lambda f: f is not RGB8))  # a colour camera's is colour


def _fits(format: PixelFormat, mosaic: Mosaic) -> bool:
    if mosaic is Mosaic.NONE:
        return format.mosaic in (Mosaic.MONO, Mosaic.NONE, Mosaic.RGGB)
    return format.mosaic is mosaic or (mosaic.is_bayer and format is RGB8)


def named(name: str) -> PixelFormat:
    """The format of that name. Raises BrightfieldError."""
    for format in ALL:
        if format.name.lower() == name.lower():
            return format
    known = [f.name for f in ALL]
    raise BrightfieldError(
        f'No pixel format is called "{name}".{did_you_mean(name, known)} There are {", ".join(known)}.'
    )

"""Options of every command that makes DN of radiance, and the files it writes: PNG and TIFF of 8 and 16 bits."""

import argparse
import zlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interchange.formats import emva_sheet, images
from interchange.image import Image, Quantity
from interchange.parameter import parameters
from interchange.problems import BrightfieldError, did_you_mean
from interchange.shutter import Shutter

if TYPE_CHECKING:
    from interchange.effects import Effect

SUFFIXES = (".png", ".tif", ".tiff")


def add_exposure_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("the camera's own image (DN)")
    group.add_argument(
        "--exposure", type=float, metavar="S", help="exposure time (default: the camera's, exposure:time)"
    )
    group.add_argument("--gain", type=float, metavar="DB", help="gain (default: the camera's, sensor:gain)")
    group.add_argument(
        "--sensor",
        type=Path,
        metavar="SHEET",
        help="EMVA 1288 data sheet that stands for the camera's sensor:*",
    )
    group.add_argument(
        "--effect",
        action="append",
        nargs="+",
        default=[],
        metavar=("NAME", "PARAMETER=VALUE"),
        help="an effect of the image chain, say line_scan stretch=2, that stands for the camera's own; once an effect",
    )
    group.add_argument("--noise-seed", type=int, default=0, metavar="N", help="another N is another frame")
    group.add_argument("--noise-free", action="store_true", help="the mean of many frames instead of one")


def digital(image: Image, args: argparse.Namespace, frame: str = "") -> Image:
    """The image in DN by the options; ``frame`` names its stream of random numbers."""
    from interchange.exposure import expose  # OpenCV comes with it

    camera = image.camera
    if camera is None:
        raise BrightfieldError("The image does not say which camera took it; render it with this program.")
    if args.sensor is not None:
        sensor = emva_sheet.read(args.sensor).sensor(camera.sensor)
        size, pitch = camera.sensor.resolution, camera.sensor.pixel_pitch
        camera = replace(camera, sensor=replace(sensor, resolution=size, pixel_pitch=pitch))
    effects = tuple(effect_of(words) for words in args.effect)
    rng = np.random.default_rng([args.noise_seed, zlib.crc32(frame.encode())])
    return expose(image, camera, args.exposure, args.gain, None if args.noise_free else rng, effects=effects)


def shutter(args: argparse.Namespace) -> Shutter:
    """What the options say of the exposure: a rendering must know it where lamps flash."""
    from interchange.effects.rolling_shutter import RollingShutter

    rolling = [e for e in map(effect_of, args.effect) if isinstance(e, RollingShutter)]
    return Shutter(args.exposure, rolling[-1].line_time if rolling else None, args.moments)


def effect_of(words: list[str]) -> "Effect":
    """``["line_scan", "stretch=2"]`` as the effect. Raises BrightfieldError for a name that is not known, and
    ParameterError for a value out of bounds."""
    from interchange.effects import MODELS

    name, *given = words
    known = {n: model for n, model in MODELS.items() if model.is_of_the_chain()}
    if name not in known:
        raise BrightfieldError(
            f"--effect must name an effect of the image chain; got {name}.{did_you_mean(name, known)} "
            f"There are {', '.join(sorted(known))}."
        )
    declared = parameters(known[name])
    values: dict[str, Any] = {}
    for word in given:
        parameter, equals, value = word.partition("=")
        if parameter not in declared:
            raise BrightfieldError(
                f"{name} has no parameter {parameter}.{did_you_mean(parameter, declared)} It has "
                f"{', '.join(declared) or 'none'}."
            )
        try:
            numbers = [float(x) for x in value.split(",")] if equals else []
        except ValueError:
            numbers = []
        if not numbers:
            raise BrightfieldError(f"--effect {name} must give {parameter} a number; got {word}.")
        values[parameter] = numbers[0] if len(numbers) == 1 else tuple(numbers)
    return known[name](**values)


def write_digital(path: Path, image: Image) -> None:
    """DN as whole numbers, not stretched: 8 bits where the sensor has no more, else 16."""
    if image.quantity is not Quantity.DN or image.camera is None:
        raise BrightfieldError(f"An image file of integers holds DN; got {image.quantity}.")
    kind = np.uint8 if image.camera.sensor.bits_out <= 8 else np.uint16
    path.parent.mkdir(parents=True, exist_ok=True)
    images.write(path, image.pixels.astype(kind))

"""Options of every command that makes DN of radiance, and the files it writes: PNG and TIFF of 8 and 16 bits."""

import argparse
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from interchange.formats import emva_sheet, images
from interchange.image import Image, Quantity
from interchange.problems import BrightfieldError

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
    rng = np.random.default_rng([args.noise_seed, zlib.crc32(frame.encode())])
    return expose(image, camera, args.exposure, args.gain, None if args.noise_free else rng)


def write_digital(path: Path, image: Image) -> None:
    """DN as whole numbers, not stretched: 8 bits where the sensor has no more, else 16."""
    if image.quantity is not Quantity.DN or image.camera is None:
        raise BrightfieldError(f"An image file of integers holds DN; got {image.quantity}.")
    kind = np.uint8 if image.camera.sensor.bits_out <= 8 else np.uint16
    path.parent.mkdir(parents=True, exist_ok=True)
    images.write(path, image.pixels.astype(kind))

"""Options that every command has which reads a scene or a part."""

import argparse

from interchange.formats.base import Options
from interchange.problems import BrightfieldError

DEFAULT = Options()


def add_reading_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("reading parts")
    group.add_argument("--unit", help="unit of a file that names none (STL, OBJ, PLY): mm, cm, m, inch, ft")
    group.add_argument(
        "--chord",
        type=float,
        default=DEFAULT.chord_mm,
        metavar="MM",
        help="largest distance of CAD triangles from the surface (default %(default)s mm)",
    )
    group.add_argument(
        "--angle",
        type=float,
        default=DEFAULT.angle_deg,
        metavar="DEG",
        help="largest angle between neighbouring CAD triangles (default %(default)s degrees)",
    )
    cameras = parser.add_argument_group("reading calibrations")
    cameras.add_argument("--resolution", metavar="WxH", help="px, of a calibration that does not say it")
    cameras.add_argument("--pixel", type=float, metavar="UM", help="pixel pitch of a calibrated camera, µm")


def options_from(args: argparse.Namespace) -> Options:
    resolution = None
    if args.resolution:
        words = args.resolution.lower().split("x")
        if len(words) != 2 or not all(w.isdecimal() for w in words):
            raise BrightfieldError(f"--resolution must be WIDTHxHEIGHT, 640x480 say; got {args.resolution}.")
        resolution = int(words[0]), int(words[1])
    if args.pixel is not None and not 0.01 <= args.pixel <= 1e4:
        raise BrightfieldError(f"--pixel must lie in [0.01, 10000] µm; got {args.pixel:g}.")
    return Options(
        unit=args.unit, chord_mm=args.chord, angle_deg=args.angle, resolution=resolution, pixel_um=args.pixel
    )

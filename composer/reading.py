"""Options that every command has which reads a scene or a part."""

import argparse

from interchange.formats.base import Options

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


def options_from(args: argparse.Namespace) -> Options:
    return Options(unit=args.unit, chord_mm=args.chord, angle_deg=args.angle)

"""`brightfield convert IN OUT`: a scene or a part from one format to another; a measured BRDF to a USD material."""

import argparse
import sys
from pathlib import Path

from composer.reading import add_reading_options, options_from
from interchange.formats.base import Options
from interchange.formats.document import Document, format_for_writing, format_of, open_file, open_scene
from interchange.problems import BrightfieldError, Problem, Severity

HELP = "convert a scene or a part to another format, and list what that format cannot carry"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "source", metavar="IN", help="USD, COLLADA, STEP, IGES, STL, OBJ, PLY, glTF, ...; a BRDF"
    )
    parser.add_argument("target", metavar="OUT", help="file to write; its extension names the format")
    parser.add_argument("--strict", action="store_true", help="exit with status 1 where anything was lost")
    add_reading_options(parser)
    brdf = parser.add_argument_group(
        "reading measured BRDFs (MERL, UTIA, RGL, goniometer tables), written as USD"
    )
    brdf.add_argument(
        "--grid", metavar="N,N,N", help="bins of theta_h, theta_d, phi_d; or theta_i, phi_i, theta_o, phi_o"
    )
    brdf.add_argument("--utia", action="store_true", help="an OpenEXR image is UTIA's picture of a BRDF")
    brdf.add_argument(
        "--reciprocal", action="store_true", help="fill with samples whose light and camera are exchanged"
    )


def run(args: argparse.Namespace) -> int:
    target = Path(args.target)
    format_for_writing(target)  # before the reading, which may take long
    options = options_from(args)
    if args.utia or format_of(Path(args.source)).holds == "measurement":
        document = _material(Path(args.source), options, args)
    elif args.grid or args.reciprocal:
        raise BrightfieldError(f"--grid and --reciprocal are for measured BRDFs; {args.source} is a scene.")
    else:
        document = open_scene(args.source, options)
    problems = [*document.problems, *document.save(target)]
    for problem in problems:
        print(f"{problem.severity}: {problem}", file=sys.stderr)
    lost = [p for p in problems if p.severity is not Severity.NOTE]
    count = {0: "nothing was", 1: "one thing was"}.get(len(lost), f"{len(lost)} things were")
    print(f"{target} written; {count} lost.")
    return 1 if args.strict and lost else 0


def _material(source: Path, options: Options, args: argparse.Namespace) -> Document:
    """A document that holds one material: the BRDF of a measurement, as a table."""
    from analysis.tabulate import to_model
    from interchange.formats.usd_author import material_stage
    from interchange.formats.utia import measurement_of
    from interchange.image import Image
    from interchange.material import Material

    shape: tuple[int, ...] = ()
    if args.grid:
        words = args.grid.replace("x", ",").split(",")
        if len(words) not in (3, 4) or not all(w.isdecimal() and int(w) > 0 for w in words):
            raise BrightfieldError(
                f"--grid must be three or four whole numbers, 24,10,12 say; got {args.grid}."
            )
        shape = tuple(map(int, words))
    found = open_file(source, options)
    if args.utia:
        if not isinstance(found, Image):
            raise BrightfieldError(f"--utia is for OpenEXR images of UTIA's BRDFs; {source} is none.")
        found = measurement_of(found.pixels, str(source))
    made = to_model(found, shape, reciprocal=args.reciprocal)
    problems: list[Problem] = list(made.notes)
    return Document(material_stage(Material(source.stem, made.brdf)), source, problems)

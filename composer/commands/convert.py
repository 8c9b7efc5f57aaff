"""`brightfield convert IN OUT`: a scene or a part from one format to another."""

import argparse
import sys
from pathlib import Path

from composer.reading import add_reading_options, options_from
from interchange.formats.document import format_for_writing, open_scene
from interchange.problems import Severity

HELP = "convert a scene or a part to another format, and list what that format cannot carry"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("source", metavar="IN", help="USD, COLLADA, STEP, IGES, STL, OBJ, PLY, glTF, ...")
    parser.add_argument("target", metavar="OUT", help="file to write; its extension names the format")
    parser.add_argument("--strict", action="store_true", help="exit with status 1 where anything was lost")
    add_reading_options(parser)


def run(args: argparse.Namespace) -> int:
    target = Path(args.target)
    format_for_writing(target)  # before the reading, which may take long
    document = open_scene(args.source, options_from(args))
    problems = [*document.problems, *document.save(target)]
    for problem in problems:
        print(f"{problem.severity}: {problem}", file=sys.stderr)
    lost = [p for p in problems if p.severity is not Severity.NOTE]
    count = {0: "nothing was", 1: "one thing was"}.get(len(lost), f"{len(lost)} things were")
    print(f"{target} written; {count} lost.")
    return 1 if args.strict and lost else 0

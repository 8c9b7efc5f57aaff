"""`brightfield info FILE`: what a file of any kind holds, as text or as JSON."""

import argparse
import json

from composer.aligned import plain, text
from composer.describe import describe
from composer.reading import add_reading_options, options_from

HELP = "tell what a file holds: scene, part, image, photometric file or measurement"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE")
    parser.add_argument("--json", action="store_true", help="for machines: everything, as JSON")
    parser.add_argument("--all", action="store_true", help="every row of long lists")
    add_reading_options(parser)


def run(args: argparse.Namespace) -> int:
    found = describe(args.file, options_from(args))
    if args.json:
        print(json.dumps(plain(found), indent=1, ensure_ascii=False))
    else:
        print(text(found, args.all))
    return 1 if any(p["severity"] == "error" for p in found.get("problems", ())) else 0

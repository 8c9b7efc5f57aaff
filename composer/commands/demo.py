"""`brightfield demo`: a CAD part becomes an inspection scene, shown by both renderers; captures are diagnosed."""

import argparse
import time
from pathlib import Path

from interchange.problems import BrightfieldError

HELP = "build an inspection scene round a CAD part, show it by both renderers, diagnose captures"
ASSETS = Path(__file__).parents[2] / "assets"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--out", type=Path, default=Path("out/demo"), help="folder to write to (default %(default)s)"
    )
    parser.add_argument(
        "--samples", type=int, default=32, help="path-traced samples a pixel (default %(default)s)"
    )
    parser.add_argument(
        "--assets", type=Path, default=ASSETS, help="folder of the parts that come with the source"
    )


def run(args: argparse.Namespace) -> int:
    from composer.demo.make import make

    if not args.assets.is_dir():
        raise BrightfieldError(
            f"The demo's part comes with the source; {args.assets} is not there. Name it by --assets."
        )
    start = time.monotonic()

    def say(text: str) -> None:
        print(f"[{time.monotonic() - start:5.1f} s] {text}", flush=True)

    page = make(args.out, args.assets, args.samples, say)
    say(f"done: open {page}")
    return 0

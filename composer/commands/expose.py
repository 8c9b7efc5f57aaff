"""`brightfield expose RADIANCE.exr`: what the camera's sensor makes of a rendered image, in digital numbers."""

import argparse
from pathlib import Path

from composer.exposing import SUFFIXES, add_exposure_options, digital, write_digital
from interchange.formats import exr
from interchange.problems import BrightfieldError

HELP = "turn a rendering (EXR, radiance) into the camera's image (PNG or TIFF, DN), noise included"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("image", type=Path, metavar="RADIANCE.exr")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.png", help="or FILE.tiff")
    add_exposure_options(parser)


def run(args: argparse.Namespace) -> int:
    if args.out.suffix.lower() not in SUFFIXES:
        raise BrightfieldError(
            f"DN are written to a file that ends in {', '.join(SUFFIXES)}; got {args.out}."
        )
    made = digital(exr.read(args.image), args, args.image.stem)
    write_digital(args.out, made)
    bits = made.camera.sensor.bits_out if made.camera else 0
    print(
        f"{args.out} written: {made.pixels.shape[2]} channels of {bits} bits, mean {made.pixels.mean():.1f} DN."
    )
    return 0

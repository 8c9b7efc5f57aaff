"""`brightfield compare A B`: a pair of images as numbers, and by what inspection algorithms find in them."""

import argparse
from pathlib import Path

HELP = "compare two images: rms, bias, PSNR, SSIM, edges, corners, segments, difference map"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("a", type=Path, metavar="A", help="the reference: PNG, TIFF, JPEG, ... (DN) or EXR")
    parser.add_argument("b", type=Path, metavar="B", help="the other one, of the same quantity and size")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="write compare.html, compare.json and difference.png there"
    )


def run(args: argparse.Namespace) -> int:
    from analysis.compare.comparison import compare, rows, write
    from analysis.compare.reading import read_pair

    a, b = read_pair(args.a, args.b)
    found = compare(a, b, _names(args.a, args.b))
    told = rows(found)
    wide = [max(len(row[k]) for row in told) for k in range(2)]
    for what, value, more in told:
        print(f"{what:{wide[0]}}  {value:{wide[1]}}  {more}".rstrip())
    if args.out is not None:
        write(args.out, found)
        print(f"{args.out / 'compare.html'} written.")
    return 0


def _names(a: Path, b: Path) -> tuple[str, str]:
    """As much of the paths' ends as tells them apart."""
    for k in range(1, max(len(a.parts), len(b.parts)) + 1):
        one, other = ("/".join(p.parts[-k:]) for p in (a, b))
        if one != other:
            return one, other
    return str(a), str(b)

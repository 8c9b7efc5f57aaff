"""`brightfield emva DATA`: characterise a camera by EMVA 1288 and write its data sheet, which is a sensor."""

import argparse
import sys
from pathlib import Path

import numpy as np

from interchange.formats import emva_data, emva_sheet, images
from interchange.problems import BrightfieldError
from interchange.sensor import Mosaic

HELP = "characterise a camera by EMVA 1288 from its images; write its data sheet"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "data", type=Path, metavar="DATA", help="descriptor (EMVA1288_Data.txt) or the folder that holds one"
    )
    parser.add_argument("--out", type=Path, metavar="SENSOR.json", help="data sheet to write: .json or .xml")
    parser.add_argument("--pixel", type=float, default=0.0, metavar="UM", help="pixel pitch, micrometres")
    parser.add_argument("--wavelength", type=float, default=0.0, metavar="NM", help="of the light")
    parser.add_argument(
        "--mosaic",
        default="mono",
        choices=["mono", *(m.value for m in Mosaic if m.is_bayer)],
        help="of the raw images: each channel of a Bayer pattern is characterised, and the camera",
    )
    parser.add_argument("--serial-number", default="", help="of the camera: names its fixed pattern")


def run(args: argparse.Namespace) -> int:
    from analysis.emva import Level, characterise, level
    from analysis.emva_color import joined, planes

    about = emva_data.read(_descriptor(args.data))
    pattern = Mosaic(args.mosaic)
    levels: dict[str, list[Level]] = {}
    for p in about.points:
        frames = [_grey(i, about) for i in p.images]
        parts = [planes(y, pattern) if pattern.is_bayer else {"": y} for y in frames]
        for name in parts[0]:
            levels.setdefault(name, []).append(level(p.t_exp, p.photons, (part[name] for part in parts)))
    half = 2 if pattern.is_bayer else 1
    size = (about.width // half, about.height // half)
    found = {
        name: characterise(
            [v for v in own if v.photons > 0],
            [v for v in own if v.photons == 0],
            about.bits,
            args.pixel,
            args.wavelength,
            args.serial_number,
            size,
        )
        for name, own in levels.items()
    }
    sheets = {name: f.sheet for name, f in found.items()}
    sheet = joined(sheets, pattern) if pattern.is_bayer else sheets[""]
    for name, f in found.items():
        if name:
            print(f"{name}, {size[0]} x {size[1]} px")
            _print(f.sheet)
        for note in f.notes:
            print(f"note: {name + ': ' if name else ''}{note}", file=sys.stderr)
    if pattern.is_bayer:
        print("the camera")
    _print(sheet)
    if args.out:
        emva_sheet.write(args.out, sheet)
        print(f"{args.out} written.")
    return 0


def _print(sheet: emva_sheet.DataSheet) -> None:
    for symbol, result in sheet.results.items():
        print(f"{symbol:14} {emva_sheet.said(symbol, result):28} {emva_sheet.SYMBOLS[symbol][0]}")


def _descriptor(data: Path) -> Path:
    if not data.is_dir():
        return data
    found = sorted(data.glob("*.txt"))
    if len(found) != 1:
        raise BrightfieldError(f"The folder must hold one descriptor (*.txt); it has {len(found)}. ({data})")
    return found[0]


def _grey(path: Path, about: emva_data.Descriptor) -> np.ndarray:
    y = images.read(path)
    if y.shape != (about.height, about.width, 1):
        raise BrightfieldError(
            f"An image must be grey and {about.width} x {about.height} px; got {y.shape[1]} x {y.shape[0]} px and "
            f"{y.shape[2]} channels. ({path})"
        )
    return y[..., 0]

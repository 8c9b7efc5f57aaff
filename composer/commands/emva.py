"""`brightfield emva DATA`: characterise a camera by EMVA 1288 and write its data sheet, which is a sensor."""

import argparse
import sys
from pathlib import Path

import numpy as np

from interchange.formats import emva_data, emva_sheet, images
from interchange.problems import BrightfieldError

HELP = "characterise a camera by EMVA 1288 from its images; write its data sheet"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "data", type=Path, metavar="DATA", help="descriptor (EMVA1288_Data.txt) or the folder that holds one"
    )
    parser.add_argument("--out", type=Path, metavar="SENSOR.json", help="data sheet to write: .json or .xml")
    parser.add_argument("--pixel", type=float, default=0.0, metavar="UM", help="pixel pitch, micrometres")
    parser.add_argument("--wavelength", type=float, default=0.0, metavar="NM", help="of the light")
    parser.add_argument("--serial-number", default="", help="of the camera: names its fixed pattern")


def run(args: argparse.Namespace) -> int:
    from analysis.emva import characterise, level

    about = emva_data.read(_descriptor(args.data))
    levels = [level(p.t_exp, p.photons, (_grey(i, about) for i in p.images)) for p in about.points]
    bright = [v for v in levels if v.photons > 0]
    dark = [v for v in levels if v.photons == 0]
    size = (about.width, about.height)
    found = characterise(bright, dark, about.bits, args.pixel, args.wavelength, args.serial_number, size)
    for symbol, result in found.sheet.results.items():
        print(f"{symbol:13} {emva_sheet.said(symbol, result):28} {emva_sheet.SYMBOLS[symbol][0]}")
    for note in found.notes:
        print(f"note: {note}", file=sys.stderr)
    if args.out:
        emva_sheet.write(args.out, found.sheet)
        print(f"{args.out} written.")
    return 0


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

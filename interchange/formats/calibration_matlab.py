"""Calib_Results.m of Bouguet's Camera Calibration Toolbox for MATLAB, read as assignments and never run.

MATLAB counts from 1, the toolbox does not: it takes 1 off every corner that it finds, so its principal point is
counted from the centre of the first pixel, as here. The poses omc_i, Tc_i are the boards', which a scene of cameras
does not hold.
"""

import re
from pathlib import Path

from interchange.formats.base import Format, Options
from interchange.formats.calibrated import Measured
from interchange.formats.calibration_tree import Entry, read_text
from interchange.formats.document import Document
from interchange.problems import FileError, Problem, Where

ASSIGNMENT = re.compile(r"^[ \t]*([A-Za-z]\w*)[ \t]*=[ \t]*(\[[^\]]*\]|[^;\n]*)", re.MULTILINE)


def read(path: Path, options: Options) -> Measured:
    text = read_text(path)
    bare = re.sub(r"%[^\n]*|\.\.\.[^\n]*", lambda m: " " * len(m[0]), text)  # comments keep their length
    found: dict[str, Entry] = {}
    for match in ASSIGNMENT.finditer(bare):
        line = bare.count("\n", 0, match.start(1)) + 1
        words = re.sub(r"[\[\];,]", " ", match[2]).split()
        found[match[1]] = Entry([Entry(w, line, str(path)) for w in words], line, str(path))
    if not found:
        raise FileError(
            Problem("There must be assignments such as fc = [ 657.3 ; 657.7 ] in the file.", Where(str(path)))
        )
    tree = Entry(found, 1, str(path))
    fx, fy = tree["fc"].numbers(2)
    cx, cy = tree["cc"].numbers(2)
    measured = Measured(path, options)
    if "alpha_c" in tree:
        measured.no_skew(tree["alpha_c"].number() * fx, fx, tree["alpha_c"])
    kc = tree["kc"].numbers() if "kc" in tree else ()
    if len(kc) > 5:
        tree["kc"].fail(f"kc has up to 5 numbers; got {len(kc)}.")
    resolution = (tree["nx"].whole(), tree["ny"].whole()) if "nx" in tree and "ny" in tree else None
    measured.add(path.stem, tree["fc"].line, (fx, fy), (cx, cy), resolution, tuple(kc))
    if boards := sum(bool(re.fullmatch(r"omc_\d+", name)) for name in found):
        measured.note(f"The poses of {boards} boards are left out: they are not the camera's.")
    return measured


class Matlab(Format):
    name = "MATLAB calibration"
    extensions = (".m",)

    def recognises(self, head: bytes) -> bool:
        return head.startswith(b"% Intrinsic and Extrinsic Camera Parameters")

    def read(self, path: Path, options: Options) -> Document:
        return read(path, options).document()

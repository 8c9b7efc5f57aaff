"""IGES parts: surfaces and solids by the same kernel as STEP (Open CASCADE, by way of cascadio).

The kernel heals and meshes the surfaces in millimetres, whatever the file's own unit; names and colours do not
come along, so a file is one part. IGES: ANSI US PRO/IPO-100-1996 (IGES 5.3).
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from interchange.formats.base import Format, Options
from interchange.formats.cad import MILLIMETRE, Tessellation, kernel_mesh, read_cad, tessellate
from interchange.formats.document import Document
from interchange.formats.gltf_data import parse
from interchange.problems import FileError, Problem, Severity, Where

PRELOAD = ("cascadio",)
RECORD = 80  # characters a line: 72 of content, the section's letter, a number


class IgesFormat(Format):
    name = "IGES"
    extensions = (".igs", ".iges")

    def recognises(self, head: bytes) -> bool:
        return len(head) > RECORD and head[72:80].strip() == b"S      1"

    def read(self, path: Path, options: Options) -> Document:
        """A stage in millimetres with one mesh prim. Raises FileError."""
        return read_cad(path, options, tessellate_iges)


def tessellate_iges(path: str, chord_mm: float, angle_deg: float) -> Tessellation:
    """Runs in isolation."""
    lines = [line for line in Path(path).read_bytes().decode("latin-1").splitlines() if line.strip()]
    if wrong := _frame(lines):
        raise FileError(Problem(wrong, Where(path)))
    made = tessellate(path, "iges", chord_mm, angle_deg, metres_per_output())
    colours = {line[16:24].strip() for line in [x for x in lines if x[72:73] == "D"][1::2]} - {"", "0"}
    if colours:
        lost = Problem(
            f"{len(colours)} colour(s) are left out: the kernel gives none.", Where(path), Severity.LOSS
        )
        made = replace(made, tree=replace(made.tree, problems=(*made.tree.problems, lost)))
    return made


def _frame(lines: Sequence[str]) -> str:
    """What is wrong with the sections: the kernel reads a file that was cut off as far as it goes, or crashes."""
    counts = {section: sum(line[72:73] == section for line in lines) for section in "SGDP"}
    if not counts["S"] or not counts["G"]:
        return "This is not IGES: lines of 80 characters were expected, with a letter S, G, D, P or T in column 73."
    last = lines[-1]
    if last[72:73] != "T":
        return f"The file ends early: its last line must be of section T; got {last[72:73] or 'none'}."
    for k, section in enumerate("SGDP"):
        said = last[8 * k + 1 : 8 * k + 8].strip()
        if last[8 * k : 8 * k + 1] != section or said != str(counts[section]):
            return f"The last line says that section {section} has {said or 'no'} lines; it has {counts[section]}."
    return ""


def metres_per_output() -> float:
    """How long the kernel's unit is. cascadio 0.1.1 gives IGES in millimetres and STEP in metres, under the same
    name; so that no version can be a thousand times off, a square of 10 mm is meshed to see."""
    glb, _ = kernel_mesh(square(10.0).encode(), "iges", 1.0, 20.0)
    (_, (primitive,)) = parse(glb, "").meshes[0]
    return 10.0 * MILLIMETRE / float(np.ptp(primitive.mesh.vertices[:, 0]))


def square(side: float) -> str:
    """An IGES file in millimetres with one surface: a square in the plane z = 0 (entity 128, B-spline surface)."""
    x = f"{side:.1f}"
    corners = f"0.,0.,0.,{x},0.,0.,0.,{x},0.,{x},{x},0."
    surface = f"128,1,1,1,1,0,0,1,0,0,0.,0.,1.,1.,0.,0.,1.,1.,1.,1.,1.,1.,{corners},0.,1.,0.,1.;"
    head = "1H,,1H;,6Hsquare,6Hsquare,1H1,1H1,32,38,6,308,15,6Hsquare,1.,2,2HMM,1,1.,"
    head += "15H20260101.000000,1E-7,100.,,,11,0;"
    body = [surface[i : i + 64] for i in range(0, len(surface), 64)]
    head_lines = [head[i : i + 72] for i in range(0, len(head), 72)]
    entry = [
        "".join(f"{v:>8}" for v in (128, 1, 0, 0, 0, 0, 0, 0, "00000000")),
        "".join(f"{v:>8}" for v in (128, 0, 0, len(body), 0, 0, 0, "", 0)),
    ]
    counts = f"S{1:7d}G{len(head_lines):7d}D{2:7d}P{len(body):7d}"
    return (
        _section(["square"], "S")
        + _section(head_lines, "G")
        + _section(entry, "D")
        + _section([f"{line:<64}{1:8d}" for line in body], "P")
        + _section([counts], "T")
    )


def _section(lines: Sequence[str], letter: str) -> str:
    return "".join(f"{line:<72}{letter}{i + 1:7d}\n" for i, line in enumerate(lines))

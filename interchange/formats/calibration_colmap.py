"""COLMAP's text model: cameras.txt, and the poses of images.txt beside it.

COLMAP's image coordinates begin at the corner of the first pixel, so its centre is (0.5, 0.5): half a pixel is taken
off here. Its world has no unit. https://colmap.github.io/format.html, cameras.html
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from interchange.distortion import LensModel
from interchange.formats.base import Format, Options
from interchange.formats.calibrated import Measured, pose_from
from interchange.formats.calibration_tree import Entry, read_text
from interchange.formats.document import Document
from interchange.problems import FileError, Problem, Where

# parameters in the file's order; k1 to k4 of a fisheye are OpenCV's
MODELS = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
    "SIMPLE_RADIAL_FISHEYE": "f cx cy k1",
    "RADIAL_FISHEYE": "f cx cy k1 k2",
    "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4",
}
CORNER = 0.5  # px: where COLMAP has the centre of the first pixel
CAMERA_LINE = re.compile(rb"^\s*\d+\s+[A-Z][A-Z_]+\s+\d+\s+\d+\s+[-+.\d]", re.MULTILINE)


@dataclass(frozen=True)
class Row:
    words: list[str]
    at: Entry

    def number(self, k: int) -> float:
        return Entry(self.words[k], self.at.line, self.at.file).number()

    def whole(self, k: int) -> int:
        return Entry(self.words[k], self.at.line, self.at.file).whole()


def read(path: Path, options: Options) -> Measured:
    """One camera an image where images.txt is there, else one a camera at the origin."""
    found = Measured(path, options)
    folder = path.parent
    lenses = {}
    for row in _rows(folder / "cameras.txt" if path.name == "images.txt" else path):
        if len(row.words) < 5:
            row.at.fail("A camera must be a line of number, model, width, height and parameters.")
        model = row.words[1]
        if model not in MODELS:
            row.at.fail(f'A camera model must be one of {", ".join(MODELS)} to be read here; got "{model}".')
        names = MODELS[model].split()
        if len(row.words) != 4 + len(names):
            row.at.fail(f"{model} has {len(names)} parameters ({MODELS[model]}); got {len(row.words) - 4}.")
        values = {name: row.number(4 + k) for k, name in enumerate(names)}
        if row.whole(0) in lenses:
            row.at.fail(f"Camera {row.words[0]} is there twice.")
        lenses[row.whole(0)] = (row, values)
    if not lenses:
        raise FileError(Problem("The file holds no camera.", Where(str(path))))
    images = folder / "images.txt"
    if not images.is_file():
        for number in lenses:
            _add(found, f"camera_{number}", *lenses[number], None)
        return found
    scale = _scale(found, images)
    for row in _image_rows(images):
        if len(row.words) < 10:
            row.at.fail("An image must be a line of number, quaternion, translation, camera and name.")
        w, x, y, z, *t = (row.number(k) for k in range(1, 8))
        if not 0.99 < np.linalg.norm([w, x, y, z]) < 1.01:
            row.at.fail("An image's quaternion must have length 1.")
        if row.whole(8) not in lenses:
            row.at.fail(f"Camera {row.words[8]} is not in cameras.txt.")
        pose = pose_from(Rotation.from_quat([x, y, z, w]).as_matrix(), scale * np.array(t))
        _add(found, Path(" ".join(row.words[9:])).stem, *lenses[row.whole(8)], pose)
    return found


def _add(found: Measured, name: str, row: Row, values: dict[str, float], pose: np.ndarray | None) -> None:
    fisheye = row.words[1].endswith("FISHEYE")
    order = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    f = values.get("f", 0.0)
    found.add(
        name, row.at.line, (values.get("fx", f), values.get("fy", f)),
        (values["cx"] - CORNER, values["cy"] - CORNER), (row.whole(2), row.whole(3)),
        tuple(values.get(k, 0.0) for k in order), LensModel.FISHEYE if fisheye else LensModel.OPENCV, pose,
    )  # fmt: skip


def _scale(found: Measured, images: Path) -> float:
    from interchange.formats.mesh_files import metres_per_unit

    if found.options.unit is None:
        message = "COLMAP's world has no unit; say what its 1 is by --unit m, mm, ..."
        raise FileError(Problem(message, Where(str(images))))
    try:
        return float(metres_per_unit(found.options.unit))
    except LookupError as error:
        raise FileError(Problem(str(error), Where(str(images)))) from None


def _rows(path: Path) -> list[Row]:
    lines = enumerate(read_text(path).splitlines(), 1)
    return [
        Row(line.split(), Entry(line, number, str(path)))
        for number, line in lines
        if line.strip() and not line.lstrip().startswith("#")
    ]


def _image_rows(path: Path) -> list[Row]:
    """Every image has two lines; the second, its points, may be empty."""
    lines = [
        (number, line)
        for number, line in enumerate(read_text(path).splitlines(), 1)
        if not line.lstrip().startswith("#")
    ]
    while lines and not lines[0][1].strip():
        lines.pop(0)
    return [Row(line.split(), Entry(line, number, str(path))) for number, line in lines[::2] if line.strip()]


class Colmap(Format):
    name = "COLMAP model"
    extensions = ()  # told by content: much else ends in .txt

    def recognises(self, head: bytes) -> bool:
        return head.startswith((b"# Camera list", b"# Image list")) or bool(CAMERA_LINE.search(head))

    def read(self, path: Path, options: Options) -> Document:
        return read(path, options).document()

"""OpenCV's FileStorage, YAML or XML: one camera as its samples write it, or the pair of stereo_calib.

Names differ between programs; what is taken for a camera matrix is camera_matrix, cameraMatrix, Camera_Matrix, K, M and
the like, for its distortion distortion_coefficients, distCoeffs, D and the like. A number or left / right at the end
tells cameras of a pair apart; R and T then take points of the first into the second.
"""

import re
from pathlib import Path

import numpy as np

from interchange.distortion import LensModel
from interchange.formats.base import Format, Options
from interchange.formats.calibrated import Measured, pose_from
from interchange.formats.calibration_tree import Entry, read_xml
from interchange.formats.calibration_yaml import read_any
from interchange.formats.document import Document
from interchange.problems import FileError, Problem, Where

WHICH = r"_?(left|right|l|r|\d+)?"
MATRIX = re.compile(rf"(?:camera_?matrix|intrinsic_?matrix|intrinsics?|mtx|k|m){WHICH}", re.IGNORECASE)
DISTORTION = re.compile(rf"(?:dist(?:ortion)?_?coeff?s?(?:icients)?|distortion|dist|d){WHICH}", re.IGNORECASE)
COUNTS = (4, 5, 8, 12, 14)


def speaks(tree: Entry) -> bool:
    return any(MATRIX.fullmatch(name) and "data" in tree[name] for name in tree.names())


def cameras(tree: Entry, path: Path, options: Options) -> Measured:
    found = Measured(path, options)
    matrices = {m[1] or "": n for n in tree.names() if (m := MATRIX.fullmatch(n)) and "data" in tree[n]}
    lenses = {m[1] or "": n for n in tree.names() if (m := DISTORTION.fullmatch(n)) and "data" in tree[n]}
    if not matrices:
        raise FileError(Problem('There must be a "camera_matrix" in the file.', Where(str(path))))
    fisheye = any(
        n in tree and tree[n].text().strip().lower() in ("1", "true") for n in ("fisheye_model", "fisheye")
    )
    resolution = _resolution(tree)
    for k, (which, name) in enumerate(matrices.items()):
        K = tree[name]
        focal, centre = found.matrix(K)
        coefficients: tuple[float, ...] = ()
        if which in lenses:
            d = tree[lenses[which]]
            coefficients = tuple(d.numbers())
            if len(coefficients) not in ((4,) if fisheye else COUNTS):
                counts = "4" if fisheye else ", ".join(map(str, COUNTS))
                d.fail(f"Distortion coefficients must be {counts} in number; got {len(coefficients)}.")
        elif lenses:
            K.fail(
                f"There must be distortion coefficients to {name}; the file has {', '.join(lenses.values())}."
            )
        pose = None
        if k == 1 and len(matrices) == 2 and "R" in tree and "T" in tree:
            R = tree["R"].numbers()
            if R.size not in (3, 9):
                tree["R"].fail(f"R must be a rotation matrix or vector; got {R.size} numbers.")
            pose = pose_from(R, _metres(tree["T"].numbers(3), found, tree["T"]))
        found.add(
            f"camera{which and '_' + which}", K.line, focal, centre, resolution, coefficients,
            LensModel.FISHEYE if fisheye else LensModel.OPENCV, pose,
        )  # fmt: skip
    if len(matrices) > 1 and "R" not in tree:
        found.note("The cameras' poses are in another file (extrinsics); all stand at the origin.")
    return found


def _metres(t: np.ndarray, found: Measured, where: Entry) -> np.ndarray:
    """OpenCV does not know the unit of the board's squares."""
    from interchange.formats.mesh_files import metres_per_unit

    if found.options.unit is None:
        where.fail(
            f"The file does not say the unit of the distance of {np.linalg.norm(t):g} between its cameras; name it by "
            "--unit mm."
        )
    try:
        return np.asarray(t * metres_per_unit(found.options.unit))
    except LookupError as error:
        where.fail(str(error))


def _resolution(tree: Entry) -> tuple[int, int] | None:
    width = tree.first("image_width", "image_Width", "width", "imageWidth")
    height = tree.first("image_height", "image_Height", "height", "imageHeight")
    if width is not None and height is not None:
        return width.whole(), height.whole()
    size = tree.first("image_size", "imageSize", "size", "img_size", "resolution")
    if size is None:
        return None
    columns, rows = size.numbers(2)
    return int(columns), int(rows)


class OpenCv(Format):
    name = "OpenCV calibration"
    extensions = (".yml", ".yaml")  # .xml is told by content

    def recognises(self, head: bytes) -> bool:
        return head.startswith(b"%YAML:") or b"<opencv_storage" in head

    def read(self, path: Path, options: Options) -> Document:
        with open(path, "rb") as stream:
            first = stream.read(64).lstrip(b"\xef\xbb\xbf \r\n\t")
        if first.startswith(b"<"):
            return cameras(read_xml(path), path, options).document()
        return read_any(path, options)

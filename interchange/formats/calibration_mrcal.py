"""mrcal's .cameramodel: a Python dictionary, read as a literal and never run.

Lenses LENSMODEL_PINHOLE and LENSMODEL_OPENCV4, 5, 8 and 12; the pose takes points of the reference into the camera
(rotation vector, metres). https://mrcal.secretsauce.net/cameramodels.html
"""

import ast
from pathlib import Path

import numpy as np

from interchange.formats.base import Format, Options
from interchange.formats.calibrated import Measured, pose_from
from interchange.formats.calibration_tree import Entry, read_text
from interchange.formats.document import Document
from interchange.problems import FileError, Problem, Where

LENSES = {"PINHOLE": 0, "OPENCV4": 4, "OPENCV5": 5, "OPENCV8": 8, "OPENCV12": 12}
WANTED = ("lensmodel", "distortion_model", "intrinsics", "extrinsics", "rt_cam_ref", "imagersize")


def read(path: Path, options: Options) -> Measured:
    tree = _literal(path)
    found = Measured(path, options)
    lens = tree.first("lensmodel", "distortion_model") or tree["lensmodel"]
    name = lens.text().removeprefix("LENSMODEL_").removeprefix("DISTORTION_").replace("NONE", "PINHOLE")
    if name not in LENSES:
        known = ", ".join(f"LENSMODEL_{n}" for n in LENSES)
        lens.fail(f'A lens model must be one of {known} to be read here; got "{lens.text()[:60]}".')
    fx, fy, cx, cy, *d = tree["intrinsics"].numbers(4 + LENSES[name])
    width, height = (int(n) for n in tree["imagersize"].numbers(2))
    pose = None
    if (rt := tree.first("extrinsics", "rt_cam_ref")) is not None:
        numbers = rt.numbers(6)
        pose = pose_from(numbers[:3], numbers[3:])
    found.add(path.stem, lens.line, (fx, fy), (cx, cy), (width, height), tuple(d), camera_from_world=pose)
    return found


def _literal(path: Path) -> Entry:
    where = Where(str(path))
    try:
        tree = ast.parse(read_text(path).lstrip(), mode="eval").body
    except SyntaxError as error:
        line = f"line {error.lineno}" if error.lineno else ""
        message = f"The file must be one Python dictionary: {error.msg}."
        raise FileError(Problem(message, Where(str(path), line))) from None
    except (ValueError, RecursionError, MemoryError):
        raise FileError(
            Problem("The file must be one Python dictionary of numbers and words.", where)
        ) from None
    if not isinstance(tree, ast.Dict):
        raise FileError(Problem("The file must be one Python dictionary.", where))
    found: dict[str, Entry] = {}
    for key, value in zip(tree.keys, tree.values, strict=True):
        name = key.value if isinstance(key, ast.Constant) else None
        if name not in WANTED:
            continue
        try:
            plain = np.ravel(ast.literal_eval(value)).tolist()
        except (ValueError, TypeError, SyntaxError, RecursionError, MemoryError):
            message = f'"{name}" must be plain numbers or words.'
            raise FileError(Problem(message, Where(str(path), f"line {value.lineno}"))) from None
        leaves = [Entry(str(v), value.lineno, str(path)) for v in plain]
        word = isinstance(value, ast.Constant) and isinstance(value.value, str)
        found[str(name)] = Entry(str(plain[0]) if word else leaves, value.lineno, str(path))
    return Entry(found, 1, str(path))


class Mrcal(Format):
    name = "mrcal camera model"
    extensions = (".cameramodel",)

    def recognises(self, head: bytes) -> bool:
        return b"'lensmodel'" in head or b'"lensmodel"' in head

    def read(self, path: Path, options: Options) -> Document:
        return read(path, options).document()

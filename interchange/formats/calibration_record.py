"""calib.json, which `brightfield calibrate` writes: cameras with what is uncertain about them. Read as cameras."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from interchange.distortion import LensModel
from interchange.formats.base import Format, Options
from interchange.formats.calibrated import Measured
from interchange.formats.calibration_tree import read_text
from interchange.formats.document import Document
from interchange.problems import FileError, Problem, Where


def read(path: Path, options: Options) -> Measured:
    where = Where(str(path))
    try:
        data = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        place = Where(str(path), f"line {error.lineno}")
        raise FileError(Problem(f"The file is not JSON: {error.msg}.", place)) from None
    except RecursionError:
        raise FileError(Problem("The file is nested too deep.", where)) from None
    cameras = data.get("cameras") if isinstance(data, dict) else None
    if not isinstance(cameras, list) or not cameras:
        raise FileError(Problem('A calibration must have a list of "cameras".', where))
    found = Measured(path, options)
    for k, camera in enumerate(cameras):
        try:
            _add(found, camera)
        except (KeyError, TypeError, ValueError, IndexError) as error:
            reason = f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
            place = Where(str(path), f"cameras[{k}]")
            raise FileError(
                Problem(f"A camera must be as brightfield calibrate writes it: {reason}.", place)
            ) from None
    return found


def _add(found: Measured, camera: dict[str, Any]) -> None:
    K = np.array(camera["K"], np.float64).reshape(3, 3)
    pose = np.array(camera["camera_from_rig"], np.float64).reshape(4, 4)
    width, height = (int(n) for n in camera["resolution"])
    found.add(
        str(camera["name"]), 0, (K[0, 0], K[1, 1]), (K[0, 2], K[1, 2]), (width, height),
        tuple(float(v) for v in camera["distortion"].values()), LensModel(camera["model"]), pose,
    )  # fmt: skip


class CalibrationRecord(Format):
    name = "Brightfield calibration"
    extensions = (".json",)

    def recognises(self, head: bytes) -> bool:
        return head.lstrip().startswith(b"{") and b'"rms_px"' in head

    def read(self, path: Path, options: Options) -> Document:
        return read(path, options).document()

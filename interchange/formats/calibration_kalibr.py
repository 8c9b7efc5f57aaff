"""Kalibr's camera chain (camchain.yaml): pinhole cameras with radtan or equidistant distortion, each posed against the
one before it.

https://github.com/ethz-asl/kalibr/wiki/yaml-formats
"""

import re
from pathlib import Path

import numpy as np

from interchange.distortion import LensModel
from interchange.formats.base import Format, Options
from interchange.formats.calibrated import Measured
from interchange.formats.calibration_tree import Entry
from interchange.formats.calibration_yaml import read_any
from interchange.formats.document import Document

CAMERA = re.compile(r"cam\d+")
LENSES = {"radtan": LensModel.OPENCV, "equidistant": LensModel.FISHEYE, "none": LensModel.OPENCV}


def speaks(tree: Entry) -> bool:
    return any(CAMERA.fullmatch(name) and "intrinsics" in tree[name] for name in tree.names())


def cameras(tree: Entry, path: Path, options: Options) -> Measured:
    """The first camera is the world."""
    found = Measured(path, options)
    names = sorted((n for n in tree.names() if CAMERA.fullmatch(n)), key=lambda n: int(n[3:]))
    camera_from_world = np.eye(4)
    for place, name in enumerate(names):
        one = tree[name]
        if (projection := one["camera_model"].text()) != "pinhole":
            one["camera_model"].fail(f'A camera_model must be pinhole to be read here; got "{projection}".')
        kind = one["distortion_model"].text()
        if kind not in LENSES:
            one["distortion_model"].fail(
                f'A distortion_model must be radtan, equidistant or none to be read here; got "{kind}".'
            )
        coefficients = () if kind == "none" else one["distortion_coeffs"].numbers(4)
        fx, fy, cx, cy = one["intrinsics"].numbers(4)
        width, height = (int(n) for n in one["resolution"].numbers(2))
        if place:
            step = one["T_cn_cnm1"].numbers(16).reshape(4, 4)  # camera_from_camera_before
            camera_from_world = step @ camera_from_world
        line = one.line
        found.add(
            name,
            line,
            (fx, fy),
            (cx, cy),
            (width, height),
            tuple(coefficients),
            LENSES[kind],
            camera_from_world,
        )
        if "T_cam_imu" in one:
            found.note(f"{name}'s pose against the IMU is left out: a scene has none.", one["T_cam_imu"].line)
    return found


class Kalibr(Format):
    name = "Kalibr camera chain"
    extensions = (".yaml", ".yml")

    def recognises(self, head: bytes) -> bool:
        return bool(re.match(rb"(\s*#[^\n]*\n|\s*\n)*cam\d+:\s*\n", head))

    def read(self, path: Path, options: Options) -> Document:
        return read_any(path, options)

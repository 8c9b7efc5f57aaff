"""ROS's camera_info: what camera_calibration writes as YAML, and what the topic prints.

sensor_msgs/CameraInfo; distortion models plumb_bob, rational_polynomial and equidistant (OpenCV's fisheye).
"""

import re
from pathlib import Path

from interchange.distortion import LensModel
from interchange.formats.base import Format, Options
from interchange.formats.calibrated import Measured
from interchange.formats.calibration_tree import Entry
from interchange.formats.calibration_yaml import read_any
from interchange.formats.document import Document

LENSES = {
    "plumb_bob": (LensModel.OPENCV, 5),
    "rational_polynomial": (LensModel.OPENCV, 14),
    "equidistant": (LensModel.FISHEYE, 4),
    "fisheye": (LensModel.FISHEYE, 4),
}


def speaks(tree: Entry) -> bool:
    return "distortion_model" in tree and any(n in tree for n in ("camera_matrix", "K", "k"))


def cameras(tree: Entry, path: Path, options: Options) -> Measured:
    found = Measured(path, options)
    kind = tree["distortion_model"].text()
    if kind not in LENSES:
        tree["distortion_model"].fail(
            f'A distortion_model must be one of {", ".join(LENSES)} to be read here; got "{kind}".'
        )
    lens, most = LENSES[kind]
    K = tree.first("camera_matrix", "K", "k")
    d = tree.first("distortion_coefficients", "D", "d")
    assert K is not None
    focal, centre = found.matrix(K)
    coefficients = d.numbers() if d is not None else ()
    if len(coefficients) > most:
        assert d is not None
        d.fail(f"{kind} has up to {most} coefficients; got {len(coefficients)}.")
    size = tree.first("image_width", "width"), tree.first("image_height", "height")
    resolution = (size[0].whole(), size[1].whole()) if size[0] and size[1] else None
    name = tree["camera_name"].text() if "camera_name" in tree else "camera"
    if focal == (0.0, 0.0):
        K.fail("The camera is not calibrated: its matrix is 0.")
    found.add(name, K.line, focal, centre, resolution, tuple(coefficients), lens)
    for part, trivial in (("binning_x", (0, 1)), ("binning_y", (0, 1))):
        if part in tree and tree[part].whole() not in trivial:
            tree[part].fail(
                "Binned images have another resolution than the calibration; this must be 0 or 1."
            )
    return found


class Ros(Format):
    name = "ROS camera_info"
    extensions = (".yaml", ".yml")

    def recognises(self, head: bytes) -> bool:
        return bool(re.search(rb"^(image_width|header):", head, re.MULTILINE)) and not head.startswith(
            b"%YAML:"
        )

    def read(self, path: Path, options: Options) -> Document:
        return read_any(path, options)

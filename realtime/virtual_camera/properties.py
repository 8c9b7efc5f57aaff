"""The properties of ``cv2.VideoCapture`` that a live camera has, by OpenCV's numbers.

Units are those of OpenCV's own backend for GenICam cameras: exposure in s, gain in dB.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import cv2

from interchange.problems import BrightfieldError

if TYPE_CHECKING:
    from realtime.virtual_camera.camera import VirtualCamera

FOURCC = {"Mono8": "GREY", "Mono10": "Y10 ", "Mono12": "Y12 ", "Mono16": "Y16 ", "RGB8": "RGB3"}
FOURCC |= {"BayerRG8": "RGGB", "BayerBG8": "BA81", "BayerGR8": "GRBG", "BayerGB8": "GBRG"}  # as V4L2 has them


class Property(NamedTuple):
    get: Callable[["VirtualCamera"], float]
    put: Callable[["VirtualCamera", float], object] | None = None  # raises BrightfieldError


def _cv_type(camera: "VirtualCamera") -> int:
    format = camera.settings.format
    return cv2.CV_MAKETYPE(cv2.CV_8U if format.bits == 8 else cv2.CV_16U, format.channels)


def _fourcc(camera: "VirtualCamera") -> int:
    return sum(ord(c) << 8 * i for i, c in enumerate(FOURCC[camera.settings.format.name]))


def _put_fourcc(camera: "VirtualCamera", value: float) -> None:
    word = "".join(chr(int(value) >> 8 * i & 255) for i in range(4))
    name = next((n for n, code in FOURCC.items() if code == word), None)
    if name is None:
        raise BrightfieldError(f'No pixel format has the FOURCC "{word}".')
    camera.configure(format=name)


def _resize(camera: "VirtualCamera", width: float = 0, height: float = 0) -> None:
    x, y, w, h = camera.settings.region
    camera.configure(region=(x, y, int(width) or w, int(height) or h))


PROPERTIES: dict[int, Property] = {
    cv2.CAP_PROP_POS_MSEC: Property(lambda c: c.position[1] * 1e3),
    cv2.CAP_PROP_POS_FRAMES: Property(lambda c: c.position[0]),  # number of the latest frame
    cv2.CAP_PROP_FRAME_WIDTH: Property(lambda c: c.settings.region[2], lambda c, v: _resize(c, width=v)),
    cv2.CAP_PROP_FRAME_HEIGHT: Property(lambda c: c.settings.region[3], lambda c, v: _resize(c, height=v)),
    cv2.CAP_PROP_FPS: Property(lambda c: c.settings.frame_rate, lambda c, v: c.configure(frame_rate=v)),
    cv2.CAP_PROP_FOURCC: Property(_fourcc, _put_fourcc),
    cv2.CAP_PROP_FORMAT: Property(_cv_type),
    cv2.CAP_PROP_GAIN: Property(lambda c: c.settings.gain_dB, lambda c, v: c.configure(gain_dB=v)),
    cv2.CAP_PROP_EXPOSURE: Property(lambda c: c.settings.t_exp, lambda c, v: c.configure(t_exp=v)),
    cv2.CAP_PROP_TRIGGER: Property(
        lambda c: c.settings.triggered, lambda c, v: c.configure(triggered=bool(v))
    ),
}


def get(camera: "VirtualCamera", prop: int) -> float:
    found = PROPERTIES.get(prop)
    return float(found.get(camera)) if found else 0.0


def put(camera: "VirtualCamera", prop: int, value: float) -> bool:
    found = PROPERTIES.get(prop)
    if found is None or found.put is None:
        return False
    try:
        found.put(camera, value)
    except BrightfieldError:  # OpenCV's way to say so
        return False
    return True

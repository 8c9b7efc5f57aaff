"""What the pixels of a colour sensor measured, of captures that are demosaiced: two of three numbers are made of the
neighbours', have less noise than any pixel has, and say nothing of their own.

    raw = (M⁻¹ (DN - black) + black) at the channel of each pixel's own filter

M is the camera's colour matrix. Both ways of interpolation that cameras have here (interchange/effects/demosaic.py)
leave a pixel's own number as it was, but for the outermost row and column. What a JPEG or a curve after a matrix has
mixed is not taken apart.
"""

from dataclasses import replace

import numpy as np

from interchange.camera import Camera
from interchange.captures import Capture
from interchange.effects.mosaic import phases
from interchange.effects.response_curve import ResponseCurve
from interchange.sensor import IDENTITY

WORST = 1e3  # condition of a colour matrix that is taken back


def is_raw(capture: Capture) -> bool:
    """Whether a colour sensor's capture is as its pixels are: demosaiced ones have three channels."""
    return capture.pixels.shape[2] == 1


def tells_its_pixels(capture: Capture, camera: Camera) -> bool:
    """Whether a colour sensor's capture is what its pixels measured, or can be taken apart into that."""
    sensor = camera.sensor
    if sensor.jpeg_quality:
        return False
    if is_raw(capture) or sensor.color_correction == IDENTITY:
        return True
    fewer = capture.bits == 8 and sensor.bits_out > 8  # of another black level than the sensor's
    M = np.array(sensor.color_correction).reshape(3, 3)
    return not fewer and not ResponseCurve.of(camera).is_there and bool(np.linalg.cond(M) < WORST)


def raw(capture: Capture, camera: Camera) -> Capture:
    """A capture that ``tells_its_pixels``, (H, W, 3), as (H, W, 1), its outermost pixels masked; one that is raw as it
    is."""
    if is_raw(capture):
        return capture
    sensor, pixels = camera.sensor, capture.pixels
    mixed = sensor.color_correction != IDENTITY
    if mixed:
        M = np.array(sensor.color_correction).reshape(3, 3)
        pixels = (pixels - sensor.black_level) @ np.linalg.inv(M).T + sensor.black_level
    own = np.empty((*pixels.shape[:2], 1), np.float32)
    for i, j, channel in phases(sensor.mosaic):
        own[i::2, j::2, 0] = pixels[i::2, j::2, channel]
    inside = np.zeros(own.shape[:2], bool)
    inside[1:-1, 1:-1] = True
    mask = inside if capture.mask is None else inside & capture.mask
    return replace(capture, pixels=own, mask=mask, bits=0 if mixed else capture.bits)

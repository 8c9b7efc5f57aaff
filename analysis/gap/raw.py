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
from interchange.effects.demosaic import Demosaic
from interchange.effects.mosaic import phases
from interchange.sensor import IDENTITY, Response


def is_raw(capture: Capture, camera: Camera) -> bool:
    """Whether a capture of a colour mosaic is as its pixels are."""
    return capture.pixels.shape[2] == 1 and not Demosaic.of(camera).is_there


def can_be_taken_apart(camera: Camera) -> bool:
    """Whether demosaiced captures of a colour mosaic tell what its pixels measured."""
    sensor = camera.sensor
    M = np.array(sensor.color_correction).reshape(3, 3)
    plain = sensor.color_correction == IDENTITY or (
        sensor.response is Response.LINEAR and bool(np.linalg.cond(M) < 1e3)
    )
    return Demosaic.of(camera).is_there and not sensor.jpeg_quality and plain


def raw(capture: Capture, camera: Camera) -> Capture:
    """A capture (H, W, 3) of a demosaicing ``camera`` as (H, W, 1), its outermost pixels masked."""
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

"""What the pixels of a colour sensor measured, of captures that are demosaiced: two of three numbers are made of the
neighbours', have less noise than any pixel has, and say nothing of their own.

Both ways of interpolation that cameras have here (interchange/effects/demosaic.py) leave a pixel's own number as it
was, but for the outermost row and column; a colour matrix is taken back before (analysis.gap.processed.matrices).
What a JPEG has mixed is not taken apart.
"""

from dataclasses import replace

import numpy as np

from interchange.camera import Camera
from interchange.captures import Capture
from interchange.effects.mosaic import phases


def is_raw(capture: Capture) -> bool:
    """Whether a colour sensor's capture is as its pixels are: demosaiced ones have three channels."""
    return capture.pixels.shape[2] == 1


def tells_its_pixels(capture: Capture, camera: Camera) -> bool:
    """Whether a colour sensor's capture is what its pixels measured, or can be taken apart into that."""
    return is_raw(capture) or not camera.sensor.jpeg_quality


def raw(capture: Capture, camera: Camera) -> Capture:
    """A capture that ``tells_its_pixels``, (H, W, 3), as (H, W, 1), its outermost pixels masked; one that is raw as it
    is."""
    if is_raw(capture):
        return capture
    own = np.empty((*capture.pixels.shape[:2], 1), np.float32)
    for i, j, channel in phases(camera.sensor.mosaic):
        own[i::2, j::2, 0] = capture.pixels[i::2, j::2, channel]
    inside = np.zeros(own.shape[:2], bool)
    inside[1:-1, 1:-1] = True
    mask = inside if capture.mask is None else inside & capture.mask
    return replace(capture, pixels=own, mask=mask)

"""Electrons of an exposure and their temporal noise, pixel by pixel: what every measure of a set-up is made from.

    σ² = µ_e + µ_I t + σ_d² + (PRNU µ_e)² + 1 / (12 K²)        e-², K DN per e- (EMVA 1288, eq. 7 and 14)

A saturated pixel tells nothing: its signal is the full well and no slope is left in it.
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.exposure import expose
from interchange.image import Image, Quantity
from interchange.sensor import Demosaic, Mosaic


@dataclass(frozen=True, eq=False)
class Signal:
    """(H, W) each: ``electrons``, mean over the channels; ``sigma`` rms of that mean; ``saturated`` bool."""

    electrons: np.ndarray
    sigma: np.ndarray
    saturated: np.ndarray


def signal(image: Image, camera: Camera) -> Signal:
    """What ``camera`` makes of an image of radiance, free of noise, and the noise that each pixel would have."""
    plain = replace(camera.sensor, demosaic=Demosaic.NONE) if camera.sensor.mosaic.is_bayer else camera.sensor
    camera = replace(camera, sensor=plain)
    shot = expose(image, camera, until=Quantity.ELECTRONS)
    e = np.asarray(shot.pixels, np.float64)
    s = camera.sensor
    limit = min(s.full_well, (2**s.bit_depth - 1 - s.black_level) / s.K)
    full = e >= 0.999 * limit
    e = np.minimum(e, limit)
    variance = e + s.read_noise**2 + (s.prnu * e) ** 2 + 1 / (12 * s.K**2)
    channels = 1 if s.mosaic is not Mosaic.NONE else e.shape[2]
    return Signal(e.mean(axis=2), np.sqrt(variance.mean(axis=2) / channels), full.any(axis=2))


def mean_of(runs: list[Signal]) -> Signal:
    """Of several renderings of one view."""
    return Signal(
        np.mean([r.electrons for r in runs], axis=0),
        np.sqrt(np.mean([r.sigma**2 for r in runs], axis=0)),
        np.any([r.saturated for r in runs], axis=0),
    )

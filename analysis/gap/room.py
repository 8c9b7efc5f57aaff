"""What surfaces get from a room that is brighter to one side: of ambient light that is ω_k in the direction ω.

    A_k(u) = A(u) (2 T_k(u) / T(u) - 1),      T: under radiance 1 from everywhere, T_k: under (1 + ω_k) / 2

T and T_k are drawn on a grid ``COARSER`` times coarser than the sensor's, as light from all around changes slowly over
a surface, and their ratio is laid onto it surface by surface.
"""

from collections.abc import Callable

import cv2
import numpy as np

from analysis.gap.reach import cropped
from analysis.gap.reflected import finely
from interchange.camera import Camera
from interchange.effects.ambient_light import AXES, leaning
from interchange.light import Light, LightKind

COARSER = 3  # odd, as the middle of a pixel is told there
MOST = 1.0  # of what comes from everywhere


def leanings(
    drawn: Callable[[Camera, Light], np.ndarray], camera: Camera, surface: np.ndarray, normal: np.ndarray
) -> dict[str, np.ndarray]:
    """{axis of the world: (H, W, 3) float16 in [-1, 1]}: what it gives over what comes from everywhere. ``drawn``: the
    radiance (h, w, 3) that a camera sees under one light; ``surface`` (H, W), ``normal`` (H, W, 3) of ``camera``."""
    width, height = (x // COARSER for x in camera.sensor.resolution)
    whole = slice(0, height * COARSER), slice(0, width * COARSER)
    eye = cropped(camera, *whole).resized(width)
    domes = [
        Light("room", LightKind.DOME, (1.0, 1.0, 1.0), texture=leaning((0.5, 0.5, 0.5), 0.5 * np.eye(3)[k]))
        for k in range(3)
    ]
    every = drawn(eye, Light("room", LightKind.DOME, (1.0, 1.0, 1.0)))
    planes = np.concatenate([every, *(drawn(eye, dome) for dome in domes)], axis=2)
    fine = finely(np.maximum(planes, 0), surface[whole], normal[whole])
    out = {}
    for k, axis in enumerate(AXES):
        part, of = fine[..., 3 * k + 3 : 3 * k + 6], fine[..., :3]
        share = 2 * np.divide(part, of, out=np.full_like(of, 0.5), where=of > 0) - 1
        out[axis] = _padded(np.clip(share, -MOST, MOST), camera.sensor.resolution)
    return out


def _padded(plane: np.ndarray, resolution: tuple[int, int]) -> np.ndarray:
    """With its last rows and columns once more, where a grid does not go into the sensor's."""
    w, h = resolution
    below, beside = h - plane.shape[0], w - plane.shape[1]
    return np.asarray(cv2.copyMakeBorder(plane, 0, below, 0, beside, cv2.BORDER_REPLICATE), np.float16)

"""What surfaces get from a room that is brighter to one side: of ambient light that is ω_k in the direction ω.

    A_k(u) = A(u) (2 T_k(u) / T(u) - 1),      T: under radiance 1 from everywhere, T_k: under (1 + ω_k) / 2

T and T_k are drawn on a grid ``COARSER`` times coarser than the sensor's, as light from all around changes slowly over
a surface, and their ratio is laid onto it surface by surface.
"""

from collections.abc import Callable, Sequence

import cv2
import numpy as np

from analysis.gap.light.reach import cropped
from analysis.gap.light.reflected import finely
from interchange.camera import Camera
from interchange.effects.ambient_light import AXES, leaning
from interchange.light import Light, LightKind

COARSER = 3  # odd, as the middle of a pixel is told there
MOST = 1.0  # of what comes from everywhere
DOME = Light("room", LightKind.DOME, (1.0, 1.0, 1.0))


def leanings(
    drawn: Callable[[Camera, Light], np.ndarray], camera: Camera, surface: np.ndarray, normal: np.ndarray
) -> dict[str, np.ndarray]:
    """{axis of the world: (H, W, 3) float16 in [-1, 1]}: what it gives over what comes from everywhere. ``drawn``: the
    radiance (h, w, 3) that a camera sees under one light; ``surface`` (H, W), ``normal`` (H, W, 3) of ``camera``."""
    domes = [
        Light("room", LightKind.DOME, (1.0, 1.0, 1.0), texture=leaning((0.5, 0.5, 0.5), 0.5 * np.eye(3)[k]))
        for k in range(3)
    ]
    fine = coarsely(
        lambda eye: [drawn(eye, light) for light in (DOME, *domes)], camera, COARSER, surface, normal
    )
    return {
        axis: np.clip(2 * share_of(fine[0], part, 0.5) - 1, -MOST, MOST).astype(np.float16)
        for axis, part in zip(AXES, fine[1:], strict=True)
    }


def coarsely(
    drawn: Callable[[Camera], Sequence[np.ndarray]],
    camera: Camera,
    coarser: int,
    surface: np.ndarray,
    normal: np.ndarray,
) -> list[np.ndarray]:
    """(H, W, 3) float32 of each of the images that are ``drawn``, (h, w, 3), on a grid ``coarser`` (odd) times coarser,
    laid onto it surface by surface."""
    width, height = (x // coarser for x in camera.sensor.resolution)
    whole = slice(0, height * coarser), slice(0, width * coarser)
    planes = np.concatenate(list(drawn(cropped(camera, *whole).resized(width))), axis=2)
    fine = finely(np.maximum(planes, 0), surface[whole], normal[whole])
    return [_padded(fine[..., k : k + 3], camera.sensor.resolution) for k in range(0, fine.shape[2], 3)]


def share_of(whole: np.ndarray, part: np.ndarray, otherwise: float = 0.0) -> np.ndarray:
    """part / whole; ``otherwise`` where that is dark."""
    return np.divide(part, whole, out=np.full_like(part, otherwise), where=whole > 0)


def _padded(plane: np.ndarray, resolution: tuple[int, int]) -> np.ndarray:
    """With its last rows and columns once more, where a grid does not go into the sensor's."""
    w, h = resolution
    below, beside = h - plane.shape[0], w - plane.shape[1]
    return np.asarray(cv2.copyMakeBorder(plane, 0, below, 0, beside, cv2.BORDER_REPLICATE))

"""How far two images of the same scene agree, away from the edges where half a pixel decides."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation

from interchange.image import Image, same_quantity
from interchange.problems import BrightfieldError

NORMAL_STEP = np.cos(np.radians(20))  # more between neighbouring pixels is an edge
DEPTH_STEP = 0.02  # relative


@dataclass(frozen=True)
class Agreement:
    """``median``, ``p95``: percentiles of |a - b| / b over the pixels counted; ``bias``: (mean a - mean b) / mean b;
    ``within`` maps a tolerance to the share of pixels that keep it."""

    median: float
    p95: float
    bias: float
    within: dict[float, float]
    pixels: int


def edges(image: Image, width: int = 2) -> np.ndarray:
    """(H, W) bool: pixels up to ``width`` px from a step in object, material, normal or depth.

    Needs the passes object_id, material_id, normal and depth.
    """
    missing = [p for p in ("object_id", "material_id", "normal", "depth") if p not in image.passes]
    if missing:
        raise BrightfieldError(f"Edges are found from passes; the image lacks {', '.join(missing)}.")
    step = np.zeros(image.pixels.shape[:2], bool)
    ids = [image.passes["object_id"], image.passes["material_id"]]
    normal, depth = image.passes["normal"], image.passes["depth"]
    for axis in (0, 1):
        here = tuple(slice(1, None) if a == axis else slice(None) for a in (0, 1))
        there = tuple(slice(None, -1) if a == axis else slice(None) for a in (0, 1))
        change = np.zeros(step[here].shape, bool)
        for plane in ids:
            change |= plane[here] != plane[there]
        with np.errstate(invalid="ignore"):
            change |= np.sum(normal[here] * normal[there], axis=-1) < NORMAL_STEP
            change |= np.abs(depth[here] - depth[there]) > DEPTH_STEP * np.minimum(depth[here], depth[there])
        step[here] |= change
        step[there] |= change
    return np.asarray(binary_dilation(step, iterations=width - 1)) if width > 1 else step


def agreement(
    a: Image, b: Image, use: np.ndarray, tolerances: tuple[float, ...] = (0.01, 0.02), floor: float = 1e-3
) -> Agreement:
    """Compare ``a`` with the reference ``b`` on the pixels ``use`` (H, W) bool, channels averaged.

    Pixels where the reference is below ``floor`` times its 99th percentile are left out: a relative difference
    of two blacks says nothing.
    """
    same_quantity(a, b)
    x, y = (i.pixels.astype(np.float64).mean(axis=-1) for i in (a, b))
    use = use & (y > floor * np.percentile(y, 99))
    if not use.any():
        raise BrightfieldError("No pixel is left to compare: the reference is black where it was asked for.")
    relative = np.abs(x - y)[use] / y[use]
    return Agreement(
        median=float(np.median(relative)),
        p95=float(np.percentile(relative, 95)),
        bias=float(x[use].mean() / y[use].mean() - 1),
        within={t: float((relative <= t).mean()) for t in tolerances},
        pixels=int(use.sum()),
    )

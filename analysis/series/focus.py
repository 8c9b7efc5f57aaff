"""A focus bracket fused to one image that is sharp everywhere, with the frame in which each place is sharpest.

The same energy as for lamps (analysis.series.fusion), the local contrast that of the image's fine structure, and how
far two frames lie apart the steps of focus between them:

    E(k) = - sum_x K(x, k(x)) + λ sum_<x,y> |k(x) - k(y)| / (L - 1)

A lens that is focused elsewhere also magnifies otherwise: frames are first brought onto the middle one by a similarity,
found from frame to frame by the enhanced correlation coefficient. Puente León: Komplementäre Bildfusion zur Inspektion
technischer Oberflächen. 1997. Nayar, Nakagawa: Shape from focus. PAMI 1994. Evangelidis, Psarakis: Parametric image
alignment using enhanced correlation coefficient maximization. PAMI 2008.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from analysis.series.fusion import local_deviation, shares
from interchange.problems import BrightfieldError

LARGEST = 0.25  # change of scale from frame to frame beyond which they show no one view
CELL = 64  # px of a pyramid's coarsest level, from which alignment starts


@dataclass(frozen=True, eq=False)
class Stacked:
    """``image`` (H, W, C); ``frame`` (H, W): which frame is sharpest, between frames where two are alike; ``contrast``
    (L, H, W) in [0, 1]; ``from_frame`` (L, 2, 3): pixel (column, row) of the middle frame to that of each; ``inside``
    (H, W) bool: seen in every frame."""

    image: np.ndarray
    frame: np.ndarray
    contrast: np.ndarray
    from_frame: np.ndarray
    inside: np.ndarray

    @property
    def scales(self) -> np.ndarray:
        """(L,) of each frame over the middle one's."""
        return np.sqrt(np.abs(np.linalg.det(self.from_frame[:, :, :2])))


def stack(
    frames: Sequence[np.ndarray], smoothness: float = 0.5, window: float = 3.0, aligned: bool = False
) -> Stacked:
    """``frames``: (H, W, C) each, in the order of focus. ``aligned``: as they are. Raises BrightfieldError."""
    if len(frames) < 2 or len({f.shape for f in frames}) > 1:
        raise BrightfieldError(
            f"A focus bracket must be two images or more of one size; got {sorted({f.shape for f in frames})}."
        )
    levels = [np.asarray(f, np.float32) for f in frames]
    size = levels[0].shape[:2]
    found = np.tile(np.eye(2, 3), (len(levels), 1, 1)) if aligned else similarities(levels)
    there = np.stack([_brought(np.ones(size, np.float32), t) for t in found]) > 0.999
    levels = [_brought(f, t) for f, t in zip(levels, found, strict=True)]
    contrast = np.stack([fine_contrast(f.mean(axis=2), window) for f in levels]) * there
    top = float(np.quantile(contrast, 0.99))
    if not top > 0:
        raise BrightfieldError("The images must have structure to be fused; each is even.")
    K = np.minimum(contrast / top, 1.0).astype(np.float32)
    k = np.arange(len(levels))
    q = shares(K, np.abs(k[:, None] - k) / (len(k) - 1), smoothness, window)
    image = np.stack(
        [(q * np.stack([f[..., c] for f in levels])).sum(axis=0) for c in range(levels[0].shape[2])], -1
    )
    return Stacked(image, np.tensordot(k.astype(np.float32), q, axes=1), K, found, there.all(axis=0))


def fine_contrast(image: np.ndarray, window: float) -> np.ndarray:
    """(H, W): deviation in a window of what defocus takes first, the structure finer than some 2 px."""
    return local_deviation(image - gaussian_filter(image, 2.0), window)


def similarities(frames: Sequence[np.ndarray]) -> np.ndarray:
    """(L, 2, 3): pixel (column, row) of the middle frame to that of each, chained from neighbour to neighbour, whose
    blur is most alike. Raises BrightfieldError that names frames which do not fit."""
    middle = len(frames) // 2
    grey = [_levelled(f.mean(axis=2)) for f in frames]
    found = np.tile(np.eye(3), (len(frames), 1, 1))
    for order in (range(middle + 1, len(frames)), range(middle - 1, -1, -1)):
        for k in order:
            before = k - 1 if k > middle else k + 1
            step = _step(grey[before], grey[k])
            scale = float(np.sqrt(abs(np.linalg.det(step[:2, :2])))) if step is not None else np.inf
            if step is None or not abs(np.log(scale)) < LARGEST:
                raise BrightfieldError(
                    f"Frames of a focus bracket must be of one view; frame {k} does not fit frame {before}. Align them "
                    "or leave it out."
                )
            found[k] = step @ found[before]
    return found[:, :2]


def _levelled(grey: np.ndarray) -> np.ndarray:
    """Structure over the local brightness, which lamps and stops change."""
    g = grey.astype(np.float32)
    return np.asarray(g / (gaussian_filter(g, 32) + 1e-3 * float(g.max()) + 1e-12), np.float32)


def _step(a: np.ndarray, b: np.ndarray) -> np.ndarray | None:
    """(3, 3) from pixels of ``a`` to those of ``b``, a similarity; None where they do not correlate."""
    import cv2

    depth = max(0, int(np.log2(min(a.shape) / CELL)))
    warp = np.eye(2, 3, dtype=np.float32)
    for level in range(depth, -1, -1):
        small = [
            cv2.resize(x, None, fx=0.5**level, fy=0.5**level, interpolation=cv2.INTER_AREA) for x in (a, b)
        ]
        every = np.ones(small[0].shape, np.uint8)
        scaled = warp.copy()
        scaled[:, 2] *= 0.5**level
        stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-5)
        try:
            _, found = cv2.findTransformECC(small[0], small[1], scaled, cv2.MOTION_AFFINE, stop, every, 5)
        except cv2.error:
            return None
        warp = np.array(found, np.float32)
        warp[:, 2] *= 2.0**level
    return np.vstack([_similar(warp.astype(np.float64), a.shape), [0, 0, 1]])


def _similar(affine: np.ndarray, size: tuple[int, ...]) -> np.ndarray:
    """The similarity nearest to an affine map (2, 3) over an image of ``size`` (H, W)."""
    a, b = (affine[0, 0] + affine[1, 1]) / 2, (affine[1, 0] - affine[0, 1]) / 2
    linear = np.array([[a, -b], [b, a]])
    middle = np.array([(size[1] - 1) / 2, (size[0] - 1) / 2])
    return np.column_stack([linear, affine[:, :2] @ middle + affine[:, 2] - linear @ middle])


def _brought(frame: np.ndarray, there_from_here: np.ndarray) -> np.ndarray:
    """The frame as the middle one sees it, (H, W) or (H, W, C); 0 where it saw nothing."""
    import cv2

    size = frame.shape[1], frame.shape[0]
    if np.array_equal(there_from_here, np.eye(2, 3)):
        return frame
    out = cv2.warpAffine(frame, there_from_here, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    return np.asarray(out).reshape(frame.shape)

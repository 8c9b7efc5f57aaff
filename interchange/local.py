"""What optics do to an image of which a pixel depends on its neighbours alone: steps that are run band by band.

A band is read with the rows around it that all steps need, and every step gives just the rows that the next ones need:
what lies between two steps never leaves the processor's caches.
"""

import threading
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

ROWS = 128  # of a band: less repeats more of what bands share, more leaves the caches

# (plane, its first row, the image's height, plane to fill, its first row, margin); plane_kernels has their layout
Function = Callable[[np.ndarray, int, int, np.ndarray, int, int], None]


class Local(NamedTuple):
    """``reach`` rows above and below, and ``margin`` columns to either side, that a pixel depends on. One function a
    channel, or one for all; None leaves a plane as it is."""

    reach: int
    margin: int
    functions: tuple[Function | None, ...]


class Planes(NamedTuple):
    """One array (r, P + W + P) a channel, all from the image's row ``start`` on."""

    channels: list[np.ndarray]
    pad: int


def banded(pixels: np.ndarray, steps: Sequence[Local], start: int, stop: int) -> Planes:
    """Rows ``start`` to ``stop`` of ``pixels`` (H, W, C) float32 after ``steps``.

    The planes are this thread's own until it asks again.
    """
    from interchange import plane_kernels  # Numba comes with it

    height, width, count = pixels.shape
    left = sum(step.reach for step in steps)
    pad = (max((step.margin for step in steps), default=0) + 15) // 16 * 16
    low, high = max(start - left, 0), min(stop + left, height)
    block = _buffer(0, count * (high - low) * (width + 2 * pad)).reshape(count, high - low, width + 2 * pad)
    plane_kernels.loaded(pixels[low:high], block, pad)
    planes, places, used = list(block), [low] * count, [0] * count
    for step in steps:
        left -= step.reach
        first, end = max(start - left, 0), min(stop + left, height)
        for c in range(count):
            function = step.functions[c % len(step.functions)]
            if function is None:
                continue
            used[c] = 3 - used[c] if used[c] else 1
            into = _buffer(1 + 2 * c + used[c], (end - first) * (width + 2 * pad)).reshape(end - first, -1)
            function(planes[c], places[c], height, into, first, pad)
            planes[c], places[c] = into, first
    return Planes([p[start - at : stop - at] for p, at in zip(planes, places, strict=True)], pad)


_own = threading.local()


def _buffer(which: int, size: int) -> np.ndarray:
    """Memory of this thread, kept from band to band: fresh pages cost more than what is computed in them."""
    from interchange import plane_kernels

    kept: dict[int, np.ndarray] = _own.__dict__.setdefault("kept", {})
    room = size + plane_kernels.SLACK
    if which not in kept or kept[which].size < room:
        kept[which] = plane_kernels.aligned(room)
    return kept[which][:size]

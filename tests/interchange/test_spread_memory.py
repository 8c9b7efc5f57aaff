"""What was in memory before is in no image: buffers are used beyond what was written, with no weight."""

import numpy as np

from interchange.plane_kernels import SLACK
from interchange.varying_psf import over_field

SIZE = (331, 130)


def widening(radius: float) -> np.ndarray:
    """Rays on a ring, wider towards the corner: kernels of several sizes."""
    azimuth = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    return (0.3 + 4 * radius) * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)


def test_numbers_that_are_none_do_not_come_in_from_memory() -> None:
    step = over_field(widening, SIZE, (165.0, 65.0))
    pad = (step.margin + 15) // 16 * 16
    shape = (SIZE[1], SIZE[0] + 2 * pad)
    count = shape[0] * shape[1]
    behind = np.full(count + SLACK, np.nan, np.float32)
    plane = behind[:count].reshape(shape)
    plane[:] = np.random.default_rng(0).random(shape)
    (function,) = step.functions
    for _ in range(20):
        left = [bytearray(b"\xff" * size) for size in range(520, 2000, 4) for _ in range(20)]
        del left
        out = np.zeros(shape, np.float32)
        function(plane, 0, SIZE[1], out, 0, pad)
        assert np.isfinite(out).all()

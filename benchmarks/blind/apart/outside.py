"""Effects that no catalogue names. Who writes the diagnosis does not read this folder."""

from collections.abc import Sequence

import cv2
import numpy as np

from benchmarks.blind.bench import Shot
from benchmarks.blind.cause import Frame, Image, Shape

# ---- optics


def rings(E: Image, a: float, s: Shape, f: Frame) -> Image:
    """Interference between sensor and cover glass: rings about a far point, spaced as the colour is."""
    x, y = f.grid
    path = s["wedge"] * (x * np.cos(s["angle"]) + y * np.sin(s["angle"])) + s["bow"] * (x * x + y * y)
    wave = [np.cos(2 * np.pi * path / length) for length in (0.62, 0.54, 0.46)]
    return E * (1 + a * np.stack(wave, axis=-1))


def mist(E: Image, a: float, s: Shape, f: Frame) -> Image:
    """Breath on a part of the front lens: there light is scattered wide, and a little of it lost."""
    x, y = f.grid
    here = a * np.exp(-(((x - s["x"]) ** 2 + (y - s["y"]) ** 2) / s["size"] ** 2))[..., None]
    wide = cv2.GaussianBlur(E, (0, 0), s["reach"] * f.size[0], borderType=cv2.BORDER_REFLECT)
    return (1 - here) * E + 0.9 * here * wide


# ---- sensor


def transfer(e: Image, t: float, a: float, s: Shape, f: Frame) -> Image:
    """Charge is moved over the chip while light still falls: each column gets some of its mean, at any exposure."""
    return e + a / t * e.mean(axis=0, keepdims=True)


# ---- series


def lag(shots: Sequence[Shot], means: list[Image], a: float, s: Shape) -> list[Image]:
    """The image before, of the same camera, is not wholly cleared away."""
    out, before = [], dict[int, Image]()
    for shot, mean in zip(shots, means, strict=True):
        out.append(mean + a * before[shot.eye] if shot.eye in before else mean)
        before[shot.eye] = mean
    return out


def mains(shots: Sequence[Shot], means: list[Image], a: float, s: Shape) -> list[Image]:
    """Lamps that ripple with the mains while rows are read one after the other: bands, elsewhere in each shot."""
    out = []
    for k, (shot, mean) in enumerate(zip(shots, means, strict=True)):
        row = np.arange(mean.shape[0]) / mean.shape[0]
        depth = a * (0.25 / shot.exposure) ** 0.5  # a longer exposure averages more of it
        band = 1 + depth * np.sin(2 * np.pi * s["periods"] * row + s["phase"] + s["beat"] * k)
        out.append(mean * band[:, None, None])
    return out

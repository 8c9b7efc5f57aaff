"""The steps of the image chain, run one after the other: neighbouring ones that work by pixel on bands of rows."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from typing import NamedTuple

import numpy as np

from interchange.bands import each_band
from interchange.effects import Effect
from interchange.image import Image

Function = Callable[[Image, np.random.Generator | None], Image]


class Step(NamedTuple):
    name: str
    pointwise: bool
    function: Function
    effect: Effect | None = None


def in_order(steps: Sequence[Step], image: Image, rng: np.random.Generator | None) -> Image:
    """The image after all steps."""
    for pointwise, run in groupby(steps, key=lambda s: s.pointwise):
        if pointwise:
            image = replace(image, pixels=in_bands(image, [step.function for step in run], rng))
            continue
        for step in run:
            image = step.function(image, rng)
    return image


def in_bands(image: Image, functions: Sequence[Function], rng: np.random.Generator | None) -> np.ndarray:
    """The functions one after the other on bands of rows, each with its own stream of random numbers."""
    height, width, channels = image.pixels.shape
    seed = rng.integers(0, 1 << 32, 4).tolist() if rng is not None else []

    def run(start: int, stop: int) -> np.ndarray:
        part = Image(image.pixels[start:stop], image.quantity, image.camera, first_row=start)
        stream = np.random.Generator(np.random.SFC64([*seed, start])) if seed else None
        for function in functions:
            part = function(part, stream)
        return part.pixels

    out = np.empty((height, *run(0, 2).shape[1:]), np.float32)  # two rows tell how many channels come out

    def work(start: int, stop: int) -> None:
        out[start:stop] = run(start, stop)

    each_band(work, height, width * channels)
    return out

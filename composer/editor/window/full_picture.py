"""Sensors' images in full, made between the window's frames: drawn piece by piece, exposed in another thread.

    while the window asks:   30 ms of a frame, or a piece, for the next ones; then the exposure, which it polls

A change of the scene drops what was begun. The renderer is one of its own, since an image in the making is its state.
"""

import time
from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import moderngl
import numpy as np

from interchange.camera import Camera, Lens
from interchange.image import Image, Quantity
from interchange.scene import Scene
from interchange.sensor import Sensor
from realtime.renderers.rasterizer import Rasterizer

SHARE = 0.030  # s of a frame of the window
KEPT = 4  # radiance images, of views of one camera and of what was just seen


@dataclass
class Making:
    key: Any
    pieces: Generator[None, None, Image]
    asked: int  # number of the window's frame in which it was asked for last


@dataclass
class FullPictures:
    """What the camera views share. Methods are called by the window's thread."""

    renderer: Rasterizer | None = None
    kept: dict[Any, Image] = field(default_factory=dict)
    making: Making | None = None
    workers: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(1, "exposure"))
    ready: Future[None] | None = None  # done: exposures take no time to load any more
    exposing: Future[Image] | None = None  # the latest

    def busy(self, frame: int) -> bool:
        """Whether the window must go on drawing for something to appear."""
        wanted = self.making is not None and frame - self.making.asked <= 2
        under_way = (self.ready, self.exposing)
        return wanted or any(f is not None and not f.done() for f in under_way)

    def start(self, context: moderngl.Context) -> None:
        """Begin to load what exposures need, beside the window."""
        self.renderer = Rasterizer(context)
        self.ready = self.workers.submit(_warm)

    def exposed(self, work: Callable[[], Image]) -> Future[Image]:
        self.exposing = self.workers.submit(work)
        return self.exposing

    def radiance(self, key: Any, scene: Scene, camera: Camera, samples: int, frame: int) -> Image | None:
        """The image, where it is there; else None, and some of it is made, unless another one is.

        ``frame`` is the number of the window's. BrightfieldError as ``Rasterizer.render``.
        """
        if key in self.kept:
            return self.kept[key]
        assert self.renderer is not None
        if self.making is not None and self.making.key != key:
            if frame - self.making.asked <= 1:
                return None  # the other view's turn
            self.drop()
        if self.making is None:
            shading = "pixel" if samples % 4 == 0 else "sample"
            self.making = Making(
                key, self.renderer.pieces(scene, camera, samples=samples, shading=shading), frame
            )
        self.making.asked = frame
        began = time.perf_counter()
        try:
            while True:
                next(self.making.pieces)
                self.renderer.context.finish()
                if time.perf_counter() - began > SHARE:
                    return None
        except StopIteration as end:
            self.making = None
            while len(self.kept) >= KEPT:
                self.kept.pop(next(iter(self.kept)))
            self.kept[key] = end.value
            return self.kept[key]
        except BaseException:
            self.making = None
            raise

    def drop(self) -> None:
        """What is being made is not wanted any more."""
        if self.making is not None:
            self.making.pieces.close()
            self.making = None


def _warm() -> None:
    """Load and compile what an exposure with noise needs."""
    from interchange.exposure import expose

    sensor = Sensor((8, 8), (5e-6, 5e-6), responsivity=1e6, full_well=1e4, bit_depth=12, read_noise=5)
    camera = Camera("warm", lens=Lens(8e-3), sensor=sensor, t_exp=1e-3)
    image = Image(np.ones((8, 8, 3), np.float32), Quantity.RADIANCE, camera)
    expose(image, rng=np.random.default_rng(0))

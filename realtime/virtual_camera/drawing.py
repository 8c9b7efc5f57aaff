"""The one thread that owns OpenGL contexts: whoever wants a picture hands the scene in and waits.

An OpenGL context belongs to a thread; cameras are read from many. One thread for all of them also keeps two cameras
from fighting over the processors where OpenGL is drawn by software (llvmpipe, which takes all of them for one frame).
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TYPE_CHECKING

from interchange.camera import Camera
from interchange.image import Image
from interchange.scene import Scene

if TYPE_CHECKING:
    from realtime.renderers.rasterizer import Rasterizer

Draw = Callable[[Scene, Camera, Sequence[str]], Image]  # radiance, with the passes asked for


@cache
def _thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, thread_name_prefix="opengl")


class Drawing:
    """A rasteriser of its own, which keeps what it uploaded; ``samples`` a pixel, lit once but at edges."""

    def __init__(self, samples: int = 4) -> None:
        self.samples = samples
        self._renderer: Rasterizer | None = None

    def __call__(self, scene: Scene, camera: Camera, passes: Sequence[str] = ()) -> Image:
        """Radiance. BrightfieldError as ``Rasterizer.render``."""
        return _thread().submit(self._draw, scene, camera, passes).result()

    def _draw(self, scene: Scene, camera: Camera, passes: Sequence[str]) -> Image:
        if self._renderer is None:
            from realtime.renderers.rasterizer import Rasterizer

            self._renderer = Rasterizer()
        return self._renderer.render(scene, camera, passes, samples=self.samples, shading="pixel")

    def release(self) -> None:
        """Give the memory of the GPU back; a later picture starts anew."""
        _thread().submit(self._release).result()

    def _release(self) -> None:
        if self._renderer is not None:
            self._renderer.release()
            self._renderer = None

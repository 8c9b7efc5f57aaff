"""Images that grow on the GPU: float sums that passes add to."""

from dataclasses import dataclass

import moderngl
import numpy as np


@dataclass(eq=False)
class Target:
    """(H, W, 4) float32, the first row the image's top."""

    texture: moderngl.Texture
    framebuffer: moderngl.Framebuffer

    def read(self) -> np.ndarray:
        """(H, W, 3) float32."""
        width, height = self.texture.size
        data = self.framebuffer.read(components=3, dtype="f4")
        return np.frombuffer(data, np.float32).reshape(height, width, 3)

    def release(self) -> None:
        self.framebuffer.release()
        self.texture.release()


class Targets:
    """Targets by name, kept from one image to the next."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self._kept: dict[str, Target] = {}

    def get(self, name: str, size: tuple[int, int]) -> Target:
        """An empty target."""
        target = self._kept.get(name)
        if target is None or target.texture.size != size:
            if target is not None:
                target.release()
            texture = self.context.texture(size, 4, dtype="f4")
            target = self._kept[name] = Target(texture, self.context.framebuffer([texture]))
        target.framebuffer.clear()
        return target

    def keep(self, names: set[str]) -> None:
        """Release all others."""
        for name in set(self._kept) - names:
            self._kept.pop(name).release()

    def release(self) -> None:
        self.keep(set())

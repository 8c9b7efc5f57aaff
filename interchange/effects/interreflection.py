"""Light that met another surface first, over what the simulation has of it, and what its renderer does not draw.

L' = L_direct + scale L_indirect + added L_undrawn
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.effects.base import Effect, Stage
from interchange.image import Image
from interchange.parameter import parameter
from interchange.problems import BrightfieldError


@dataclass(frozen=True)
class Interreflection(Effect):
    """On a rendering, with its passes ``indirect``, part of its pixels, and ``undrawn``, none of them: which share of
    those it has, a scene has no word for."""

    stage = Stage.SCENE
    order = 90
    source = (
        "Nayar, Krishnan, Grossberg, Raskar: Fast separation of direct and global components. SIGGRAPH 2006."
    )
    identified_by = "Colour bleeds near contacts and into corners, and scales with the lamps."
    confused_with = ("ambient_light", "veiling_glare", "shadow")
    separated_by = "the part alone on a black ground"

    scale: float = parameter(1.0, "s", "1", 0, 10, "indirect light over what the simulation has")
    added: float = parameter(
        0.0, "a", "1", 0, 10, "indirect light the renderer does not draw, of what paths have"
    )

    def on_radiance(self, image: Image, target: str = "") -> Image:
        if not self.is_there:
            return image
        pixels = image.pixels
        for name, more in (("indirect", self.scale - 1), ("undrawn", self.added)):
            if not more:
                continue
            if name not in image.passes:
                raise BrightfieldError(f"Interreflection needs a rendering with the pass {name}.")
            pixels = pixels + np.float32(more) * image.passes[name]
        return replace(image, pixels=np.asarray(pixels, np.float32))

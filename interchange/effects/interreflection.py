"""Light that met another surface first, over what the simulation has of it: L' = L_direct + scale L_indirect."""

from dataclasses import dataclass, replace

import numpy as np

from interchange.effects.base import Effect, Stage
from interchange.image import Image
from interchange.parameter import parameter
from interchange.problems import BrightfieldError


@dataclass(frozen=True)
class Interreflection(Effect):
    """On a rendering, with its pass ``indirect``: which share of it a scene has no word for."""

    stage = Stage.SCENE
    order = 90
    source = (
        "Nayar, Krishnan, Grossberg, Raskar: Fast separation of direct and global components. SIGGRAPH 2006."
    )
    identified_by = "Colour bleeds near contacts and into corners, and scales with the lamps."
    confused_with = ("ambient_light", "veiling_glare", "shadow")
    separated_by = "the part alone on a black ground"

    scale: float = parameter(1.0, "s", "1", 0, 10, "indirect light over what the simulation has")

    def on_radiance(self, image: Image, target: str = "") -> Image:
        if not self.is_there:
            return image
        if "indirect" not in image.passes:
            raise BrightfieldError("Interreflection needs a rendering with the pass indirect.")
        pixels = image.pixels + np.float32(self.scale - 1) * image.passes["indirect"]
        return replace(image, pixels=np.asarray(pixels, np.float32))

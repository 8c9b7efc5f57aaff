"""A lamp has another colour than the scene says; the sum of its channels is the same.

I_R' = I_R + r Ī,  I_B' = I_B + b Ī,  I_G' = I_G - (r + b) Ī,    Ī the mean of the channels
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_lights
from interchange.light import Light
from interchange.parameter import parameter
from interchange.problems import BrightfieldError
from interchange.scene import Scene


@dataclass(frozen=True)
class LightSpectrum(Effect):
    stage = Stage.SCENE
    order = 55
    source = "CIE 015:2018: Colorimetry, 4th ed.: illuminants and their relative spectral power."
    identified_by = (
        "What one lamp lights has a cast, alike on all materials; what other lamps light has none."
    )
    confused_with = ("white_balance", "albedo", "color_crosstalk")
    separated_by = "a grey card under each lamp alone"

    red: float = parameter(0.0, "r", "1", -3, 3, "more red, over the mean of the channels")
    blue: float = parameter(0.0, "b", "1", -3, 3, "more blue, over the mean of the channels")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene

        def change(light: Light) -> Light:
            own = np.asarray(light.intensity)
            r, g, b = (own + np.array([self.red, -self.red - self.blue, self.blue]) * own.mean()).tolist()
            if min(r, g, b) < 0:
                raise BrightfieldError(
                    f"A lamp's channels must not be negative; {light.name} would have ({r:g}, {g:g}, {b:g})."
                )
            return replace(light, intensity=(r, g, b))

        return with_lights(scene, target, change)

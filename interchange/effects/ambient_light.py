"""Light that comes from everywhere alike, beside the scene's lamps: a dome of one radiance a channel.

L_R = L + r,  L_G = L - r - b,  L_B = L + b
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from interchange.effects.base import Effect, Stage
from interchange.light import Light, LightKind
from interchange.parameter import parameter
from interchange.problems import BrightfieldError
from interchange.scene import Scene

NAME = "/AmbientLight"
ROUNDING = 1e-12  # of the radiance


@dataclass(frozen=True)
class AmbientLight(Effect):
    stage = Stage.SCENE
    order = 80
    source = "Landis: Production-ready global illumination. SIGGRAPH course 16, 2002 (ambient occlusion)."
    identified_by = "It is there with all lamps off, fills shadows, and is weaker in corners."
    confused_with = ("black_level", "veiling_glare", "interreflection")
    separated_by = "one capture with all lamps off"

    L: float = parameter(0.0, "L", "W/(m^2 sr)", 0, 1e9, "radiance, mean of the channels")
    red: float = parameter(0.0, "r", "W/(m^2 sr)", -1e9, 1e9, "more red")
    blue: float = parameter(0.0, "b", "W/(m^2 sr)", -1e9, 1e9, "more blue")

    @property
    def channels(self) -> tuple[float, float, float]:
        return self.L + self.red, self.L - self.red - self.blue, self.L + self.blue

    @classmethod
    def within(cls, values: Mapping[str, float]) -> dict[str, float]:
        """No channel gives less than nothing, as noise may have it of one that gives none."""
        given = super().within(values)
        if given.keys() - {"L"}:
            r, g, b = (max(x, 0.0) for x in cls(**given).channels)
            mean = (r + g + b) / 3
            given = {"L": mean, "red": r - mean, "blue": b - mean}
        return given

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        if min(self.channels) < -ROUNDING * self.L:
            r, g, b = self.channels
            raise BrightfieldError(
                f"Ambient light's channels must not be negative; they would be ({r:g}, {g:g}, {b:g})."
            )
        r, g, b = (max(x, 0.0) for x in self.channels)
        return replace(scene, lights=(*scene.lights, Light(NAME, LightKind.DOME, (r, g, b))))

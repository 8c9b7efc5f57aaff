"""Light that comes from everywhere alike, beside the scene's lamps: a dome of one radiance a channel.

L_R = L + r,  L_G = L - r - b,  L_B = L + b
"""

from dataclasses import dataclass, replace

from interchange.effects.base import Effect, Stage
from interchange.light import Light, LightKind
from interchange.parameter import parameter
from interchange.problems import BrightfieldError
from interchange.scene import Scene

NAME = "/AmbientLight"


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

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        r, g, b = self.L + self.red, self.L - self.red - self.blue, self.L + self.blue
        if min(r, g, b) < 0:
            raise BrightfieldError(
                f"Ambient light's channels must not be negative; they would be ({r:g}, {g:g}, {b:g})."
            )
        dome = Light(NAME, LightKind.DOME, (r, g, b))
        return replace(scene, lights=(*scene.lights, dome))

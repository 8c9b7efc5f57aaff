"""Light that comes from everywhere alike, beside the scene's lamps: a dome of one radiance a channel."""

from dataclasses import dataclass, replace

from interchange.effects.base import Effect, Stage
from interchange.light import Light, LightKind
from interchange.parameter import parameter
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

    R: float = parameter(0.0, "L_R", "W/(m^2 sr)", 0, 1e9, "radiance of red")
    G: float = parameter(0.0, "L_G", "W/(m^2 sr)", 0, 1e9, "radiance of green")
    B: float = parameter(0.0, "L_B", "W/(m^2 sr)", 0, 1e9, "radiance of blue")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        dome = Light(NAME, LightKind.DOME, (self.R, self.G, self.B))
        return replace(scene, lights=(*scene.lights, dome))

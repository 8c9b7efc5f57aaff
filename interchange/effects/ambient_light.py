"""Light from all around, beside the scene's lamps: a dome of one radiance a channel, brighter to one side.

L_R(w) = L + r + g · w,  L_G(w) = L - r - b + g · w,  L_B(w) = L + b + g · w,  w the direction that it comes from

A room is brighter above than below and on the side of its windows. What a matte surface gets from all around has
99 % of its energy in spherical harmonics up to the second order, most of it in the first two.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from interchange.effects.base import Effect, Stage
from interchange.light import Light, LightKind, latlong_direction
from interchange.material import Texture, Wrap
from interchange.parameter import parameter
from interchange.problems import BrightfieldError
from interchange.scene import Scene

NAME = "/AmbientLight"
ROUNDING = 1e-12  # of the radiance
ROWS, COLUMNS = 64, 128  # of a dome that is brighter to one side
AXES = ("x", "y", "z")
TINTS = ("red", "blue")


@dataclass(frozen=True)
class AmbientLight(Effect):
    stage = Stage.SCENE
    order = 80
    source = (
        "Landis: Production-ready global illumination. SIGGRAPH course 16, 2002 (ambient occlusion); Ramamoorthi, "
        "Hanrahan: On the relationship between radiance and irradiance. JOSA A 18(10), 2001 (orders of light)."
    )
    identified_by = "It is there with all lamps off, fills shadows, and is weaker in corners."
    confused_with = ("black_level", "veiling_glare", "interreflection")
    separated_by = "a capture with all lamps off, and one with the lens covered"

    L: float = parameter(
        0.0, "L", "W/(m^2 sr)", 0, 1e9, "radiance, mean of the channels and of all directions"
    )
    red: float = parameter(0.0, "r", "W/(m^2 sr)", -1e9, 1e9, "more red")
    blue: float = parameter(0.0, "b", "W/(m^2 sr)", -1e9, 1e9, "more blue")
    x: float = parameter(0.0, "g_x", "W/(m^2 sr)", -1e9, 1e9, "more of it from the world's +x, less from -x")
    y: float = parameter(0.0, "g_y", "W/(m^2 sr)", -1e9, 1e9, "the same along y")
    z: float = parameter(0.0, "g_z", "W/(m^2 sr)", -1e9, 1e9, "the same along z")

    @property
    def channels(self) -> tuple[float, float, float]:
        return self.L + self.red, self.L - self.red - self.blue, self.L + self.blue

    @property
    def toward(self) -> np.ndarray:
        """(3,) W/(m² sr): where it is brightest, and by how much more than on average."""
        return np.array([self.x, self.y, self.z])

    @classmethod
    def within(cls, values: Mapping[str, float]) -> dict[str, float]:
        """No channel and no direction gives less than nothing, as noise may have it of one that gives none."""
        given = super().within(values)
        if given.keys() & set(TINTS):
            r, g, b = (max(x, 0.0) for x in cls(**given).channels)
            mean = (r + g + b) / 3
            given |= {"L": mean, "red": r - mean, "blue": b - mean}
        if given.keys() & set(AXES):
            light = cls(**given)
            steep = float(np.linalg.norm(light.toward))
            most = max(min(light.channels), 0.0)
            if steep > most:
                given |= {a: given.get(a, 0.0) * most / steep for a in AXES}
        return given

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        steep = float(np.linalg.norm(self.toward))
        if min(self.channels) - steep < -ROUNDING * self.L:
            r, g, b = self.channels
            raise BrightfieldError(
                f"Ambient light's channels must not be negative; they would be ({r:g}, {g:g}, {b:g}), "
                f"and {steep:g} less on the darkest side."
            )
        r, g, b = (max(x, 0.0) for x in self.channels)
        dome = Light(NAME, LightKind.DOME, (r, g, b))
        if steep > 0:
            dome = replace(dome, intensity=(1.0, 1.0, 1.0), texture=leaning((r, g, b), self.toward))
        return replace(scene, lights=(*scene.lights, dome))


def leaning(mean: tuple[float, float, float], toward: np.ndarray) -> Texture:
    """A dome's map of radiance: ``mean`` of each channel, and ``toward`` (3,) · w more in the direction w."""
    rows, columns = np.meshgrid(
        (np.arange(ROWS) + 0.5) / ROWS, (np.arange(COLUMNS) + 0.5) / COLUMNS, indexing="ij"
    )
    more = latlong_direction(np.stack([columns, 1 - rows], axis=-1)) @ toward
    radiance = np.maximum(np.asarray(mean) + more[..., None], 0)
    return Texture(radiance.astype(np.float32), (Wrap.REPEAT, Wrap.CLAMP))

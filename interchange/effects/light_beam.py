"""A lamp shines less to the side than the scene says: I(θ) = I(0) |cos θ|^m exp(q (1 - |cos θ|)²) about its axis.

A die under a lens is no power of a cosine; q says what one leaves further out.

A lamp without a beam of its own is turned to the scene's middle.
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_lights
from interchange.light import Light, LightKind, Profile
from interchange.parameter import parameter
from interchange.problems import BrightfieldError
from interchange.scene import Scene

STEPS = 361  # angles of a profile


@dataclass(frozen=True)
class LightBeam(Effect):
    """Distant light and domes have no beam and stay. m < 0 is a lamp that is brighter to the side."""

    stage = Stage.SCENE
    order = 60
    source = "Moreno, Sun: Modeling the radiation pattern of LEDs. Optics Express 16(3), 2008."
    identified_by = "A fall-off that is fixed to the lamp: it stays on the part when the camera moves."
    confused_with = ("vignetting", "light_position", "albedo")
    separated_by = "the same lamp from another pose of the camera, a flat plate in view"

    m: float = parameter(0.0, "m", "1", -0.9, 1e3, "exponent of the cosine, beside the lamp's own")
    q: float = parameter(
        0.0, "q", "1", -100, 10, "logarithm of how much more there is at right angles, beside m"
    )

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        middle = scene.bounds.mean(axis=0)

        def change(light: Light) -> Light:
            if light.kind in (LightKind.DISTANT, LightKind.DOME):
                return light
            axes = beam_axes(light, middle)
            there = light.world_from_light.copy()
            there[:3, :3] = axes
            light = replace(light, world_from_light=there, focus=light.focus + self.m)
            return light if self.q == 0 else replace(light, profile=profiles(light))

        tables: dict[int, Profile] = {}

        def profiles(light: Light) -> Profile:  # lamps that share one go on sharing it
            if light.projector is not None:
                raise BrightfieldError(f"What {light.name} projects would have to be another picture.")
            if light.profile is not None and light.profile_angle_scale != 0:
                raise BrightfieldError(
                    f"The profile of {light.name} is stretched, and its angles are not the beam's."
                )
            key = id(light.profile)
            if key not in tables:
                tables[key] = self._over(light.profile)
            return tables[key]

        return with_lights(scene, target, change)

    def _over(self, own: Profile | None) -> Profile:
        """A profile's own angles and, between them, enough for what bends there."""
        if own is None:
            own = Profile(np.zeros(1), np.array([0.0, np.pi]), np.ones((1, 2)))
        fine = np.linspace(0, np.pi, STEPS)
        low, high = own.vertical[0], own.vertical[-1]
        vertical = np.unique(np.concatenate([own.vertical, fine[(fine > low) & (fine < high)]]))
        candela = np.stack([own.evaluate(vertical, np.full(len(vertical), h)) for h in own.horizontal])
        return replace(
            own, vertical=vertical, candela=candela * further_out(np.cos(vertical), self.q), file=""
        )


def further_out(cos: np.ndarray, q: float) -> np.ndarray:
    """What q makes of the light at an angle with this cosine to the lamp's axis, over what there is."""
    return np.asarray(np.exp(q * np.square(1 - np.abs(cos))))


def beam_axes(light: Light, middle: np.ndarray) -> np.ndarray:
    """(3, 3): the lamp's axes in the world, z against its beam, which points to ``middle`` (3,) m where a lamp shines
    everywhere alike."""
    own = light.kind in (LightKind.DISK, LightKind.RECT, LightKind.CYLINDER) or light.focus != 0
    if own or light.cone_angle < np.pi or light.beam is not None:
        return light.world_from_light[:3, :3]
    z = light.world_from_light[:3, 3] - middle
    z = z / max(float(np.linalg.norm(z)), 1e-12)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)

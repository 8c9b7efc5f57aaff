"""A material's body colour is another than the scene says: ρ' = scale ρ a channel; its lobes stay."""

from dataclasses import dataclass, replace

import numpy as np

from interchange.brdf.lobes import with_body
from interchange.effects.base import Effect, Stage
from interchange.effects.parts import scaled, with_materials
from interchange.material import Material
from interchange.parameter import parameter
from interchange.problems import BrightfieldError
from interchange.scene import Scene


@dataclass(frozen=True)
class Albedo(Effect):
    """Raises ParameterError where an albedo would exceed 1."""

    stage = Stage.MATERIAL
    order = 10
    source = "Nicodemus et al.: Geometrical considerations and nomenclature for reflectance. NBS 1977."
    identified_by = "One material is brighter by one factor a channel, under every lamp and in every pose."
    confused_with = ("light_intensity", "light_spectrum", "color_crosstalk", "exposure", "texture")
    separated_by = "the same material under a second lamp and with a reference tile in view"

    R: float = parameter(1.0, "s_R", "1", 0, 100, "albedo over the one that the scene gives, red")
    G: float = parameter(1.0, "s_G", "1", 0, 100, "albedo over the one that the scene gives, green")
    B: float = parameter(1.0, "s_B", "1", 0, 100, "albedo over the one that the scene gives, blue")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        return with_materials(scene, target, self._painted) if self.is_there else scene

    def _painted(self, material: Material) -> Material:
        factor, name = np.array([self.R, self.G, self.B]), material.brdf.matte
        if not name:
            kind = type(material.brdf).__name__
            raise BrightfieldError(f"An albedo needs a BRDF with a body colour; {material.name} has {kind}.")
        if name in material.maps:
            return replace(material, maps={**material.maps, name: scaled(material.maps[name], factor)})
        return replace(material, brdf=with_body(material.brdf, factor))

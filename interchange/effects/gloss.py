"""A material's highlights are wider or narrower, stronger or weaker than the scene says.

width: what the parameter of its lobes' width says (α of a microfacet model, n^(-1/2) of a cosine lobe), over the
scene's; the light of a lobe stays the same. level: the strength of all lobes, over the scene's.
"""

from dataclasses import dataclass

from interchange.brdf.lobes import has_lobes
from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_materials
from interchange.effects.shine import shone
from interchange.material import Material
from interchange.parameter import parameter
from interchange.problems import BrightfieldError
from interchange.scene import Scene


@dataclass(frozen=True)
class Gloss(Effect):
    """Materials without lobes stay, unless one is the target. Raises ParameterError where a model's bounds end."""

    stage = Stage.MATERIAL
    order = 20
    source = "Walter et al.: Microfacet models for refraction through rough surfaces. EGSR 2007."
    identified_by = "In the highlights of one material the centre is darker and a ring around it brighter."
    confused_with = ("light_size", "anisotropy", "defocus", "albedo")
    separated_by = (
        "the same material under a lamp whose highlight lies on a flat part, and under a smaller lamp"
    )

    width: float = parameter(1.0, "w", "1", 0.05, 20, "width of the lobes over the one that the scene gives")
    level: float = parameter(1.0, "l", "1", 0, 20, "strength of the lobes over the one that the scene gives")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene

        def change(material: Material) -> Material:
            if not has_lobes(material.brdf):
                if target:
                    kind = type(material.brdf).__name__
                    raise BrightfieldError(f"Gloss needs a BRDF with lobes; {material.name} has {kind}.")
                return material
            return shone(material, self.width, self.width, self.level)

        return with_materials(scene, target, change)

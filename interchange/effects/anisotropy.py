"""A material's highlights are longer one way than the scene says: ratio = width along the tangent over that across it.

Both widths change by the root of the ratio, so the lobe keeps its light. A model that has one width for both ways is
given an elliptic lobe of Ward's in exchange for a round one:  f' = f + ρ (ward(α √q, α / √q) - ward(α, α)).

A generalized cosine lobe may be anisotropic by its own weights:  C' = (Cx - split / 2, Cy + split / 2, Cz).
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lobes import has_lobes
from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_materials
from interchange.effects.shine import shone, stretched
from interchange.material import Material
from interchange.parameter import parameter
from interchange.problems import BrightfieldError
from interchange.scene import Scene


@dataclass(frozen=True)
class Anisotropy(Effect):
    """Materials without lobes stay, unless one is the target."""

    stage = Stage.MATERIAL
    order = 30
    source = "Ward: Measuring and modeling anisotropic reflection. SIGGRAPH 1992."
    identified_by = "Highlights of one material are stretched along a direction that turns with the part."
    confused_with = ("gloss", "light_size", "motion_blur")
    separated_by = "the same part turned by 90 degrees"

    ratio: float = parameter(1.0, "q", "1", 0.05, 20, "width of the lobes along over across the tangent")
    split: float = parameter(0.0, "ΔC", "1", -1, 1, "of Lafortune's lobes: Cy less Cx, over what it was")

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        root = float(np.sqrt(self.ratio))

        def change(material: Material) -> Material:
            if not has_lobes(material.brdf):
                if target:
                    kind = type(material.brdf).__name__
                    raise BrightfieldError(f"Anisotropy needs a BRDF with lobes; {material.name} has {kind}.")
                return material
            if self.split and isinstance(material.brdf, Lafortune):
                half = self.split / 2
                lobes = tuple((float(c[0] - half), float(c[1] + half), float(c[2])) for c in material.brdf.C)
                material = replace(material, brdf=replace(material.brdf, C=lobes))
            if self.ratio == 1:
                return material
            if any(along != across for along, across in material.brdf.width.values()):
                return shone(material, root, 1 / root, 1.0)
            return stretched(material, self.ratio)

        return with_materials(scene, target, change)

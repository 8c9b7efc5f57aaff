"""A material's highlights are longer one way than the scene says: ratio = width along the tangent over that across it.

Both widths change by the root of the ratio, so the lobe keeps its light. A model that has one width for both ways is
given an elliptic lobe of Ward's in exchange for a round one:  f' = f + ρ (ward(α √q, α / √q) - ward(α, α)).

A generalized cosine lobe may be anisotropic by its own weights:  C' = (Cx - split / 2, Cy + split / 2, Cz).

A grain runs along the tangent, or any other way: what is stretched along a direction φ from it is so by cos 2φ along
the tangent and by sin 2φ along the diagonal, which `diagonal` (of ln ratio) and `cross` (of split) are. A lobe that is
long one way already has none.
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lobes import has_lobes
from interchange.effects.base import Effect, Stage
from interchange.effects.parts import once, with_materials
from interchange.effects.shine import shone, stretched
from interchange.material import Material
from interchange.mesh import Grained, Mesh
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

    diagonal: float = parameter(0.0, "ln q_45", "1", -3, 3, "the same of both diagonals, its logarithm")
    cross: float = parameter(0.0, "ΔC_45", "1", -1, 1, "the same of both diagonals")

    @property
    def grain(self) -> float:
        """rad, from the tangent to where ``straight`` has it."""
        if not (self.diagonal or self.cross):
            return 0.0
        along, aside = (self.split, self.cross) if self.cross else (float(np.log(self.ratio)), self.diagonal)
        return 0.5 * float(np.arctan2(aside, along))

    @property
    def straight(self) -> "Anisotropy":
        """The same, along the tangent."""
        if self.cross:
            return replace(self, split=float(np.hypot(self.split, self.cross)), cross=0.0, diagonal=0.0)
        if self.diagonal:
            return replace(
                self, ratio=float(np.exp(np.hypot(np.log(self.ratio), self.diagonal))), diagonal=0.0
            )
        return self

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene
        changed = with_materials(scene, target, lambda material: self.straight._on(material, target))
        if not self.grain:
            return changed
        turned: dict[int, Mesh] = {}
        bodies = [
            b if b.material is a.material else replace(b, mesh=once(turned, b.mesh, self._grained))
            for a, b in zip(scene.bodies, changed.bodies, strict=True)
        ]
        return replace(changed, bodies=tuple(bodies))

    def _grained(self, mesh: Mesh) -> Mesh:
        return Grained(mesh.vertices, mesh.faces, mesh.normals, mesh.uv, self.grain)

    def _on(self, material: Material, target: str) -> Material:
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
            root = float(np.sqrt(self.ratio))
            return shone(material, root, 1 / root, 1.0)
        return stretched(material, self.ratio)

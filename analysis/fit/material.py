"""A fitted BRDF as a USD material that any stage can refer to and bind."""

from pathlib import Path

from interchange.brdf.base import Brdf
from interchange.formats.document import Document
from interchange.formats.usd_author import author_material, free_path, new_stage
from interchange.material import Material


def write_material(path: Path, name: str, brdf: Brdf) -> None:
    """Write one Material, the file's default prim: ``references = @material.usda@`` brings it into a scene.

    Written beside and renamed. Raises FileError.
    """
    stage = new_stage(1.0)
    stage.RemovePrim("/World")
    made = author_material(stage, free_path(stage, "", name), Material(name, brdf))
    stage.SetDefaultPrim(made.GetPrim())
    Document(stage, path).save(path)

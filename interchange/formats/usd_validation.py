"""USD's own validators over a stage, once they know the BRDFs of the catalogue.

A shader's ``info:id`` must be registered; our models are, each with its declared inputs and the GLSL that its
formula traces to.
"""

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from interchange import shader
from interchange.brdf import BY_NAME
from interchange.formats.usd_author import TYPES
from interchange.parameter import parameters, settings, tables
from interchange.problems import Problem, Severity, Where

_FOLDER = tempfile.TemporaryDirectory(prefix="brightfield-shaders-")  # goes with the process


@cache
def _validators() -> Any:
    from pxr import Sdf, Sdr, Usd, UsdShade, UsdValidation

    folder = Path(_FOLDER.name)
    definitions = Usd.Stage.CreateNew(str(folder / "shaderDefs.usda"))
    results = []
    for name, model in BY_NAME.items():
        if name == "UsdPreviewSurface":
            continue  # USD registers its own
        source = folder / f"{name}.glslfx"
        source.write_text(shader.function(model(), shader.GLSL, name))
        prim = UsdShade.Shader.Define(definitions, f"/{name}")
        prim.CreateIdAttr(name)
        prim.SetSourceAsset(Sdf.AssetPath(str(source)), "glslfx")
        for word, about in parameters(model).items():
            prim.CreateInput(word, TYPES[about.kind, about.per_lobe])
        for word in settings(model):
            prim.CreateInput(word, Sdf.ValueTypeNames.Int)
        for word in tables(model):
            prim.CreateInput(word, Sdf.ValueTypeNames.Color3fArray)
        prim.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        results += UsdShade.ShaderDefUtils.GetDiscoveryResults(prim, str(folder / "shaderDefs.usda"))
    definitions.GetRootLayer().Save()
    for result in results:
        Sdr.Registry().AddDiscoveryResult(result)
    registry = UsdValidation.ValidationRegistry()
    return UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())


def validate(stage: Any) -> list[Problem]:
    """What the validators that ship with usd-core say of a stage; empty for a clean one."""
    file = stage.GetRootLayer().realPath or stage.GetRootLayer().identifier
    found = []
    for error in _validators().Validate(stage):
        sites = error.GetSites()
        prim = str(sites[0].GetPrim().GetPath()) if sites and sites[0].IsPrim() else ""
        severity = Severity.ERROR if "Error" in str(error.GetType()) else Severity.NOTE
        found.append(Problem(f"{error.GetName()}: {error.GetMessage()}", Where(file, prim), severity))
    return found

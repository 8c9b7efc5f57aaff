"""Textures that a scene got: their files, and the texture coordinates of the bodies that they are laid on.

Coordinates are written where they follow from where a point is, as those of ``interchange.effects.texture`` do; then
they hold for the prim's own points, whichever of them a renderer's mesh has twice.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade, Vt

from interchange.formats import exr
from interchange.formats.usd_author import author_texture
from interchange.image import Image
from interchange.material import Texture
from interchange.mesh import Mesh
from interchange.scene import Scene

AFFINE = 1e-5  # of texture coordinates, that rounding leaves
Lose = Callable[[str, str], None]


def only_laid(before: Mesh, after: Mesh) -> bool:
    """Whether the same mesh has other texture coordinates, and nothing else."""
    return (
        before.vertices is after.vertices
        and before.faces is after.faces
        and before.normals is after.normals
        and after.uv is not None
    )


def lay(stage: Usd.Stage, old: Scene, new: Scene, lose: Lose) -> set[str]:
    """Texture coordinates of all bodies that got some; returns the materials that cannot be textured, as a body of
    theirs has no place for them."""
    left = set()
    names = [b.name for b in new.bodies]
    for body in new.bodies:
        before = [b.mesh for b in old.bodies if b.name == body.name and b.mesh is not body.mesh]
        if not any(only_laid(mesh, body.mesh) for mesh in before):
            continue
        why = "It is of several parts, each with texture coordinates of its own."
        if names.count(body.name) == 1:
            why = _laid(stage, body.name, body.mesh)
        if why:
            lose(body.name, why)
            left.add(body.material.name)
    return left


def _laid(stage: Usd.Stage, name: str, mesh: Mesh) -> str:
    """Why not, or "" where it is done."""
    prim = stage.GetPrimAtPath(name)
    if not prim or not prim.IsA(UsdGeom.Mesh) or prim.IsInstanceProxy():
        return "It has no mesh of its own in the file, on which a texture could be laid."
    if UsdGeom.PrimvarsAPI(prim).HasPrimvar("st"):
        return "It has texture coordinates already, which another texture may need."
    at, wanted = np.c_[mesh.vertices, np.ones(len(mesh.vertices))], np.asarray(mesh.uv)
    affine = np.linalg.lstsq(at, wanted, rcond=None)[0]
    if np.abs(at @ affine - wanted).max(initial=0.0) > AFFINE:
        return "Its texture coordinates do not follow from where its points are."
    points = np.asarray(UsdGeom.Mesh(prim).GetPointsAttr().Get(), float)
    points = points * UsdGeom.GetStageMetersPerUnit(stage)
    st = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    )
    uv = np.c_[points, np.ones(len(points))] @ affine
    st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uv, np.float32)))
    return ""


def author_textures(
    shader: UsdShade.Shader,
    material: str,
    textures: Mapping[str, Texture],
    beside: Path,
    known: Sequence[str],
) -> str:
    """Each texture in a file of its own, whose name begins with ``beside``, for an input of ``shader``, which has the
    inputs ``known``. Why not, or ""."""
    if strange := [name for name in textures if name not in known]:
        return f"Its {strange[0]} is of a part, whose textures are not written."
    for name, texture in textures.items():
        author_texture(shader, name, in_a_file(texture, material, name, beside))
    return ""


def in_a_file(texture: Texture, of: str, name: str, beside: Path) -> Texture:
    """The texture, written to a file whose name begins with ``beside`` and tells what it is ``of``."""
    path = named(beside, of, f"_{name}.exr")
    exr.write(path, Image(texture.pixels))
    return replace(texture, file=path.name)


def named(beside: Path, of: str, end: str) -> Path:
    """The file beside a stage for the prim ``of``: its name begins with ``beside``'s."""
    word = re.sub(r"\W+", "_", of.strip("/"))
    return beside.with_name(f"{beside.name}_{word}{end}")

"""Edits of a stage's tree: bring in, add, move, bind, hide, copy, rename and delete prims.

All in metres and z up, at the border to the stage's own unit and axes. Raises BrightfieldError where an edit cannot be.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade

from interchange.camera import Camera
from interchange.formats.document import Document
from interchange.formats.usd_author import (
    author_camera,
    author_light,
    author_material,
    author_mesh,
    free_path,
    stage_from_world,
)
from interchange.formats.usd_values import matrix
from interchange.frames import camera_from_gl, z_up_from_y_up
from interchange.light import Light
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.problems import BrightfieldError

IMPORT = "/__import"
EDIT = "edit"  # suffix of the transform op that stands before ops which cannot be rewritten


def prim_at(stage: Usd.Stage, path: str) -> Any:
    """BrightfieldError where nothing is there."""
    prim = stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
    if not prim or prim.IsPseudoRoot():
        raise BrightfieldError(f'The scene has no prim "{path}".')
    return prim


def parent_path(stage: Usd.Stage) -> str:
    """Where new things go: below the default prim, else ``/World``, which is made if need be."""
    prim = stage.GetDefaultPrim()
    if prim and prim.IsA(UsdGeom.Xformable) and not prim.IsA(UsdGeom.Gprim) and not prim.IsInstance():
        return str(prim.GetPath())
    world = UsdGeom.Xform.Define(stage, "/World").GetPrim()
    if not prim:
        stage.SetDefaultPrim(world)
    return "/World"


def add_light(stage: Usd.Stage, light: Light) -> str:
    """Returns the new prim's path, as near to the light's name as is free."""
    path = free_path(stage, parent_path(stage), light.name)
    author_light(stage, path, light)
    place(stage, path, light.world_from_light, None)
    return path


def add_camera(stage: Usd.Stage, camera: Camera) -> str:
    path = free_path(stage, parent_path(stage), camera.name)
    author_camera(stage, path, camera)
    place(stage, path, camera.world_from_camera @ camera_from_gl, None)
    return path


def add_material(stage: Usd.Stage, material: Material) -> str:
    scope = f"{parent_path(stage)}/Materials"
    if not stage.GetPrimAtPath(scope):
        UsdGeom.Scope.Define(stage, scope)
    path = free_path(stage, scope, material.name)
    author_material(stage, path, material)
    return path


def add_mesh(stage: Usd.Stage, name: str, mesh: Mesh, position: Sequence[float]) -> str:
    path = free_path(stage, parent_path(stage), name)
    author_mesh(stage, path, mesh)
    pose = np.eye(4)
    pose[:3, 3] = position
    place(stage, path, pose, None)
    return path


def bind_material(stage: Usd.Stage, path: str, material: str) -> None:
    """Dress a body, or everything below a group, in a material."""
    prim, look = prim_at(stage, path), UsdShade.Material(prim_at(stage, material))
    if not look:
        raise BrightfieldError(f'"{material}" must be a material; it is a {look.GetPrim().GetTypeName()}.')
    own = any(
        UsdShade.MaterialBindingAPI(p).GetDirectBinding().GetMaterialPath()
        for p in Usd.PrimRange(prim)
        if p != prim
    )
    strength = UsdShade.Tokens.strongerThanDescendants if own else UsdShade.Tokens.fallbackStrength
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(look, strength)


def world_pose(stage: Usd.Stage, path: str, time: float | None) -> np.ndarray:
    """``world_from_prim`` (4, 4), m: the frame of the prim, its lengths in metres."""
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    pose = np.linalg.inv(stage_from_world(stage)) @ _to_world(prim_at(stage, path), time)
    pose[:3, :3] /= unit
    return pose


def place(stage: Usd.Stage, path: str, world_from_prim: np.ndarray, time: float | None) -> None:
    """Give a prim a pose in the world, (4, 4), m."""
    transform(stage, path, world_from_prim @ np.linalg.inv(world_pose(stage, path, time)), time)


def transform(stage: Usd.Stage, path: str, by: np.ndarray, time: float | None) -> None:
    """Move a prim by a motion of the world, ``by`` (4, 4), m.

    One transform op, or translation, rotation and scale as most programs write them, get new numbers (at ``time``
    where they are animated); other ops stay as they are and get a transform in front.
    """
    prim = prim_at(stage, path)
    xform = UsdGeom.Xformable(prim)
    if not xform or prim.IsInstanceProxy():
        raise BrightfieldError(f'"{path}" has no place of its own that could be changed.')
    if not np.isfinite(by).all() or abs(np.linalg.det(by[:3, :3])) < 1e-12:
        raise BrightfieldError(f'A transform of "{path}" must be finite and must not flatten it.')
    code = _code(time)
    S = stage_from_world(stage)
    change = S @ by @ np.linalg.inv(S)
    above = matrix(UsdGeom.XformCache(code).GetParentToWorldTransform(prim))
    if xform.GetResetXformStack():
        above = np.eye(4)
    local = matrix(xform.GetLocalTransformation(code))
    new = np.linalg.inv(above) @ change @ above @ local
    ops = xform.GetOrderedXformOps()
    kinds = [op.GetOpType() for op in ops]
    if not ops or kinds == [UsdGeom.XformOp.TypeTransform]:
        op = ops[0] if ops else xform.AddTransformOp()
        _put(op, _gf(new), time)
    elif not any(op.MightBeTimeVarying() for op in ops) and _set_common(prim, new):
        return
    else:
        name = f"xformOp:transform:{EDIT}"
        there = [op for op in ops if op.GetOpName() == name]
        if there:
            before = matrix(there[0].GetOpTransform(code))
            there[0].Set(_gf(new @ np.linalg.inv(local) @ before))
        else:
            op = xform.AddTransformOp(opSuffix=EDIT)
            op.Set(_gf(new @ np.linalg.inv(local)))
            xform.SetXformOpOrder([op, *ops], xform.GetResetXformStack())


def set_visible(stage: Usd.Stage, path: str, visible: bool) -> None:
    image = UsdGeom.Imageable(prim_at(stage, path))
    if not image:
        raise BrightfieldError(f'"{path}" is nothing that could be seen or hidden.')
    image.GetVisibilityAttr().Set(UsdGeom.Tokens.inherited if visible else UsdGeom.Tokens.invisible)


def delete(stage: Usd.Stage, path: str) -> None:
    """Remove a prim; one that comes from another file is made inactive."""
    prim = prim_at(stage, path)
    if prim.IsInstanceProxy():
        raise BrightfieldError(f'"{path}" is inside of an instance; delete the instance instead.')
    root = stage.GetRootLayer()
    elsewhere = [s for s in prim.GetPrimStack() if s.layer != root]
    if elsewhere or not root.GetPrimAtPath(path):
        prim.SetActive(False)
        return
    stage.RemovePrim(path)
    if stage.GetRootLayer().defaultPrim == prim_name(path) and "/" not in path[1:]:
        stage.ClearDefaultPrim()


def prim_name(path: str) -> str:
    return path.rsplit("/", 1)[-1]


def duplicate(stage: Usd.Stage, path: str) -> str:
    """A copy beside the prim, with its own frame and references; returns its path."""
    prim_at(stage, path)
    root = stage.GetRootLayer()
    spec = root.GetPrimAtPath(path)
    if not spec or spec.specifier != Sdf.SpecifierDef:
        raise BrightfieldError(f'"{path}" comes from another file; duplicate what refers to it instead.')
    parent = path.rsplit("/", 1)[0]
    new = free_path(stage, parent, prim_name(path).rstrip("0123456789").rstrip("_") or prim_name(path))
    if not Sdf.CopySpec(root, path, root, new):
        raise BrightfieldError(f'"{path}" cannot be copied.')
    stage.GetPrimAtPath(new).ClearDisplayName()
    return new


def rename(stage: Usd.Stage, path: str, name: str) -> str:
    """Give a prim a new name; what refers to it follows. Returns the new path."""
    prim = prim_at(stage, path)
    if not Sdf.Path.IsValidIdentifier(name):
        raise BrightfieldError(
            f'A name must begin with a letter and hold letters, digits and _ alone; got "{name}".'
        )
    new = f"{path.rsplit('/', 1)[0]}/{name}"
    if new == path:
        return path
    if stage.GetPrimAtPath(new):
        raise BrightfieldError(f'"{new}" is already there.')
    default = stage.GetRootLayer().defaultPrim
    editor = Usd.NamespaceEditor(stage)
    if not editor.RenamePrim(prim, name) or not editor.CanApplyEdits() or not editor.ApplyEdits():
        raise BrightfieldError(f'"{path}" cannot be renamed.')
    if default == prim_name(path) and "/" not in path[1:]:
        stage.SetDefaultPrim(stage.GetPrimAtPath(new))
    renamed = stage.GetPrimAtPath(new)
    if renamed.HasAuthoredDisplayName():
        renamed.ClearDisplayName()
    return new


def insert(stage: Usd.Stage, document: Document, name: str) -> str:
    """Bring another file's scene in below a new group, in the unit and axes of this one; returns the group's path.

    A USD file is referred to, anything else is copied.
    """
    other: Usd.Stage = document.stage
    path = free_path(stage, parent_path(stage), name)
    group = UsdGeom.Xform.Define(stage, path)
    root = other.GetRootLayer()
    if not root.anonymous and other.GetDefaultPrim():
        group.GetPrim().GetReferences().AddReference(_asset(stage, Path(root.realPath)))
    else:
        _copy(stage, other.Flatten(), path)
    scale = UsdGeom.GetStageMetersPerUnit(other) / UsdGeom.GetStageMetersPerUnit(stage)
    axes = {"Y": z_up_from_y_up, "Z": np.eye(4)}
    turn = axes[UsdGeom.GetStageUpAxis(stage)].T @ axes[UsdGeom.GetStageUpAxis(other)]
    into = turn @ np.diag([scale] * 3 + [1.0])
    if not np.array_equal(into, np.eye(4)):
        order = group.GetOrderedXformOps()
        op = group.AddTransformOp(opSuffix="unit")
        op.Set(_gf(into))
        group.SetXformOpOrder([op, *order])
    return path


def _asset(stage: Usd.Stage, file: Path) -> str:
    """Relative to this stage's file where it lies beside or below it, else absolute."""
    own = stage.GetRootLayer().realPath
    if own and file.resolve().is_relative_to(Path(own).parent.resolve()):
        return "./" + file.resolve().relative_to(Path(own).parent.resolve()).as_posix()
    return str(file.resolve())


def _copy(stage: Usd.Stage, layer: Sdf.Layer, path: str) -> None:
    """The content of a flat layer below ``path``: of its default prim, else all of its prims."""
    gathered = Sdf.Layer.CreateAnonymous()  # below a root that no path of the layer begins with
    Sdf.CreatePrimInLayer(gathered, IMPORT).specifier = Sdf.SpecifierDef
    moved: dict[str, str] = {}
    for spec in layer.rootPrims:
        main = spec.name == layer.defaultPrim and spec.typeName in ("Xform", "Scope", "")
        if main and "xformOpOrder" not in spec.attributes:
            moved |= {str(child.path): f"{IMPORT}/{child.name}" for child in spec.nameChildren}
    for spec in layer.rootPrims:
        inside = any(old.startswith(f"{spec.path}/") for old in moved)
        if not inside and spec.specifier == Sdf.SpecifierDef:
            name, taken = spec.name, set(moved.values())
            while f"{IMPORT}/{name}" in taken:
                name += "_"
            moved[str(spec.path)] = f"{IMPORT}/{name}"
    for old, new in moved.items():
        Sdf.CopySpec(layer, old, gathered, new)
    temporary = Usd.Stage.Open(gathered)
    for prim in temporary.TraverseAll():
        for relation in prim.GetAuthoredRelationships():
            relation.SetTargets([_moved(t, moved) for t in relation.GetTargets()])
        for attribute in prim.GetAuthoredAttributes():
            if attribute.HasAuthoredConnections():
                attribute.SetConnections([_moved(t, moved) for t in attribute.GetConnections()])
    root = stage.GetRootLayer()
    for new in moved.values():
        Sdf.CopySpec(gathered, new, root, new.replace(IMPORT, path, 1))
    # CopySpec follows targets below the prim that it copies; those to its siblings are brought along here
    for new in moved.values():
        for prim in Usd.PrimRange.AllPrims(stage.GetPrimAtPath(new.replace(IMPORT, path, 1))):
            for relation in prim.GetAuthoredRelationships():
                relation.SetTargets([_moved(t, {IMPORT: path}) for t in relation.GetTargets()])
            for attribute in prim.GetAuthoredAttributes():
                if attribute.HasAuthoredConnections():
                    found = [_moved(t, {IMPORT: path}) for t in attribute.GetConnections()]
                    attribute.SetConnections(found)


def _moved(target: Sdf.Path, moved: dict[str, str]) -> Sdf.Path:
    for old, new in moved.items():
        if target.HasPrefix(old):
            return target.ReplacePrefix(old, new)
    return target


def _set_common(prim: Any, local: np.ndarray) -> bool:
    """Write translation, rotation and scale where the prim has them as most programs do; False where they would
    not give ``local`` exactly."""
    common = UsdGeom.XformCommonAPI(prim)
    if not common:
        return False
    _, _, _, pivot, order = common.GetXformVectors(Usd.TimeCode.Default())
    if order != UsdGeom.XformCommonAPI.RotationOrderXYZ or pivot != Gf.Vec3f(0):
        return False
    linear = local[:3, :3]
    scale = np.linalg.norm(linear, axis=0)
    R = linear / scale
    if not np.allclose(R.T @ R, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0:
        return False
    y = np.arcsin(np.clip(-R[2, 0], -1, 1))
    x, z = np.arctan2(R[2, 1], R[2, 2]), np.arctan2(R[1, 0], R[0, 0])
    common.SetTranslate(Gf.Vec3d(*local[:3, 3].tolist()))
    names = {op.GetOpName() for op in UsdGeom.Xformable(prim).GetOrderedXformOps()}
    if "xformOp:rotateXYZ" in names or not np.allclose(R, np.eye(3), atol=1e-12):
        common.SetRotate(Gf.Vec3f(*np.degrees([x, y, z]).tolist()), UsdGeom.XformCommonAPI.RotationOrderXYZ)
    if "xformOp:scale" in names or not np.allclose(scale, 1.0, atol=1e-12):
        common.SetScale(Gf.Vec3f(*scale.tolist()))
    return True


def _to_world(prim: Any, time: float | None) -> np.ndarray:
    return matrix(UsdGeom.XformCache(_code(time)).GetLocalToWorldTransform(prim))


def _code(time: float | None) -> Usd.TimeCode:
    return Usd.TimeCode.Default() if time is None else Usd.TimeCode(time)


def _put(attribute: Any, value: Any, time: float | None) -> None:
    """At ``time`` where the attribute is animated, else for all times."""
    animated = time is not None and attribute.GetNumTimeSamples() > 0
    attribute.Set(value, _code(time) if animated else Usd.TimeCode.Default())


def _gf(m: np.ndarray) -> Gf.Matrix4d:
    return Gf.Matrix4d(m.T.tolist())


def valid_name(text: str) -> str:
    """The name nearest to ``text`` that USD allows."""
    return str(Tf.MakeValidIdentifier(text or "unnamed"))

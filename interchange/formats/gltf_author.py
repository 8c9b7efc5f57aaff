"""A parsed glTF tree as USD prims: one mesh prim a part, hierarchy and names kept, repeated parts by reference."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from pxr import Tf, Usd, UsdGeom, UsdShade, Vt

from interchange.formats.gltf_data import Gltf, Node, Primitive
from interchange.formats.usd_author import author_mesh, bind, free_path, set_matrix
from interchange.mesh import Mesh

Extra = Callable[[Usd.Stage, str, Node], None]  # authors what else hangs on a node, below its path


def author_tree(
    stage: Usd.Stage,
    gltf: Gltf,
    materials: Mapping[int, UsdShade.Material],
    names: Sequence[str],
    extra: Extra | None = None,
) -> None:
    """Author every node below ``/World``. ``names[i]`` is what node i is called.

    ``materials`` by their number in the file. A node that is a mesh and nothing else becomes that mesh's prim;
    any other becomes an Xform. A mesh that several nodes show is authored once and referenced by the others.
    """
    first: dict[int, str] = {}
    stack = [(i, "/World") for i in reversed(gltf.roots)]
    while stack:
        index, parent = stack.pop()
        node = gltf.nodes[index]
        path = free_path(stage, parent, _identifier(names[index]))
        alone = node.mesh >= 0 and not node.children and node.camera < 0 and node.light < 0
        if not alone:
            UsdGeom.Xform.Define(stage, path)
        primitives = gltf.meshes[node.mesh][1] if node.mesh >= 0 else ()
        if primitives:
            name = gltf.meshes[node.mesh][0] or "mesh"
            place = path if alone else free_path(stage, path, _identifier(name))
            if node.mesh in first:
                prim = UsdGeom.Mesh.Define(stage, place).GetPrim()
                prim.GetReferences().AddInternalReference(first[node.mesh])
            else:
                _author_part(stage, place, primitives, materials)
                first[node.mesh] = place
            set_matrix(stage.GetPrimAtPath(place), np.eye(4))
        elif alone:
            UsdGeom.Xform.Define(stage, path)
        prim = stage.GetPrimAtPath(path)
        set_matrix(prim, node.matrix)
        if names[index] != prim.GetName():
            prim.SetDisplayName(names[index])
        if extra is not None:
            extra(stage, path, node)
        stack += [(i, path) for i in reversed(node.children)]


def _identifier(name: str) -> str:
    """With an underscore before a first digit, which USD would replace."""
    return f"_{name}" if name[:1].isdigit() else name


def _author_part(
    stage: Usd.Stage, path: str, primitives: Sequence[Primitive], materials: Mapping[int, UsdShade.Material]
) -> Any:
    """One mesh prim; several materials become GeomSubsets."""
    mesh, groups = merge(primitives)
    prim = author_mesh(stage, path, mesh)
    if len(groups) == 1:
        ((material, _),) = groups.items()
        if material in materials:
            bind(prim, materials[material])
        return prim
    for material, faces in groups.items():
        if material not in materials:
            continue
        name = materials[material].GetPrim().GetName()
        subset = UsdGeom.Subset.CreateGeomSubset(
            prim,
            Tf.MakeValidIdentifier(name),
            UsdGeom.Tokens.face,
            Vt.IntArray.FromNumpy(faces.astype(np.int32)),
            UsdShade.Tokens.materialBind,
        )
        bind(subset, materials[material])
    kind = UsdGeom.Tokens.nonOverlapping if set(groups) - set(materials) else UsdGeom.Tokens.partition
    UsdGeom.Subset.SetFamilyType(prim, UsdShade.Tokens.materialBind, kind)
    return prim


def merge(primitives: Sequence[Primitive]) -> tuple[Mesh, dict[int, np.ndarray]]:
    """One mesh of several primitives, and the faces of each material, in the order of the primitives."""
    groups: dict[int, list[np.ndarray]] = {}
    faces, corner, face = [], 0, 0
    for p in primitives:
        faces.append(p.mesh.faces + corner)
        groups.setdefault(p.material, []).append(np.arange(face, face + len(p.mesh.faces)))
        corner, face = corner + len(p.mesh.vertices), face + len(p.mesh.faces)
    uv = None
    if any(p.mesh.uv is not None for p in primitives):
        uv = np.concatenate(
            [np.zeros((len(p.mesh.vertices), 2)) if p.mesh.uv is None else p.mesh.uv for p in primitives]
        )
    whole = Mesh(
        np.concatenate([p.mesh.vertices for p in primitives]),
        np.concatenate(faces).astype(np.int32),
        np.concatenate([p.mesh.normals for p in primitives]),
        uv,
    )
    return whole, {material: np.concatenate(rows) for material, rows in groups.items()}

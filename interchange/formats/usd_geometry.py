"""A UsdGeomMesh as ``Mesh`` parts, one for each material of its GeomSubsets."""

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from interchange.formats.polygons import triangulate
from interchange.formats.usd_values import Finder
from interchange.mesh import Mesh, from_corners, smooth_normals


@dataclass(frozen=True)
class Part:
    """Triangles of one binding: ``prim`` is the mesh or the GeomSubset that carries it."""

    mesh: Mesh
    prim: Usd.Prim


def read_mesh(prim: Usd.Prim, time: Usd.TimeCode, uv_name: str, find: Finder) -> list[Part]:
    """The parts of a mesh in the prim's own units; empty, with the reasons in ``find``, where it is broken."""
    usd = UsdGeom.Mesh(prim)
    points = np.asarray(usd.GetPointsAttr().Get(time) or [], np.float64).reshape(-1, 3)
    counts = np.asarray(usd.GetFaceVertexCountsAttr().Get(time) or [], np.int64)
    indices = np.asarray(usd.GetFaceVertexIndicesAttr().Get(time) or [], np.int64)
    if not _valid(prim, points, counts, indices, find):
        return []
    corners, owner = triangulate(counts, points, indices)
    holes = usd.GetHoleIndicesAttr().Get(time)
    if holes:
        keep = ~np.isin(owner, np.asarray(holes))
        corners, owner = corners[keep], owner[keep]
    subdivided = usd.GetSubdivisionSchemeAttr().Get(time) != UsdGeom.Tokens.none
    normals = None if subdivided else _normals(usd, time, len(points), len(indices), len(counts), find)
    if subdivided:
        find.note(
            "The subdivision surface is drawn as its control cage with smooth normals.",
            prim,
            "subdivisionScheme",
        )
    if normals is None:
        from_points = subdivided
        smooth = smooth_normals(points, indices[corners]) if from_points else None
        normals = smooth[indices] if smooth is not None else None
    uv = _corner_uv(prim, time, uv_name, indices, counts, find)
    plain = _shared(usd, time, points, counts, indices, uv, find) if not subdivided and not holes else None
    if plain is not None:
        return [Part(plain, prim)]
    if usd.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
        corners = corners[:, ::-1]
        if normals is not None and subdivided:
            normals = -normals
    parts = []
    for carrier, chosen in _subsets(usd, owner, len(counts), time):
        c = corners[chosen]
        if len(c):
            mesh = from_corners(
                points,
                indices[c],
                None if normals is None else normals[c],
                None if uv is None else uv[c],
            )
            parts.append(Part(mesh, carrier))
    return parts


def _shared(
    usd: UsdGeom.Mesh,
    time: Usd.TimeCode,
    points: np.ndarray,
    counts: np.ndarray,
    indices: np.ndarray,
    uv: np.ndarray | None,
    find: Finder,
) -> Mesh | None:
    """Triangles of one material whose attributes are all by vertex, taken as they are: what we write ourselves."""
    vertex = (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying)
    values = usd.GetNormalsAttr().Get(time)
    bare = not UsdGeom.PrimvarsAPI(usd).HasPrimvar("normals")
    if not (bare and values and len(values) == len(points) and usd.GetNormalsInterpolation() in vertex):
        return None
    if (
        not len(counts)
        or (counts != 3).any()
        or usd.GetOrientationAttr().Get(time) != UsdGeom.Tokens.rightHanded
    ):
        return None
    if UsdShade.MaterialBindingAPI(usd.GetPrim()).GetMaterialBindSubsets():
        return None
    by_vertex = None
    if uv is not None:
        by_vertex = np.zeros((len(points), 2))
        by_vertex[indices] = uv
        if not np.array_equal(by_vertex[indices], uv):
            return None  # a seam: corners of one vertex differ
    normals = np.asarray(values, np.float64)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    if (length == 0).any():
        return None
    return Mesh(points, indices.reshape(-1, 3).astype(np.int32), normals / length, by_vertex)


def _valid(prim: Usd.Prim, points: np.ndarray, counts: np.ndarray, indices: np.ndarray, find: Finder) -> bool:
    before = len(find.problems)
    if counts.sum() != len(indices) or (counts < 0).any():
        find.error(
            f"faceVertexCounts must add up to the number of indices; got {counts.sum()} and {len(indices)}.",
            prim,
            "faceVertexCounts",
        )
    if len(indices) and (indices.min() < 0 or indices.max() >= len(points)):
        find.error(
            f"Indices must lie in [0, {len(points) - 1}]; got {indices.min()} to {indices.max()}.",
            prim,
            "faceVertexIndices",
        )
    if not np.isfinite(points).all():
        find.error("Points must be finite numbers.", prim, "points")
    return len(find.problems) == before


def _normals(
    usd: UsdGeom.Mesh, time: Usd.TimeCode, points: int, corners: int, faces: int, find: Finder
) -> np.ndarray | None:
    """(C, 3) normals by corner, or None for a mesh that names none (its faces are flat)."""
    primvar = UsdGeom.PrimvarsAPI(usd).GetPrimvar("normals")
    if primvar and primvar.HasValue():
        values, interpolation = primvar.ComputeFlattened(time), primvar.GetInterpolation()
    else:
        values, interpolation = usd.GetNormalsAttr().Get(time), usd.GetNormalsInterpolation()
    if not values:
        return None
    values = np.asarray(values, np.float64)
    spread = _by_corner(values, interpolation, usd, time, points, corners, faces)
    if spread is None:
        find.error(
            f"{len(values)} normals do not fit {interpolation} interpolation "
            f"({points} points, {corners} corners, {faces} faces).",
            usd.GetPrim(),
            "normals",
        )
        return None
    length = np.linalg.norm(spread, axis=1, keepdims=True)
    return spread / np.where(length > 0, length, 1.0)


def _by_corner(
    values: np.ndarray,
    interpolation: str,
    usd: UsdGeom.Mesh,
    time: Usd.TimeCode,
    points: int,
    corners: int,
    faces: int,
) -> np.ndarray | None:
    tokens = UsdGeom.Tokens
    if interpolation in (tokens.vertex, tokens.varying) and len(values) == points:
        return values[np.asarray(usd.GetFaceVertexIndicesAttr().Get(time), np.int64)]
    if interpolation == tokens.faceVarying and len(values) == corners:
        return values
    if interpolation == tokens.uniform and len(values) == faces:
        return np.repeat(values, np.asarray(usd.GetFaceVertexCountsAttr().Get(time), np.int64), axis=0)
    if interpolation == tokens.constant and len(values) == 1:
        return np.repeat(values, corners, axis=0)
    return None


def _corner_uv(
    prim: Usd.Prim, time: Usd.TimeCode, name: str, indices: np.ndarray, counts: np.ndarray, find: Finder
) -> np.ndarray | None:
    api = UsdGeom.PrimvarsAPI(prim)
    primvar = api.FindPrimvarWithInheritance(name or "st")
    if not (primvar and primvar.HasValue()):
        if name:
            find.error(
                f'A texture asks for the coordinates "{name}", which the mesh does not have.',
                prim,
                f"primvars:{name}",
            )
        return None
    values = np.asarray(primvar.ComputeFlattened(time), np.float64)
    if values.ndim != 2 or values.shape[1] < 2:
        find.error(
            f"Texture coordinates must be pairs; got shape {values.shape}.", prim, f"primvars:{name or 'st'}"
        )
        return None
    usd = UsdGeom.Mesh(prim)
    points = len(usd.GetPointsAttr().Get(time) or [])
    spread = _by_corner(values, primvar.GetInterpolation(), usd, time, points, len(indices), len(counts))
    if spread is None:
        find.error(
            f"{len(values)} texture coordinates do not fit {primvar.GetInterpolation()} interpolation.",
            prim,
            f"primvars:{name or 'st'}",
        )
        return None
    return spread[:, :2]


def _subsets(
    usd: UsdGeom.Mesh, owner: np.ndarray, faces: int, time: Usd.TimeCode
) -> list[tuple[Usd.Prim, np.ndarray]]:
    """(carrier prim, (T,) bool) for each material binding of the mesh; what no subset claims stays the mesh's own."""
    rest = np.ones(len(owner), bool)
    found = []
    for subset in UsdShade.MaterialBindingAPI(usd.GetPrim()).GetMaterialBindSubsets():
        mine = np.zeros(faces, bool)
        numbers = np.asarray(subset.GetIndicesAttr().Get(time) or [], np.int64)
        mine[numbers[(numbers >= 0) & (numbers < faces)]] = True
        chosen = mine[owner] & rest
        rest &= ~chosen
        found.append((subset.GetPrim(), chosen))
    return [(usd.GetPrim(), rest), *found]

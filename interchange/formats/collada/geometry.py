"""COLLADA's <geometry> as a UsdGeomMesh prototype that instances refer to."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, UsdShade, Vt

from interchange.formats.collada.extra import keep_name, own_extra
from interchange.formats.collada.library import Library
from interchange.formats.collada.primitive import CURVES, DRAWN, SURFACES, Group, read_group
from interchange.formats.collada.source import Sources, whole


@dataclass(frozen=True)
class Prototype:
    """``subsets``: which prim below the mesh ("" the mesh itself) carries which material symbol.
    ``primvars``: the name of each set of texture coordinates."""

    path: str
    subsets: dict[str, str]
    primvars: dict[int, str]


class Geometries:
    """Authors each <geometry> once, below the class prim ``/Geometry``."""

    def __init__(self, stage: Usd.Stage, lib: Library) -> None:
        self.stage, self.lib, self.sources = stage, lib, Sources(lib)
        self._made: dict[Any, Prototype | None] = {}
        self._names: set[str] = set()

    def prototype(self, geometry: Any) -> Prototype | None:
        """The prototype of a <geometry>; None, with a finding, where it holds no surface."""
        if geometry not in self._made:
            self._made[geometry] = self._make(geometry)
        return self._made[geometry]

    def _make(self, geometry: Any) -> Prototype | None:
        find = self.lib.find
        mesh = geometry.find("mesh")
        if mesh is None and (convex := geometry.find("convex_mesh")) is not None:
            other = convex.get("convex_hull_of")
            if other:
                find.loss("The convex hull of another geometry is for physics; it is left out.", geometry)
                return None
            mesh = convex
        if mesh is None:
            kinds = ", ".join(c.tag for c in geometry if c.tag not in ("asset", "extra")) or "nothing"
            find.loss(f"A geometry of {kinds} holds no polygons; it is left out.", geometry)
            return None
        groups: list[Group] = []
        for child in mesh:
            if child.tag in SURFACES:
                group = read_group(child, self.lib, self.sources)
                if group is not None and len(group.counts):
                    groups.append(group)
            elif child.tag in CURVES:
                find.loss(f"<{child.tag}> have no surface and are left out.", child)
        if not groups:
            if not any(c.tag in (*SURFACES, *CURVES) for c in mesh):
                find.note("The geometry has no polygons.", geometry)
            return None
        first = groups[0].first("POSITION")
        assert first is not None
        for group in groups[1:]:
            other_points = group.first("POSITION")
            if other_points is None or other_points.values is not first.values:
                find.error("All polygons of a mesh must share their <vertices>.", group.element)
                return None
        return self._author(geometry, groups, first.values)

    def _author(self, geometry: Any, groups: list[Group], positions: np.ndarray) -> Prototype:
        scope = "/Geometry"
        if not self.stage.GetPrimAtPath(scope):
            self.stage.CreateClassPrim(scope)
        base = Tf.MakeValidIdentifier(geometry.get("id") or geometry.get("name") or "geometry")
        name, count = base, 1
        while name in self._names:
            count += 1
            name = f"{base}_{count}"
        self._names.add(name)
        path = f"{scope}/{name}"
        usd = UsdGeom.Mesh.Define(self.stage, path)
        points = np.pad(positions[:, :3], ((0, 0), (0, max(0, 3 - positions.shape[1]))))
        points = np.where(np.abs(points) < np.finfo(np.float32).max, points, 0.0)  # those in use are finite
        counts = np.concatenate([g.counts for g in groups])
        indices = np.concatenate([g.corners[:, _offset(g, "POSITION")] for g in groups])
        usd.CreatePointsAttr(_vec3(points))
        usd.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(counts.astype(np.int32)))
        usd.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(indices.astype(np.int32)))
        usd.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        used = points[indices]
        usd.CreateExtentAttr(_vec3(np.stack([used.min(0), used.max(0)])))
        normals = self._normals(groups, points)
        if normals is not None:
            usd.CreateNormalsAttr(_vec3(normals))
            usd.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)
        primvars = self._texture_coordinates(usd, groups, own_extra(geometry))
        self._colors(usd, groups)
        for semantic in sorted({i.semantic for g in groups for i in g.inputs} - set(DRAWN)):
            self.lib.find.note(f"The input {semantic} is left out.", geometry)
        keep_name(usd.GetPrim(), geometry)
        return Prototype(path, self._subsets(usd, groups), primvars)

    def _normals(self, groups: list[Group], points: np.ndarray) -> np.ndarray | None:
        """(C, 3) by corner; a group without normals beside groups that have some is flat. None without any."""
        if not any(g.first("NORMAL") for g in groups):
            return None
        parts = []
        for group in groups:
            given = group.first("NORMAL")
            if given is not None and given.values.shape[1] >= 3:
                parts.append(self._finite(given.values[group.corners[:, given.offset], :3], "Normals", group))
                continue
            corners = points[group.corners[:, _offset(group, "POSITION")]]
            starts = np.cumsum(group.counts) - group.counts
            a, b, c = (corners[starts + k] for k in range(3))
            flat = np.cross(b - a, c - a)
            flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
            parts.append(np.repeat(flat, group.counts, axis=0))
        return np.concatenate(parts)

    def _texture_coordinates(self, usd: UsdGeom.Mesh, groups: list[Group], extra: Any) -> dict[int, str]:
        sets = sorted({i.set for g in groups for i in g.inputs if i.semantic == "TEXCOORD"})
        names = {s: "st" if k == 0 else f"st{k}" for k, s in enumerate(sets)}
        for given in [] if extra is None else extra.findall("texcoord"):
            set_, name = whole(given, "set", self.lib), given.get("name", "")
            if set_ in names and Sdf.Path.IsValidNamespacedIdentifier(name):
                names[set_] = name
        for set_, name in names.items():
            parts = []
            for group in groups:
                given = group.first("TEXCOORD", set_)
                corners = len(group.corners)
                if given is None:
                    parts.append(np.zeros((corners, 2)))
                    continue
                values = given.values[group.corners[:, given.offset]][:, :2]
                values = np.pad(values, ((0, 0), (0, 2 - values.shape[1])))
                parts.append(self._finite(values, "Texture coordinates", group))
            self._indexed(usd, name, Sdf.ValueTypeNames.TexCoord2fArray, np.concatenate(parts), Vt.Vec2fArray)
        return names

    def _colors(self, usd: UsdGeom.Mesh, groups: list[Group]) -> None:
        if not all(g.first("COLOR") for g in groups):
            if any(g.first("COLOR") for g in groups):
                self.lib.find.loss(
                    "Vertex colours of a part of the mesh only are left out.", groups[0].element
                )
            return
        parts = []
        for group in groups:
            given = group.first("COLOR")
            assert given is not None
            values = given.values[group.corners[:, given.offset]][:, :3]
            parts.append(self._finite(np.pad(values, ((0, 0), (0, 3 - values.shape[1]))), "Colours", group))
            if any(i.semantic == "COLOR" and i is not given for i in group.inputs):
                self.lib.find.loss("Only the first set of vertex colours is kept.", group.element)
        self.lib.find.note(
            "Vertex colours are kept as displayColor; a material covers them.", groups[0].element
        )
        values = np.concatenate(parts)
        self._indexed(usd, "displayColor", Sdf.ValueTypeNames.Color3fArray, values, Vt.Vec3fArray)

    def _finite(self, values: np.ndarray, what: str, group: Group) -> np.ndarray:
        finite = np.abs(values) < np.finfo(np.float32).max
        if not finite.all():
            self.lib.find.loss(f"{what} that are not finite are taken as 0.", group.element)
        return np.where(finite, values, 0.0)

    def _indexed(self, usd: UsdGeom.Mesh, name: str, kind: Any, values: np.ndarray, array: Any) -> None:
        values = np.ascontiguousarray(values, np.float32)
        rows = values.view([("", values.dtype)] * values.shape[1]).ravel()
        _, first, inverse = np.unique(rows, return_index=True, return_inverse=True)
        primvar = UsdGeom.PrimvarsAPI(usd).CreatePrimvar(name, kind, UsdGeom.Tokens.faceVarying)
        primvar.Set(array.FromNumpy(np.ascontiguousarray(values[first])))
        primvar.SetIndices(Vt.IntArray.FromNumpy(inverse.astype(np.int32)))

    def _subsets(self, usd: UsdGeom.Mesh, groups: list[Group]) -> dict[str, str]:
        symbols = list(dict.fromkeys(g.symbol for g in groups))
        if len(symbols) == 1:
            return {symbols[0]: ""}
        faces = np.repeat([symbols.index(g.symbol) for g in groups], [len(g.counts) for g in groups])
        subsets: dict[str, str] = {}
        for k, symbol in enumerate(symbols):
            name = Tf.MakeValidIdentifier(symbol or "rest")
            while name in subsets.values():
                name += "_"
            subsets[symbol] = name
            chosen = Vt.IntArray.FromNumpy(np.flatnonzero(faces == k).astype(np.int32))
            UsdGeom.Subset.CreateGeomSubset(
                usd,
                name,
                UsdGeom.Tokens.face,
                chosen,
                UsdShade.Tokens.materialBind,
                UsdGeom.Tokens.nonOverlapping,
            )
        return subsets


def _offset(group: Group, semantic: str) -> int:
    given = group.first(semantic)
    assert given is not None
    return given.offset


def _vec3(values: np.ndarray) -> Any:
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))

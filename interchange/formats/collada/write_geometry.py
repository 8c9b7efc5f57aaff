"""USD meshes and solids as COLLADA geometries: one <polylist> a material, each distinct shape once."""

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade

from interchange.formats.collada.extra import prim_element
from interchange.formats.collada.xml_writer import Output, add, add_extra, add_kept_extras, add_name
from interchange.formats.gprims import read_gprim
from interchange.formats.usd_geometry import read_mesh

OWN = {
    "points", "normals", "faceVertexCounts", "faceVertexIndices", "holeIndices", "orientation", "subdivisionScheme",
    "extent", "visibility", "purpose", "xformOpOrder", "primvars:displayColor", "primvars:displayColor:indices",
}  # fmt: skip
SETTINGS = "subdivisionScheme orientation extent"
TEXCOORDS = (
    Sdf.ValueTypeNames.TexCoord2fArray,
    Sdf.ValueTypeNames.Float2Array,
    Sdf.ValueTypeNames.TexCoord2dArray,
)


@dataclass(frozen=True)
class Shape:
    """``symbols``: the material symbol of each part of the surface, by the prim that carries the binding.
    ``uv``: names of the texture coordinate sets, in their order."""

    id: str
    symbols: dict[Sdf.Path, str]
    uv: list[str]


@dataclass(frozen=True)
class Layer:
    """One input: ``values`` (N, width) and the index of each corner's row."""

    semantic: str
    params: str
    values: np.ndarray
    index: np.ndarray
    set: int | None = None


@dataclass(frozen=True)
class Polygons:
    points: np.ndarray
    counts: np.ndarray
    indices: np.ndarray
    layers: list[Layer]
    parts: list[tuple[Usd.Prim, np.ndarray]]  # carrier of the binding, (F,) bool
    uv: list[str]


class Shapes:
    def __init__(self, out: Output) -> None:
        self.out = out
        self._known: dict[bytes, Shape] = {}

    def shape(self, prim: Usd.Prim, time: Usd.TimeCode) -> Shape | None:
        """The geometry of a Mesh or another Gprim; None, with a finding, where it has no surface."""
        polygons = self._polygons(prim, time)
        if polygons is None or not len(polygons.counts):
            return None
        if any(prim.GetAttribute(n).GetNumTimeSamples() > 1 for n in ("points", "radius", "height", "size")):
            self.out.find.loss(f"The shape changes with time; that of frame {_label(time)} is written.", prim)
        extra = self._extra(prim)
        key = hashlib.sha256(extra)
        for array in (polygons.points, polygons.counts, polygons.indices):
            key.update(np.ascontiguousarray(array).tobytes())
        for layer in polygons.layers:
            key.update(f"{layer.semantic}{layer.set}".encode())
            key.update(np.ascontiguousarray(layer.values[layer.index]).tobytes())
        names = self._symbols(prim, polygons)
        for (_, faces), symbol in zip(polygons.parts, names.values(), strict=True):
            key.update(symbol.encode() + faces.tobytes())
        known = self._known.get(key.digest())
        if known is None:
            known = self._known[key.digest()] = self._write(prim, polygons, names)
        return Shape(known.id, names, polygons.uv)

    def _symbols(self, prim: Usd.Prim, polygons: Polygons) -> dict[Sdf.Path, str]:
        return {
            carrier.GetPath(): "material" if carrier == prim else carrier.GetName()
            for carrier, _ in polygons.parts
        }

    def _polygons(self, prim: Usd.Prim, time: Usd.TimeCode) -> Polygons | None:
        usd = UsdGeom.Mesh(prim)
        if not prim.IsA(UsdGeom.Mesh):
            mesh = read_gprim(prim, time)
            if mesh is None:
                self.out.find.loss(f"{prim.GetTypeName()} is not written; meshes and solids are.", prim)
                return None
            self.out.find.loss(f"The {prim.GetTypeName()} is written as its triangles.", prim)
            return self._triangles(prim, [(prim, mesh)], time)
        if usd.GetSubdivisionSchemeAttr().Get(time) != UsdGeom.Tokens.none:
            self.out.find.loss(
                "The subdivision surface is written as its control cage with smooth normals.", prim
            )
            parts = read_mesh(prim, time, "", self.out.find)
            return self._triangles(prim, [(p.prim, p.mesh) for p in parts], time) if parts else None
        points = np.asarray(usd.GetPointsAttr().Get(time) or [], np.float32).reshape(-1, 3)
        counts = np.asarray(usd.GetFaceVertexCountsAttr().Get(time) or [], np.int64)
        indices = np.asarray(usd.GetFaceVertexIndicesAttr().Get(time) or [], np.int64)
        broken = counts.sum() != len(indices) or (counts < 0).any()
        if broken or (len(indices) and (indices.min() < 0 or indices.max() >= len(points))):
            self.out.find.loss("The mesh's indices do not fit its points; it is left out.", prim)
            return None
        layers: list[Layer] = []
        self._normals(usd, time, layers, counts, indices, len(points))
        names = self._texture_coordinates(prim, time, layers, counts, indices, len(points))
        self._colors(prim, time, layers, counts, indices, len(points))
        keep = np.ones(len(counts), bool)
        keep[np.asarray(usd.GetHoleIndicesAttr().Get(time) or [], np.int64)] = False
        order = np.arange(len(indices))
        if usd.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
            ends = np.cumsum(counts)
            order = np.repeat(ends, counts) - 1 - (order - np.repeat(ends - counts, counts))
        order = order[np.repeat(keep, counts)]
        layers = [Layer(x.semantic, x.params, x.values, x.index[order], x.set) for x in layers]
        return Polygons(points, counts[keep], indices[order], layers, _parts(prim, keep, time), names)

    def _triangles(self, prim: Usd.Prim, meshes: list[tuple[Usd.Prim, Any]], time: Usd.TimeCode) -> Polygons:
        """Meshes of the program as one set of polygons."""
        starts = np.cumsum([0, *(len(m.vertices) for _, m in meshes)])
        points = np.concatenate([m.vertices for _, m in meshes]).astype(np.float32)
        normals = np.concatenate([m.normals for _, m in meshes]).astype(np.float32)
        indices = np.concatenate(
            [m.faces.astype(np.int64).ravel() + s for (_, m), s in zip(meshes, starts[:-1], strict=True)]
        )
        layers = [Layer("NORMAL", "X Y Z", normals, indices)]
        uv = all(m.uv is not None for _, m in meshes)
        if uv:
            values = np.concatenate([m.uv for _, m in meshes]).astype(np.float32)
            layers.append(Layer("TEXCOORD", "S T", values, indices, 0))
        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
        colors = np.asarray((primvar.ComputeFlattened(time) if primvar else None) or [], np.float64)
        if len(colors):
            if len(colors) > 1:
                self.out.find.loss("Of colours that change over the surface the mean is written.", prim)
            mean = colors.mean(axis=0).astype(np.float32)[None]
            layers.append(Layer("COLOR", "R G B", mean, np.zeros(len(indices), np.int64)))
        faces = np.repeat(np.arange(len(meshes)), [len(m.faces) for _, m in meshes])
        parts = [(carrier, faces == k) for k, (carrier, _) in enumerate(meshes)]
        return Polygons(points, np.full(len(faces), 3), indices, layers, parts, ["st"] if uv else [])

    def _normals(
        self,
        usd: Any,
        time: Usd.TimeCode,
        layers: list[Layer],
        counts: np.ndarray,
        indices: np.ndarray,
        points: int,
    ) -> None:
        primvar = UsdGeom.PrimvarsAPI(usd).GetPrimvar("normals")
        if primvar and primvar.HasValue():
            values, how = primvar.ComputeFlattened(time), primvar.GetInterpolation()
        else:
            values, how = usd.GetNormalsAttr().Get(time), usd.GetNormalsInterpolation()
        if values:
            self._add(usd.GetPrim(), layers, "NORMAL", "X Y Z", values, how, counts, indices, points, None)

    def _texture_coordinates(
        self,
        prim: Usd.Prim,
        time: Usd.TimeCode,
        layers: list[Layer],
        counts: np.ndarray,
        indices: np.ndarray,
        points: int,
    ) -> list[str]:
        found = [
            p
            for p in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
            if p.GetTypeName() in TEXCOORDS and p.HasValue()
        ]
        found.sort(key=lambda p: (p.GetPrimvarName() != "st", p.GetPrimvarName()))
        names: list[str] = []
        for primvar in found:
            values, how = primvar.ComputeFlattened(time), primvar.GetInterpolation()
            if self._add(prim, layers, "TEXCOORD", "S T", values, how, counts, indices, points, len(names)):
                names.append(str(primvar.GetPrimvarName()))
        return names

    def _colors(
        self,
        prim: Usd.Prim,
        time: Usd.TimeCode,
        layers: list[Layer],
        counts: np.ndarray,
        indices: np.ndarray,
        points: int,
    ) -> None:
        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
        if primvar and primvar.HasValue():
            values, how = primvar.ComputeFlattened(time), primvar.GetInterpolation()
            self._add(prim, layers, "COLOR", "R G B", values, how, counts, indices, points, None)

    def _add(
        self,
        prim: Usd.Prim,
        layers: list[Layer],
        semantic: str,
        params: str,
        values: Any,
        how: str,
        counts: np.ndarray,
        indices: np.ndarray,
        points: int,
        set_: int | None,
    ) -> bool:
        tokens = UsdGeom.Tokens
        given = np.asarray(values, np.float32)
        if how in (tokens.vertex, tokens.varying) and len(given) == points:
            index = indices
        elif how == tokens.faceVarying and len(given) == len(indices):
            given, index = np.unique(given, axis=0, return_inverse=True)
            index = index.ravel()
        elif how == tokens.uniform and len(given) == len(counts):
            index = np.repeat(np.arange(len(counts)), counts)
        elif how == tokens.constant and len(given) == 1:
            index = np.zeros(len(indices), np.int64)
        else:
            self.out.find.loss(
                f"{len(given)} values of {semantic} do not fit {how}; they are left out.", prim
            )
            return False
        layers.append(Layer(semantic, params, given, index, set_))
        return True

    def _extra(self, prim: Usd.Prim) -> bytes:
        from lxml import etree

        names = foreign_attributes(prim)
        return etree.tostring(prim_element(prim, names, self.out.folder, self.out.find)) if names else b""

    def _write(self, prim: Usd.Prim, polygons: Polygons, symbols: dict[Sdf.Path, str]) -> Shape:
        out = self.out
        name = out.new_id(prim.GetName())
        geometry = add(out.libraries["geometries"], "geometry", id=name)
        mesh = add(geometry, "mesh")
        positions = out.source(mesh, f"{name}-positions", polygons.points, "X Y Z")
        sources = [
            out.source(
                mesh, f"{name}-{x.semantic.lower()}{'' if x.set is None else x.set}", x.values, x.params
            )
            for x in polygons.layers
        ]
        vertices_id = out.new_id(f"{name}-vertices")
        add(add(mesh, "vertices", id=vertices_id), "input", semantic="POSITION", source=f"#{positions}")
        corners = np.stack([polygons.indices, *(x.index for x in polygons.layers)], axis=1)
        starts = np.cumsum(polygons.counts) - polygons.counts
        for carrier, faces in polygons.parts:
            if not faces.any():
                continue
            counts = polygons.counts[faces]
            polylist = add(mesh, "polylist", count=str(len(counts)), material=symbols[carrier.GetPath()])
            add(polylist, "input", semantic="VERTEX", source=f"#{vertices_id}", offset="0")
            for offset, (layer, source) in enumerate(zip(polygons.layers, sources, strict=True), 1):
                one = add(polylist, "input", semantic=layer.semantic, source=f"#{source}", offset=str(offset))
                if layer.set is not None:
                    one.set("set", str(layer.set))
            add(polylist, "vcount", " ".join(map(str, counts.tolist())))
            within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
            chosen = corners[np.repeat(starts[faces], counts) + within]
            add(polylist, "p", " ".join(map(str, chosen.ravel().tolist())))
        names = foreign_attributes(prim)
        plain = ["st", *(f"st{k}" for k in range(1, len(polygons.uv)))][: len(polygons.uv)]
        if names or polygons.uv != plain:
            technique = add_extra(geometry)
            for set_, uv in enumerate(polygons.uv):
                add(technique, "texcoord", set=str(set_), name=uv)
            if names:
                technique.append(prim_element(prim, names, out.folder, out.find))
        add_name(geometry, prim)
        add_kept_extras(geometry, prim)
        return Shape(name, symbols, polygons.uv)


def foreign_attributes(prim: Usd.Prim) -> list[str]:
    """Attributes of a mesh that COLLADA's own elements do not carry."""
    uv = {
        p.GetName()
        for p in UsdGeom.PrimvarsAPI(prim).GetPrimvars()
        if p.GetTypeName() in TEXCOORDS or p.GetPrimvarName() in ("normals", "displayColor")
    }
    own = OWN | uv | {f"{n}:indices" for n in uv}
    if not prim.IsA(UsdGeom.Mesh):  # the numbers of a solid whose triangles are written
        own |= {n for n in prim.GetPrimDefinition().GetPropertyNames() if n != "doubleSided"}
    names = [a.GetName() for a in prim.GetAuthoredAttributes()]
    return [n for n in names if n not in own and not n.startswith("xformOp:")]


def _parts(prim: Usd.Prim, keep: np.ndarray, time: Usd.TimeCode) -> list[tuple[Usd.Prim, np.ndarray]]:
    rest = np.ones(len(keep), bool)
    found = []
    for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
        mine = np.zeros(len(keep), bool)
        numbers = np.asarray(subset.GetIndicesAttr().Get(time) or [], np.int64)
        mine[numbers[(numbers >= 0) & (numbers < len(keep))]] = True
        mine &= rest
        rest &= ~mine
        found.append((subset.GetPrim(), mine[keep]))
    return [(prim, rest[keep]), *found] if rest.any() or not found else found


def _label(time: Usd.TimeCode) -> str:
    return "0" if time.IsDefault() else f"{time.GetValue():g}"

"""COLLADA's visual scenes as USD hierarchies: nodes, instances, and what hangs on them."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade

from interchange.formats.collada.animation import MOST_SAMPLES, Animations
from interchange.formats.collada.camera import author_camera
from interchange.formats.collada.extra import author_attributes, keep_extras, keep_name, own_extra
from interchange.formats.collada.geometry import Geometries, Prototype
from interchange.formats.collada.library import Library
from interchange.formats.collada.light import Lamp, author_light
from interchange.formats.collada.material import Materials
from interchange.formats.collada.source import floats, whole
from interchange.formats.collada.transform import author_transforms
from interchange.formats.usd_values import matrix, rigid

MOST_NODES = 100_000  # instances of nodes within nodes may multiply
DEEPEST = 256


class SceneGraph:
    def __init__(self, stage: Usd.Stage, lib: Library, stage_frame: np.ndarray) -> None:
        """``stage_frame`` (4, 4): from the stage's unit and axes to metres and z up."""
        self.stage, self.lib, self.stage_frame = stage, lib, stage_frame
        self.geometries = Geometries(stage, lib)
        self.animations = Animations(lib, self.geometries.sources)
        self.materials = Materials(stage, lib, self.animations)
        self.lamps: list[Lamp] = []
        self.rigid: list[tuple[Usd.Prim, Any]] = []  # lamps and cameras: no scale may reach them
        self._taken: dict[tuple[str, str], int] = {}
        self._targets: dict[Any, Any] = {}

    def author(self, visual_scene: Any, parent: str) -> None:
        """Build the nodes of a <visual_scene> below the prim ``parent``."""
        roots = visual_scene.findall("node")
        self._measure(roots)
        self.lib.find.check()
        for element in visual_scene:
            if element.tag == "evaluate_scene":
                self.lib.find.note("Render passes (evaluate_scene) are left out.", element)
        scene_frame = self.lib.frame(visual_scene)
        work = [
            (n, parent, self.stage_frame, self.lib.frame_within(n, visual_scene, scene_frame)) for n in roots
        ]
        work.reverse()
        planned: list[tuple[Any, str, np.ndarray, np.ndarray]] = []
        layer = self.stage.GetRootLayer()
        with Sdf.ChangeBlock():  # prims one by one cost the square of their number
            while work:
                node, above, frame, own = work.pop()
                path = self._path(above, written_name(node) or node.get("id") or node.get("name"), "node")
                spec = Sdf.CreatePrimInLayer(layer, path)
                spec.specifier, spec.typeName = Sdf.SpecifierDef, "Xform"
                planned.append((node, path, frame, own))
                for child in reversed(list(self._children(node))):
                    work.append((child, path, own, self.lib.frame_within(child, node, own)))
        for node, path, frame, own in planned:
            self._node(node, path, frame, own)

    def _children(self, node: Any) -> Iterator[Any]:
        """The nodes within a node: its own, and those of other places that it instances."""
        for child in node:
            if child.tag == "node":
                yield child
            elif child.tag == "instance_node":
                if child not in self._targets:
                    self._targets[child] = self.lib.resolve(child.get("url"), child, "node")
                if self._targets[child] is not None:
                    yield self._targets[child]

    def _measure(self, roots: list[Any]) -> None:
        """Refuse nodes that hold themselves, and trees that instances make too large, before building them."""
        size: dict[Any, tuple[int, int]] = {}
        active: set[Any] = set()
        stack: list[tuple[Any, bool]] = [(r, False) for r in roots]
        while stack:
            node, done = stack.pop()
            if done:
                active.discard(node)
                below = [size.get(c, (0, 0)) for c in self._children(node)]
                size[node] = 1 + sum(n for n, _ in below), 1 + max((d for _, d in below), default=0)
            elif node in active:
                self.lib.find.error("A node must not hold itself through instance_node.", node)
            elif node not in size:
                active.add(node)
                stack.append((node, True))
                for child in self._children(node):
                    if child in active:
                        self.lib.find.error("A node must not hold itself through instance_node.", child)
                    else:
                        stack.append((child, False))
        total = sum(size[r][0] for r in roots if r in size)
        depth = max((size[r][1] for r in roots if r in size), default=0)
        if total > MOST_NODES or depth > DEEPEST:
            self.lib.find.error(
                f"A scene may have {MOST_NODES} nodes, {DEEPEST} deep, instances counted; "
                f"this one has {float(total):.6g}, {depth} deep."
            )

    def _path(self, parent: str, name: str | None, otherwise: str) -> str:
        base = Tf.MakeValidIdentifier(name or otherwise)
        count = self._taken.get((parent, base), 0) + 1
        self._taken[parent, base] = count
        if count == 1:
            return f"{parent}/{base}"
        return self._path(parent, f"{base}_{count}", otherwise)

    def _node(self, node: Any, path: str, frame: np.ndarray, own: np.ndarray) -> None:
        """Fill the prim of a node, which is in the frame ``own`` below a prim in the frame ``frame``."""
        extra = own_extra(node)
        given = None if extra is None else extra.find("usd")
        merged = path if given is not None and given.get("merged") == "1" else None
        prim = self.stage.GetPrimAtPath(path)
        keep_name(prim, node)
        _convert(prim, frame, own)
        author_transforms(prim, node, self.lib, self.animations)
        if extra is not None and (given := extra.find("prim")) is not None:
            author_attributes(prim, given, self.lib)
        keep_extras(prim, node)
        for child in node:
            match child.tag:
                case "instance_geometry":
                    geometry = self.lib.resolve(child.get("url"), child, "geometry")
                    if geometry is not None:
                        self._mesh(
                            merged or self._below(path, child, geometry), child, geometry, own, np.eye(4)
                        )
                case "instance_controller":
                    self._controller(path, child, own)
                case "instance_light":
                    self._light(path, merged, child)
                case "instance_camera":
                    self._camera(path, merged, child)

    def _below(self, above: str, instance: Any, target: Any) -> str:
        """The path of an instance: the name that this program wrote, else that of what it instances."""
        name = written_name(instance)
        return self._path(above, name or target.get("id") or target.get("name"), target.tag)

    def _mesh(self, path: str, instance: Any, geometry: Any, frame: np.ndarray, shape: np.ndarray) -> None:
        prototype = self.geometries.prototype(geometry)
        if prototype is None:
            return
        prim = self.stage.DefinePrim(path, "Mesh")
        prim.GetReferences().AddInternalReference(prototype.path)
        _convert(prim, frame, self.lib.frame_within(geometry, instance, frame))
        if not np.array_equal(shape, np.eye(4)):
            op = UsdGeom.Xformable(prim).AddTransformOp(opSuffix="bindShape")
            op.Set(Gf.Matrix4d(shape.T.tolist()))
        extra = own_extra(geometry)
        if extra is not None and (given := extra.find("prim")) is not None:
            author_attributes(prim, given, self.lib)
        keep_extras(prim, geometry)
        self._bind(prim, prototype, instance)

    def _bind(self, prim: Usd.Prim, prototype: Prototype, instance: Any) -> None:
        bound = set()
        for given in instance.iterfind("bind_material/technique_common/instance_material"):
            symbol = given.get("symbol") or ""
            bound.add(symbol)
            if symbol not in prototype.subsets:
                if prototype.subsets.keys() != {""}:
                    self.lib.find.note(f'No polygon has the material "{symbol}".', given)
                    continue
                symbol = ""  # polygons without a symbol take the only material there is
            material = self.lib.resolve(given.get("target"), given, "material")
            usd = (
                None if material is None else self.materials.material(material, self._sets(given, prototype))
            )
            if usd is None:
                continue
            subset = prototype.subsets[symbol]
            target = self.stage.OverridePrim(prim.GetPath().AppendChild(subset)) if subset else prim
            UsdShade.MaterialBindingAPI.Apply(target).Bind(usd)
        for symbol in prototype.subsets:
            if symbol not in bound and not (symbol == "" and bound):
                self.lib.find.note(f'The material "{symbol}" is not bound; its polygons are grey.', instance)

    def _sets(self, given: Any, prototype: Prototype) -> dict[str, str]:
        """Which primvar each texture coordinate semantic of a material means on this mesh."""
        first = next(iter(prototype.primvars.values()), "st")
        names = {"": first}
        for one in given.findall("bind_vertex_input"):
            if one.get("input_semantic", "TEXCOORD") != "TEXCOORD":
                continue
            set_ = whole(one, "input_set", self.lib, next(iter(prototype.primvars), 0))
            if set_ not in prototype.primvars and prototype.primvars:
                self.lib.find.loss(
                    f"The geometry has no texture coordinates of set {set_}; its first are taken.", one
                )
            names[one.get("semantic") or ""] = prototype.primvars.get(set_ or 0, first)
        return names

    def _controller(self, above: str, instance: Any, frame: np.ndarray) -> None:
        shape = np.eye(4)
        found = self.lib.resolve(instance.get("url"), instance, "controller")
        for _ in range(16):  # a skin of a morph of a geometry
            if found is None or found.tag == "geometry":
                break
            inner = next((c for c in found if c.tag in ("skin", "morph")), None)
            if inner is None:
                self.lib.find.error("A controller must hold a skin or a morph.", found)
                return
            self.lib.find.loss(f"The {inner.tag} is drawn in its bind shape; its motion is left out.", found)
            given = inner.find("bind_shape_matrix")
            numbers = None if given is None else floats(given, self.lib, 16)
            if numbers is not None:
                shape = shape @ numbers.reshape(4, 4)
            uri = inner.get("source")
            found = self.lib.resolve(uri, inner, ("geometry", "controller"))
        if found is not None and found.tag == "geometry":
            self._mesh(self._below(above, instance, found), instance, found, frame, shape)

    def _light(self, above: str, merged: str | None, instance: Any) -> None:
        light = self.lib.resolve(instance.get("url"), instance, "light")
        if light is None:
            return
        path = merged or self._below(above, instance, light)
        made = author_light(self.stage, path, light, self.lib, self.animations)
        if made is None:
            return
        prim, lamp = made
        extra = own_extra(light)
        given = None if extra is None else extra.find("prim")
        if given is not None:
            kind = given.get("type") or ""
            if not kind.endswith(("Light", "Light_1")) or kind.startswith(("Portal", "Geometry", "Plugin")):
                self.lib.find.error(f'"{kind}" is no lamp.', given)
                return
            for attribute in prim.GetAuthoredAttributes():
                if not attribute.GetName().startswith("xformOp"):
                    prim.RemoveProperty(attribute.GetName())
            prim.ClearMetadata("apiSchemas")
            prim.SetTypeName(kind)
            author_attributes(prim, given, self.lib)
            if lamp is not None and any(lamp.attenuation[:2]):
                prim.SetCustomDataByKey("collada:attenuation", Gf.Vec3d(*lamp.attenuation))
                prim.SetCustomDataByKey(
                    "collada:intensity", float(UsdLux.LightAPI(prim).GetIntensityAttr().Get())
                )
        elif lamp is not None:
            self.lamps.append(lamp)
        keep_name(prim, light)
        keep_extras(prim, light)
        if given is None:
            self.rigid.append((prim, light))

    def _camera(self, above: str, merged: str | None, instance: Any) -> None:
        camera = self.lib.resolve(instance.get("url"), instance, "camera")
        if camera is None:
            return
        path = merged or self._below(above, instance, camera)
        prim = author_camera(self.stage, path, camera, self.lib, self.animations)
        if prim is None:
            return
        extra = own_extra(camera)
        given = None if extra is None else extra.find("prim")
        if given is None:
            self.rigid.append((prim, camera))
        else:
            author_attributes(prim, given, self.lib)
        keep_name(prim, camera)
        keep_extras(prim, camera)

    def undo_scales(self) -> None:
        """Take the stretching of the nodes above away from lamps and cameras, which have no size in COLLADA."""
        for prim, element in self.rigid:
            moving = _times(prim)
            if moving:  # the inverse of a motion is not linear: one sample a frame
                first, last = np.ceil(moving[0]), min(moving[-1], moving[0] + MOST_SAMPLES)
                moving = sorted({*moving, *np.arange(first, last + 1e-9).tolist()})
            times = [Usd.TimeCode.Default(), *map(Usd.TimeCode, moving)]
            locals_ = []
            for time in times:
                above = matrix(UsdGeom.XformCache(time).GetParentToWorldTransform(prim))
                if not abs(np.linalg.det(above[:3, :3])) > 1e-300:
                    self.lib.find.error(
                        "A lamp or camera must not stand in a node that is scaled to nothing.", element
                    )
                    break
                pose, _ = rigid(above)
                locals_.append(np.linalg.inv(above) @ pose)
            else:
                if all(
                    np.allclose(m[:3, :3], np.eye(3) * m[0, 0], rtol=1e-5, atol=1e-6 * abs(m[0, 0]))
                    for m in locals_
                ):
                    continue
                op = UsdGeom.Xformable(prim).AddTransformOp(opSuffix="unstretched")
                for time, m in zip(times, locals_, strict=True):
                    op.Set(Gf.Matrix4d(m.T.tolist()), time)


def written_name(element: Any) -> str | None:
    """The name that this program gave to the prim of a node or an instance."""
    extra = own_extra(element)
    given = None if extra is None else extra.find("usd")
    return None if given is None else given.get("name")


def _convert(prim: Usd.Prim, to: np.ndarray, source: np.ndarray) -> None:
    """An operation from one unit and up axis to another, where they differ."""
    if np.array_equal(to, source):
        return
    m = np.linalg.inv(to) @ source
    if not np.allclose(m, np.eye(4), atol=1e-12):
        op = UsdGeom.Xformable(prim).AddTransformOp(opSuffix="asset")
        op.Set(Gf.Matrix4d(np.round(m, 15).T.tolist()))


def _times(prim: Usd.Prim) -> list[float]:
    """Every time at which something above a prim moves."""
    times: set[float] = set()
    above = prim.GetParent()
    while above and above.GetPath() != Sdf.Path.absoluteRootPath:
        for op in UsdGeom.Xformable(above).GetOrderedXformOps() if above.IsA(UsdGeom.Xformable) else []:
            times.update(op.GetTimeSamples())
        above = above.GetParent()
    return sorted(times)

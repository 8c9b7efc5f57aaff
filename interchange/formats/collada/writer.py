"""A USD stage as a COLLADA 1.4.1 file.

Hierarchy, poses and their animation, meshes, materials, lamps and cameras are COLLADA's own elements; what it has
no words for stands in <extra> for this program. A stage whose visibility changes becomes one visual scene a frame.
"""

import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pxr import Usd, UsdGeom, UsdLux, UsdShade

from interchange.formats.atomic import written_beside
from interchange.formats.collada.extra import format_numbers, prim_element
from interchange.formats.collada.write_geometry import Shape, Shapes
from interchange.formats.collada.write_light import write_camera, write_light
from interchange.formats.collada.write_material import UV, Surfaces
from interchange.formats.collada.write_transform import write_transforms
from interchange.formats.collada.xml_writer import Output, add, add_extra, add_kept_extras, add_name
from interchange.formats.usd_read import SceneReader, frame_times
from interchange.formats.usd_values import Finder, matrix
from interchange.problems import FileError, Problem, Where

UNITS = {1.0: "meter", 0.01: "centimeter", 0.001: "millimeter", 0.0254: "inch", 0.3048: "foot"}
MOST_FRAMES = 10_000
PLAIN = {"", "Xform", "Scope"}
PREDICATE = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


def write(stage: Usd.Stage, path: Path, source: str = "", version: str = "1.4.1") -> list[Problem]:
    """Write beside and rename. Returns what could not be carried. ``source``: the file that problems name;
    ``version``: "1.4.1" or "1.5.0"."""
    find = Finder(source or str(path))
    out = Output(path.absolute().parent, find, version)
    _about(stage, out)
    frames = [Usd.TimeCode(t) for t in frame_times(stage)] if _flickers(stage) else []
    if len(frames) > MOST_FRAMES:
        find.loss(f"Of {len(frames)} frames the first {MOST_FRAMES} are written.", stage.GetPseudoRoot())
        frames = frames[:MOST_FRAMES]
    if frames and [t.GetValue() for t in frames] != list(range(len(frames))):
        find.note(f"The {len(frames)} frames are numbered from 0 on.", stage.GetPseudoRoot())
    walk = _Walk(stage, out)
    scenes = [walk.scene(time) for time in frames] if frames else [walk.scene(None)]
    walk.unbound_materials()
    add(add(out.root, "scene"), "instance_visual_scene", url=f"#{scenes[0]}")
    data = out.finish()
    beside = written_beside(path)
    try:
        beside.write_bytes(data)
        os.replace(beside, path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise FileError(Problem(f"The file cannot be written: {error.strerror}.", Where(str(path)))) from None
    return find.problems


def _flickers(stage: Usd.Stage) -> bool:
    """Whether a visibility changes with time."""
    return any(
        UsdGeom.Imageable(p).GetVisibilityAttr().GetNumTimeSamples() > 1
        for p in Usd.PrimRange(stage.GetPseudoRoot(), PREDICATE)
        if p.IsA(UsdGeom.Imageable)
    )


def _about(stage: Usd.Stage, out: Output) -> None:
    kept = stage.GetRootLayer().customLayerData.get("collada", {})
    asset = add(out.root, "asset")
    contributor = add(asset, "contributor")
    for tag in ("author", "authoring_tool", "comments", "copyright"):
        if tag in kept or tag == "authoring_tool":
            add(contributor, tag, str(kept.get(tag, "Brightfield")))
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    add(asset, "created", str(kept.get("created", now)))
    if "keywords" in kept:
        add(asset, "keywords", str(kept["keywords"]))
    add(asset, "modified", now)
    for tag in ("revision", "subject", "title"):
        if tag in kept:
            add(asset, tag, str(kept[tag]))
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    add(asset, "unit", name=UNITS.get(unit, "unit"), meter=repr(float(unit)))
    add(asset, "up_axis", "Z_UP" if UsdGeom.GetStageUpAxis(stage) == "Z" else "Y_UP")


class _Walk:
    def __init__(self, stage: Usd.Stage, out: Output) -> None:
        self.stage, self.out = stage, out
        reader = SceneReader(stage, out.find.file)
        self.shapes, self.surfaces, self.reader = Shapes(out), Surfaces(out, reader), reader
        self.time = Usd.TimeCode.Default()
        self.animate = True

    def scene(self, time: Usd.TimeCode | None) -> str:
        """Write one <visual_scene>: of a frame, or of all with the poses animated. Returns its id."""
        self.animate = time is None
        self.time = Usd.TimeCode(frame_times(self.stage)[0]) if time is None else time
        world = self.stage.GetDefaultPrim()
        root = self.stage.GetPseudoRoot()
        name = self.out.new_id("Scene" if time is None else self._frame_name(time))
        scene = add(self.out.libraries["visual_scenes"], "visual_scene", id=name)
        others = [p for p in root.GetFilteredChildren(PREDICATE) if p != world and not self._is_plain(p)]
        collapsed = bool(world) and self._is_plain(world) and not others
        for top in root.GetFilteredChildren(PREDICATE):
            if top == world and collapsed:
                self._below(top, scene)
            else:
                self._prim(top, scene)
        if not len(scene):
            add(scene, "node", id=self.out.new_id("empty"))
        if time is None:
            technique = add_extra(scene)
            add(technique, "frames_per_second", repr(self.stage.GetTimeCodesPerSecond()))
            if self.stage.HasAuthoredTimeCodeRange():
                add(technique, "start_time_code", repr(self.stage.GetStartTimeCode()))
                add(technique, "end_time_code", repr(self.stage.GetEndTimeCode()))
            if not collapsed or world.GetName() != "World":
                top = world.GetName() if world else ""
                add(technique, "default_prim", name=top, holds="all" if collapsed else "itself")
        return name

    def unbound_materials(self) -> None:
        """Write the materials that nothing wears, too."""
        for prim in Usd.PrimRange(self.stage.GetPseudoRoot(), PREDICATE):
            if prim.IsA(UsdShade.Material) and not prim.IsInstanceProxy():
                self.surfaces.material(UsdShade.Material(prim), self.time)

    def _frame_name(self, time: Usd.TimeCode) -> str:
        """That of the visual scene that is seen at this time, where the stage came from several."""
        seen = [
            p.GetName()
            for p in self.stage.Traverse()
            if p.GetCustomDataByKey("collada:visual_scene")
            and UsdGeom.Imageable(p).GetVisibilityAttr().Get(time) != UsdGeom.Tokens.invisible
        ]
        return seen[0] if len(seen) == 1 else f"Frame{time.GetValue():g}"

    def _is_plain(self, prim: Usd.Prim) -> bool:
        """Nothing but a group: it adds no level to the file."""
        return (
            prim.GetTypeName() in PLAIN
            and not (prim.IsA(UsdGeom.Xformable) and UsdGeom.Xformable(prim).GetOrderedXformOps())
            and self._is_drawn(prim)
            and not [
                a for a in prim.GetAuthoredAttributes() if a.GetName() not in ("visibility", "xformOpOrder")
            ]
        )

    def _is_drawn(self, prim: Usd.Prim) -> bool:
        image = UsdGeom.Imageable(prim)
        if not image:
            return True
        if image.GetVisibilityAttr().Get(self.time) == UsdGeom.Tokens.invisible:
            if self.animate:
                self.out.find.loss("What is invisible is left out.", prim)
            return False
        if image.ComputePurpose() not in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render):
            self.out.find.loss(f"What is there as {image.ComputePurpose()} is left out.", prim)
            return False
        return True

    def _below(self, prim: Usd.Prim, parent: Any) -> None:
        children = prim.GetFilteredChildren(PREDICATE)
        # meshes, lamps and cameras without a pose stand in the node of their group
        inline = parent.tag == "node" and prim.GetTypeName() in PLAIN and all(map(_is_bare, children))
        for child in children:
            self._prim(child, parent, inline)

    def _prim(self, prim: Usd.Prim, parent: Any, inline: bool = False) -> None:
        if prim.IsA(UsdShade.Material) or prim.IsA(UsdShade.Shader) or prim.IsA(UsdGeom.Subset):
            return
        if prim.GetTypeName() and not prim.IsA(UsdGeom.Imageable):
            self.out.find.loss(f"{prim.GetTypeName()} is not written.", prim)
            return
        if not self._is_drawn(prim):
            return
        if not self.animate and prim.GetCustomDataByKey("collada:visual_scene") and self._is_plain(prim):
            self._below(prim, parent)
            return
        children = prim.GetFilteredChildren(PREDICATE)
        materials_only = children and all(c.IsA(UsdShade.Material) for c in children)
        if prim.GetTypeName() in PLAIN and materials_only and self._is_plain(prim):
            return
        here = prim.GetTypeName() in PLAIN
        if inline:
            self._instance(prim, parent)
            return
        node = add(parent, "node", id=self.out.new_id(prim.GetName()))
        if prim.IsA(UsdGeom.Xformable):
            write_transforms(node, prim, self.time, self.out, self.animate)
        if prim.IsA(UsdGeom.PointInstancer):
            self._instancer(prim, node)
        elif not here:
            self._instance(prim, node)
        if not prim.IsA(UsdGeom.PointInstancer):
            self._below(prim, node)
        self._node_extra(node, prim, merged=not here and not prim.IsA(UsdGeom.PointInstancer))

    def _node_extra(self, node: Any, prim: Usd.Prim, merged: bool) -> None:
        """The prim's own name where the id differs, what it is, and attributes of other programs."""
        names: list[str] = []
        if prim.GetTypeName() in PLAIN:
            given = [a.GetName() for a in prim.GetAuthoredAttributes()]
            names = [
                n
                for n in given
                if not n.startswith("xformOp") and n not in ("visibility", "purpose", "extent")
            ]
        renamed = node.get("id") != prim.GetName()
        if merged or renamed or names:
            technique = add_extra(node)
            if merged or renamed:
                add(technique, "usd", name=prim.GetName(), merged="1" if merged else "0")
            if names:
                technique.append(prim_element(prim, names, self.out.folder, self.out.find))
        add_name(node, prim)
        add_kept_extras(node, prim)
        _reorder(node)

    def _instance(self, prim: Usd.Prim, node: Any) -> None:
        if prim.HasAPI(UsdLux.LightAPI):
            kind, found = "light", write_light(prim, self.time, self.out, self.reader)
        elif prim.IsA(UsdGeom.Camera):
            kind, found = "camera", write_camera(prim, self.time, self.out)
        elif prim.IsA(UsdGeom.Gprim):
            shape = self.shapes.shape(prim, self.time)
            kind, found = "geometry", None if shape is None else shape.id
        else:
            self.out.find.loss(f"{prim.GetTypeName()} is not written.", prim)
            return
        if found is None:
            return
        instance = add(node, f"instance_{kind}", url=f"#{found}")
        if kind == "geometry" and shape is not None:
            self._bind(instance, shape)
        if found != prim.GetName():
            add(add_extra(instance), "usd", name=prim.GetName())

    def _bind(self, instance: Any, shape: Shape) -> None:
        common = None
        for carrier, symbol in shape.symbols.items():
            prim = self.stage.GetPrimAtPath(carrier)
            usd, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            if not usd:
                continue
            if common is None:
                common = add(add(instance, "bind_material"), "technique_common")
            written = self.surfaces.material(usd, self.time)
            one = add(common, "instance_material", symbol=symbol, target=f"#{written.id}")
            if written.uv_name in shape.uv:
                set_ = str(shape.uv.index(written.uv_name))
                add(one, "bind_vertex_input", semantic=UV, input_semantic="TEXCOORD", input_set=set_)

    def _instancer(self, prim: Usd.Prim, node: Any) -> None:
        """Prototypes once in the library of nodes, and an instance with a matrix for each place."""
        out, usd = self.out, UsdGeom.PointInstancer(prim)
        if self.animate and any(
            a.GetNumTimeSamples() > 1
            for a in (usd.GetPositionsAttr(), usd.GetOrientationsAttr(), usd.GetScalesAttr())
        ):
            out.find.loss("Instances that move are written where they stand in the first frame.", prim)
        indices = usd.GetProtoIndicesAttr().Get(self.time) or []
        places = usd.ComputeInstanceTransformsAtTime(
            self.time, self.time, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
        mask = usd.ComputeMaskAtTime(self.time) or [True] * len(indices)
        targets = usd.GetPrototypesRel().GetForwardedTargets()
        if len(places) != len(indices) or any(not 0 <= i < len(targets) for i in indices):
            out.find.loss("The instances do not fit their prototypes; they are left out.", prim)
            return
        ids = [self._prototype(self.stage.GetPrimAtPath(t)) for t in targets]
        for index, place, shown in zip(indices, places, mask, strict=True):
            found = ids[index]
            if shown and found is not None:
                one = add(node, "node", id=out.new_id(f"{prim.GetName()}-instance"))
                add(one, "matrix", format_numbers(matrix(place).ravel()), sid="transform")
                add(one, "instance_node", url=f"#{found}")
        out.find.loss(f"The {len(indices)} instances are written as nodes.", prim)

    def _prototype(self, prim: Usd.Prim) -> str | None:
        library = self.out.libraries["nodes"]
        before = len(library)
        if prim and prim.IsDefined():
            self._prim(prim, library)
        else:
            self.out.find.loss("A prototype that is not defined is left out.", prim)
        return library[before].get("id") if len(library) > before else None


def _has_ops(prim: Usd.Prim) -> bool:
    return bool(prim.IsA(UsdGeom.Xformable) and UsdGeom.Xformable(prim).GetXformOpOrderAttr().Get())


def _is_bare(prim: Usd.Prim) -> bool:
    """Whether it is a mesh, lamp or camera without a pose of its own and with no more than parts below it."""
    kind = prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Camera) or prim.HasAPI(UsdLux.LightAPI)
    return (
        kind
        and not _has_ops(prim)
        and all(c.IsA(UsdGeom.Subset) for c in prim.GetFilteredChildren(PREDICATE))
    )


def _reorder(node: Any) -> None:
    """The schema's order within a node: transforms, instances by kind, nodes, extra."""
    order = (
        "asset", "lookat", "matrix", "rotate", "scale", "skew", "translate", "instance_camera", "instance_controller",
        "instance_geometry", "instance_light", "instance_node", "node", "extra",
    )  # fmt: skip
    rank = {tag: max(0, i - 6) for i, tag in enumerate(order)}
    node[:] = sorted(node, key=lambda e: rank.get(e.tag, 0))

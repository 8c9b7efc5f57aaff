"""A USD stage at a time code as a ``Scene``; what did not change since another time is the same object."""

from collections.abc import Iterable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdShade

from interchange.brdf.usd_preview_surface import UsdPreviewSurface
from interchange.camera import Camera
from interchange.distortion import LensModel
from interchange.formats.gprims import read_gprim
from interchange.formats.usd_camera import read_camera
from interchange.formats.usd_geometry import Part, read_mesh
from interchange.formats.usd_light import read_light
from interchange.formats.usd_material import Bound, read_material
from interchange.formats.usd_response import scene_response
from interchange.formats.usd_values import Finder, matrix
from interchange.frames import z_up_from_y_up
from interchange.light import Light, Profile
from interchange.material import Material, Texture, Wrap
from interchange.mesh import Mesh
from interchange.problems import FileError, Problem, errors
from interchange.projector import Projector
from interchange.scene import Body, Scene

MAX_FRAMES = 1_000_000
DRAWN = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)


class SceneReader:
    """Reads scenes of one stage. Meshes, textures and materials are kept between frames."""

    def __init__(self, stage: Usd.Stage, file: str, digest: str = "") -> None:
        self.stage, self.file, self.digest = stage, file, digest
        self.unit = UsdGeom.GetStageMetersPerUnit(stage)
        axes = np.eye(4) if UsdGeom.GetStageUpAxis(stage) == "Z" else z_up_from_y_up
        self.world_from_stage = axes @ np.diag([self.unit] * 3 + [1.0])
        self._kept: dict[Any, Any] = {}
        self._textures: dict[Any, Texture] = {}
        self._last: dict[str, Body | Light | Camera] = {}

    def scene(self, time: float) -> Scene:
        scene, find = self._read(time)
        wrong = errors(find.problems)
        if wrong:
            raise FileError(wrong)
        return scene

    def problems(self, time: float) -> list[Problem]:
        return self._read(time)[1].problems

    def _read(self, time: float) -> tuple[Scene, Finder]:
        find = Finder(self.file)
        if not (np.isfinite(self.unit) and self.unit > 0):
            find.error(
                f"metersPerUnit must be above 0; got {self.unit:g}.",
                self.stage.GetPseudoRoot(),
                "metersPerUnit",
            )
            return Scene(source=self.file), find
        code = Usd.TimeCode(time)
        walk = _Walk(self, code, find)
        walk.below(self.stage.GetPseudoRoot(), self.world_from_stage, "")
        rate = self.stage.GetTimeCodesPerSecond()
        strobed = any(x.strobe.is_there and not x.strobe.triggered for x in walk.lights)
        if strobed and not (np.isfinite(rate) and rate > 0):
            find.error(
                f"timeCodesPerSecond must be above 0 where a lamp flashes; got {rate:g}.",
                self.stage.GetPseudoRoot(),
                "timeCodesPerSecond",
            )
        scene = Scene(
            bodies=tuple(walk.bodies),
            lights=tuple(walk.lights),
            cameras=tuple(walk.cameras),
            time=time,
            seconds=time / rate if rate else 0.0,
            source=self.file,
            digest=self.digest,
        )
        return scene, find

    def materials(self, time: float) -> tuple[Material, ...]:
        """All materials of the stage, those too that nothing is bound to. Raises FileError."""
        find = Finder(self.file)
        found = [
            read_material(prim, Usd.TimeCode(time), find, self.texture).material
            for prim in self.stage.Traverse()
            if prim.IsA(UsdShade.Material)
        ]
        wrong = errors(find.problems)
        if wrong:
            raise FileError(wrong)
        return tuple(found)

    def keep(self, key: Any, changes: bool, time: Usd.TimeCode, make: Any) -> Any:
        """What ``make()`` gave for this key before, unless its prim changes with time."""
        key = (key, time.GetValue()) if changes else key
        if key not in self._kept:
            if changes and len(self._kept) > 4096:
                self._kept = {k: v for k, v in self._kept.items() if not isinstance(k, tuple) or len(k) != 2}
            self._kept[key] = make()
        return self._kept[key]

    def forget(self, paths: Iterable[str]) -> None:
        """Read anew, next time, what these prims hold, and what is above or below them: they were edited."""
        changed = tuple(paths)

        def touched(key: Any) -> bool:
            kind, path, *_ = key[0] if isinstance(key[0], tuple) else key
            return kind in ("mesh", "gprim", "material") and any(
                path == p or path.startswith(p + "/") or p.startswith(path + "/") for p in changed
            )

        self._kept = {key: made for key, made in self._kept.items() if not touched(key)}

    def same(self, path: str, new: Any, fields: Iterable[str]) -> Any:
        """The last frame's record where nothing differs, so that renderers see by identity what changed."""
        old = self._last.get(path)
        if old is not None and all(_equal(getattr(old, f), getattr(new, f)) for f in fields):
            return old
        self._last[path] = new
        return new

    def texture(
        self,
        file: str,
        space: str = "auto",
        scale: tuple[float, ...] = (1, 1, 1, 1),
        bias: tuple[float, ...] = (0, 0, 0, 0),
        channels: str = "rgb",
    ) -> Texture:
        from interchange.formats import images

        key = (file, space, scale, bias, channels)
        if key not in self._textures:
            pixels = images.texture(Path(file), space, scale, bias, channels)
            self._textures[key] = Texture(pixels, (Wrap.BLACK, Wrap.BLACK), file)
        return self._textures[key]

    def projector(
        self, image: Texture, K: tuple[float, ...], distortion: tuple[float, ...], model: LensModel
    ) -> Projector:
        key = ("projector", id(image), K, distortion, model)
        if key not in self._kept:
            self._kept[key] = Projector(image, np.array(K).reshape(3, 3), distortion, model)
        return self._kept[key]

    def profile(self, file: str, normalize: bool) -> Profile:
        from interchange.formats.photometry import read as read_photometry

        key = ("profile", file, normalize)
        if key not in self._kept:
            profile = read_photometry(Path(file))
            if normalize:
                profile = replace(profile, candela=profile.candela * (4 * np.pi / profile.power()))
            self._kept[key] = profile
        return self._kept[key]


class _Walk:
    """One pass over the stage at one time."""

    def __init__(self, reader: SceneReader, time: Usd.TimeCode, find: Finder) -> None:
        self.reader, self.time, self.find = reader, time, find
        self.xforms = UsdGeom.XformCache(time)
        self.bodies: list[Body] = []
        self.lights: list[Light] = []
        self.cameras: list[Camera] = []

    def below(
        self, root: Usd.Prim, world_from_stage: np.ndarray, suffix: str, skip_xform_of: Usd.Prim | None = None
    ) -> None:
        """Read ``root`` and what is below it. ``suffix`` tells instances of a PointInstancer apart; there
        ``skip_xform_of`` is the prototype, whose pose in the stage does not count."""
        undo = np.eye(4)
        if skip_xform_of is not None:
            parent = matrix(self.xforms.GetParentToWorldTransform(skip_xform_of))
            undo = np.linalg.inv(parent)
        walk = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
        for prim in walk:
            if prim.IsPseudoRoot():
                continue
            if prim.IsA(UsdGeom.Imageable) and not self._drawn(prim):
                walk.PruneChildren()
                continue
            if not prim.IsA(UsdGeom.Imageable):
                continue
            if prim.IsA(UsdGeom.PointInstancer):
                self._instances(prim, world_from_stage, suffix)
                walk.PruneChildren()
                continue
            world = world_from_stage @ undo @ matrix(self.xforms.GetLocalToWorldTransform(prim))
            if not np.isfinite(world).all():
                self.find.error("The transform must be finite.", prim, "xformOpOrder")
                continue
            self._one(prim, world, suffix)

    def _drawn(self, prim: Usd.Prim) -> bool:
        image = UsdGeom.Imageable(prim)
        visible = image.GetVisibilityAttr().Get(self.time) != UsdGeom.Tokens.invisible
        return visible and image.ComputePurpose() in DRAWN

    def _one(self, prim: Usd.Prim, world: np.ndarray, suffix: str) -> None:
        reader, path = self.reader, str(prim.GetPath()) + suffix
        if prim.HasAPI(UsdLux.LightAPI):
            light = read_light(
                prim, self.time, world, self.find, reader.texture, reader.profile, reader.projector,
                lambda: scene_response(reader.stage, self.time),
            )  # fmt: skip
            if light is not None:
                light = replace(light, name=path) if suffix else light
                names = [f.name for f in fields(light) if f.name != "where"]
                self.lights.append(reader.same(path, light, names))
        elif prim.IsA(UsdGeom.Camera):
            camera = read_camera(prim, self.time, world, reader.unit, self.find)
            if camera is not None:
                names = ["world_from_camera", "lens", "sensor", "principal_point", "clip", "t_exp"]
                self.cameras.append(reader.same(path, camera, names))
        elif prim.IsA(UsdGeom.Mesh):
            self._mesh(prim, world, suffix)
        elif prim.IsA(UsdGeom.Gprim):
            changes = _changes(prim)
            mesh = reader.keep(
                ("gprim", str(prim.GetPath())), changes, self.time, lambda: read_gprim(prim, self.time)
            )
            if mesh is None:
                self.find.loss(f"{prim.GetTypeName()} is not drawn; meshes and solids are.", prim)
            else:
                self._body(prim, mesh, self._bound(prim).material, world, suffix, path)

    def _mesh(self, prim: Usd.Prim, world: np.ndarray, suffix: str) -> None:
        bound = self._bound(prim)
        name = bound.uv_name or next(
            (
                b.uv_name
                for s in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
                if (b := self._bound(s.GetPrim())).uv_name
            ),
            "",
        )
        here = Finder(self.find.file)
        key = ("mesh", str(prim.GetPath()), name)

        def make() -> tuple[list[Part], list[Problem]]:
            return read_mesh(prim, self.time, name, here), here.problems

        parts, problems = self.reader.keep(key, _changes(prim), self.time, make)
        self.find.problems += [p for p in problems if p not in self.find.problems]
        for part in parts:
            material = bound.material if part.prim == prim else self._bound(part.prim).material
            self._body(prim, part.mesh, material, world, suffix, str(part.prim.GetPath()) + suffix)

    def _body(
        self, prim: Usd.Prim, mesh: Mesh, material: Material, world: np.ndarray, suffix: str, key: str
    ) -> None:
        # body frames are in metres: the stage's unit leaves the pose and enters the mesh
        unit = self.reader.unit
        metric = self.reader.keep(
            ("metric", id(mesh)), False, self.time, lambda: (_scaled(mesh, unit), mesh)
        )[0]
        pose = world.copy()
        pose[:3, :3] /= unit
        body = Body(str(prim.GetPath()) + suffix, metric, material, pose, self.find.where(prim))
        self.bodies.append(self.reader.same("body:" + key, body, ("mesh", "material", "world_from_body")))

    def _bound(self, prim: Usd.Prim) -> Bound:
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        if not material:
            return self._unbound(prim)
        key = ("material", str(material.GetPath()))
        here = Finder(self.find.file)
        changes = any(_changes(p) for p in Usd.PrimRange(material.GetPrim()))

        def make() -> tuple[Bound, list[Problem]]:
            return read_material(material.GetPrim(), self.time, here, self.reader.texture), here.problems

        bound, problems = self.reader.keep(key, changes, self.time, make)
        self.find.problems += [p for p in problems if p not in self.find.problems]
        return bound

    def _unbound(self, prim: Usd.Prim) -> Bound:
        """A surface without a material: its displayColor, else UsdPreviewSurface's own grey."""
        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
        values = primvar.ComputeFlattened(self.time) if primvar and primvar.HasValue() else None
        color = (
            tuple(np.clip(np.mean(np.asarray(values, np.float64), axis=0), 0, 1)) if values else (0.18,) * 3
        )
        if values and len(values) > 1 and np.ptp(np.asarray(values), axis=0).max() > 1e-6:
            self.find.loss(
                "displayColor changes over the surface; its mean is drawn.", prim, "primvars:displayColor"
            )
        label = "displayColor({:.4g}, {:.4g}, {:.4g})".format(*color)
        brdf = UsdPreviewSurface(diffuseColor=color)
        return self.reader.keep(
            ("unbound", label), False, self.time, lambda: Bound(Material(label, brdf), "")
        )

    def _instances(self, prim: Usd.Prim, world_from_stage: np.ndarray, suffix: str) -> None:
        instancer = UsdGeom.PointInstancer(prim)
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        indices = instancer.GetProtoIndicesAttr().Get(self.time) or []
        if any(not 0 <= i < len(targets) for i in indices):
            self.find.error(f"protoIndices must lie in [0, {len(targets) - 1}].", prim, "protoIndices")
            return
        transforms = instancer.ComputeInstanceTransformsAtTime(
            self.time, self.time, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
        mask = instancer.ComputeMaskAtTime(self.time) or [True] * len(indices)
        if len(transforms) != len(indices):
            self.find.error(
                "The instancer's positions must be as many as its protoIndices.", prim, "positions"
            )
            return
        base = world_from_stage @ matrix(self.xforms.GetLocalToWorldTransform(prim))
        for number, (index, transform) in enumerate(zip(indices, transforms, strict=True)):
            if not mask[number]:
                continue
            prototype = self.reader.stage.GetPrimAtPath(targets[index])
            if not prototype:
                self.find.error(f"The prototype <{targets[index]}> is not there.", prim, "prototypes")
                return
            self.below(prototype, base @ matrix(transform), f"{suffix}[{number}]", prototype)


def _scaled(mesh: Mesh, unit: float) -> Mesh:
    return mesh if unit == 1.0 else Mesh(mesh.vertices * unit, mesh.faces, mesh.normals, mesh.uv)


def _changes(prim: Usd.Prim) -> bool:
    """Whether any attribute but the pose and the visibility has time samples."""
    return any(
        a.ValueMightBeTimeVarying()
        for a in prim.GetAuthoredAttributes()
        if not a.GetName().startswith("xformOp") and a.GetName() != "visibility"
    )


def _equal(a: Any, b: Any) -> bool:
    return np.array_equal(a, b) if isinstance(a, np.ndarray) else bool(a is b or a == b)


def frame_times(stage: Usd.Stage) -> list[float]:
    """One time code a frame: the authored range, else every time sample of the stage, else 0."""
    if stage.HasAuthoredTimeCodeRange():
        first, last = stage.GetStartTimeCode(), stage.GetEndTimeCode()
        if last >= first and last - first < MAX_FRAMES:
            return [float(t) for t in np.arange(first, last + 0.5)]
        message = (
            f"endTimeCode must lie 0 to {MAX_FRAMES} frames after startTimeCode; got {first:g} to {last:g}."
        )
        raise FileError(
            Problem(message, Finder(stage.GetRootLayer().identifier).where(stage.GetPseudoRoot()))
        )
    times: set[float] = set()
    for prim in stage.TraverseAll():
        for attribute in prim.GetAuthoredAttributes():
            times.update(attribute.GetTimeSamples())
    return sorted(times) or [0.0]


def asset_files(stage: Usd.Stage) -> set[str]:
    """Every file that an asset attribute of the stage names and that is there (textures, photometric files)."""
    files: set[str] = set()
    for prim in stage.TraverseAll():
        for attribute in prim.GetAuthoredAttributes():
            if attribute.GetTypeName() not in (Sdf.ValueTypeNames.Asset, Sdf.ValueTypeNames.AssetArray):
                continue
            for time in [Usd.TimeCode.Default(), *map(Usd.TimeCode, attribute.GetTimeSamples())]:
                value = attribute.Get(time)
                for item in value if attribute.GetTypeName() == Sdf.ValueTypeNames.AssetArray else [value]:
                    if item and item.resolvedPath and Path(item.resolvedPath).is_file():
                        files.add(item.resolvedPath)
    return files

"""Write into a stage what differs between the scenes it gives and scenes that were changed: poses, lamps, cameras,
materials. What does not differ stays as it stands in the file, and so do references, units and axes.

A value that differs alike in every frame stays one value; one that differs from frame to frame gets time samples.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from interchange.brdf.sum import Sum
from interchange.camera import Camera
from interchange.formats import ies_write, usd_lamp, usd_sensor
from interchange.formats.usd_author import (
    TYPES,
    author_brdf,
    author_light,
    free_path,
    stage_from_world,
    usd_value,
)
from interchange.formats.usd_preview import preview_of
from interchange.formats.usd_textures import author_textures, in_a_file, lay, named, only_laid
from interchange.formats.usd_values import matrix
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.parameter import parameters
from interchange.problems import Problem, Severity, Where
from interchange.scene import Scene

SUFFIX = "correction"  # of the transform op that moves a prim
POWERS = ("lamp:power", "lamp:flux")  # stand for the intensity where they are authored
NAMES = Sdf.ValueTypeNames


@dataclass(frozen=True, eq=False)
class Frame:
    """A moment of the stage: the scene that it gives, and the scene that it shall give."""

    time: float
    old: Scene
    new: Scene


def author_changes(stage: Usd.Stage, frames: Sequence[Frame], textures: Path | None = None) -> list[Problem]:
    """Edits the stage's root layer; returns what differs and has no place in the file (losses). ``textures``: what new
    textures' files begin with, which lie beside the stage's own; without it they have no place."""
    lost: list[Problem] = []

    def lose(name: str, message: str) -> None:
        lost.append(Problem(message, Where(stage.GetRootLayer().identifier, name), Severity.LOSS))

    for name in dict.fromkeys(x.name for f in frames for x in f.old.lights):
        pairs = [(f.time, *_both(f.old.lights, f.new.lights, name)) for f in frames]
        if any(a is not b for _, a, b in pairs):
            _light(stage, name, pairs, textures, lose)
    known = {x.name for f in frames for x in f.old.lights}
    for light in {x.name: x for f in frames for x in f.new.lights if x.name not in known}.values():
        if light.texture is not None and not light.texture.file:
            if textures is None:
                lose(light.name, "Its map would have to be another file.")
                continue
            light = replace(light, texture=in_a_file(light.texture, light.name, "map", textures))
        root = stage.GetDefaultPrim()
        author_light(
            stage, free_path(stage, str(root.GetPath()) if root else "", light.name.strip("/")), light
        )
    for name in dict.fromkeys(x.name for f in frames for x in f.old.cameras):
        views = [(f.time, *_both(f.old.cameras, f.new.cameras, name)) for f in frames]
        if any(a is not b for _, a, b in views):
            _camera(stage, name, views, lose)
    for name in dict.fromkeys(n for f in frames for n in f.old.object_names):
        _body(stage, name, frames, lose)
    bare = {name for f in frames[:1] for name in lay(stage, f.old, f.new, lose)}
    for name in dict.fromkeys(n for f in frames for n in f.old.material_names):
        for f in frames:
            before = next((b.material for b in f.old.bodies if b.material.name == name), None)
            after = next((b.material for b in f.new.bodies if b.material.name == name), None)
            if before is not None and after is not None and before is not after:
                _material(stage, before, after, None if name in bare else textures, lose)
                break
    return list(dict.fromkeys(lost))


Lose = Callable[[str, str], None]


def _both(old: Sequence[Any], new: Sequence[Any], name: str) -> tuple[Any, Any]:
    before = next(x for x in old if x.name == name)
    return before, next((x for x in new if x.name == name), before)


def put(prim: Any, name: str, kind: Any, values: Sequence[tuple[float, Any]]) -> None:
    """Set an attribute: once where it has no time samples and all ``values`` (time, value) agree, else at each time."""
    attribute = prim.GetAttribute(name) or prim.CreateAttribute(
        name, kind, custom=":" in name and "inputs" not in name
    )
    first = values[0][1]
    if not attribute.GetNumTimeSamples() and all(_same(v, first) for _, v in values):
        attribute.Set(first)
        return
    for time, value in values:
        attribute.Set(value, time)


def _same(a: Any, b: Any) -> bool:
    return bool(np.array_equal(np.asarray(a), np.asarray(b)))


def scale(prim: Any, name: str, kind: Any, factors: Sequence[tuple[float, Any]]) -> None:
    """Multiply an attribute (its default where it is not authored) by a factor at each time; a vector by a vector."""
    attribute = prim.GetAttribute(name)
    now = []
    for time, factor in factors:
        value = attribute.Get(time) if attribute else None
        value = 1.0 if value is None else value
        many = kind == NAMES.Color3f
        vector = np.broadcast_to(np.asarray(value, np.float64), (3,)) if many else float(value)
        now.append((time, Gf.Vec3f(*(vector * np.asarray(factor)).tolist()) if many else vector * factor))
    put(prim, name, kind, now)


def move(stage: Usd.Stage, path: str, motions: Sequence[tuple[float, np.ndarray]], lose: Lose) -> None:
    """Move a prim by motions of the world, (4, 4) in metres, z up, one a time."""
    prim = stage.GetPrimAtPath(path)
    xform = UsdGeom.Xformable(prim) if prim else None
    if not xform or prim.IsInstanceProxy():
        lose(path, "It has no place of its own in the file, which could be corrected.")
        return
    S = stage_from_world(stage)
    values = []
    for time, by in motions:
        above = matrix(UsdGeom.XformCache(time).GetParentToWorldTransform(prim))
        if xform.GetResetXformStack():
            above = np.eye(4)
        new = np.linalg.inv(above) @ (S @ by @ np.linalg.inv(S)) @ above
        values.append((time, Gf.Matrix4d(new.T.tolist())))
    ops = xform.GetOrderedXformOps()
    op = next((o for o in ops if o.GetOpName() == f"xformOp:transform:{SUFFIX}"), None)
    if op is None:
        op = xform.AddTransformOp(opSuffix=SUFFIX)
        xform.SetXformOpOrder([op, *ops], xform.GetResetXformStack())
    first = np.array(values[0][1])
    if all(
        np.allclose(np.array(v), first, rtol=0, atol=1e-9 * max(1.0, abs(first).max())) for _, v in values
    ):
        op.Set(values[0][1])
        return
    for time, value in values:
        op.Set(value, time)


def _motion(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    return np.asarray(after @ np.linalg.inv(before))


def _light(
    stage: Usd.Stage,
    name: str,
    pairs: Sequence[tuple[float, Light, Light]],
    files: Path | None,
    lose: Lose,
) -> None:
    prim = stage.GetPrimAtPath(name)
    _, before, after = pairs[0]
    if any(not np.array_equal(a.world_from_light, b.world_from_light) for _, a, b in pairs):
        move(stage, name, [(t, _motion(a.world_from_light, b.world_from_light)) for t, a, b in pairs], lose)
    if before.texture is not after.texture:
        lose(name, "Its texture would have to be another file.")
    if before.profile is not after.profile:
        _profile(prim, before, after, files, lose)
    _sizes(prim, pairs)
    shaped = ("cone_angle", "cone_softness", "focus")
    if any(getattr(a, f) != getattr(b, f) for _, a, b in pairs for f in shaped):
        new = not prim.HasAPI(UsdLux.ShapingAPI)
        api = UsdLux.ShapingAPI.Apply(prim)
        if new or before.cone_angle != after.cone_angle:
            api.CreateShapingConeAngleAttr(float(np.degrees(after.cone_angle)))
        api.CreateShapingConeSoftnessAttr(after.cone_softness)
        api.CreateShapingFocusAttr(after.focus)
        api.CreateShapingFocusTintAttr(Gf.Vec3f(*after.focus_tint))
    for field, attribute in usd_lamp.STROBE.items():
        values = [(t, getattr(b.strobe, field)) for t, _, b in pairs]
        if any(
            getattr(a.strobe, field) != value for (_, a, _), (_, value) in zip(pairs, values, strict=True)
        ):
            usd_lamp.author_strobe(prim, after.strobe)
            put(prim, attribute, usd_lamp.strobe_type(field), values)
    if before.casts_shadows != after.casts_shadows:
        UsdLux.ShadowAPI.Apply(prim).CreateShadowEnableAttr(after.casts_shadows)
    normalized = bool(prim.GetAttribute("inputs:normalize").Get())
    factors = []
    for time, a, b in pairs:
        r = np.divide(b.intensity, a.intensity, out=np.ones(3), where=np.asarray(a.intensity) > 0)
        if not normalized and a.projected_area > 0:
            r = r * a.projected_area / max(b.projected_area, 1e-30)
        factors.append((time, r))
    if all(np.allclose(r, 1.0, rtol=1e-12) for _, r in factors):
        return
    powers = [p for p in POWERS if prim.GetAttribute(p) and prim.GetAttribute(p).HasAuthoredValue()]
    colored = powers or usd_lamp.has_spectrum(prim)
    if colored and any(np.ptp(r) > 1e-9 for _, r in factors):
        lose(name, "Its colour follows from its spectrum and cannot be corrected by channels.")
        return
    for attribute in powers:
        scale(prim, attribute, NAMES.Double, [(t, float(r[0])) for t, r in factors])
    if not powers:
        scale(prim, "inputs:intensity", NAMES.Float, [(t, float(r.max())) for t, r in factors])
        if any(np.ptp(r) > 1e-9 for _, r in factors):
            lit = [(t, r / r.max()) for (t, r), (_, a, _) in zip(factors, pairs, strict=True) if a.is_on]
            scale(prim, "inputs:color", NAMES.Color3f, lit)


def _profile(prim: Any, before: Light, after: Light, files: Path | None, lose: Lose) -> None:
    """Its measured beam, in a file of its own whose name begins with ``files``."""
    if files is None or after.profile is None or before.profile_angle_scale != after.profile_angle_scale:
        lose(before.name, "Its measured beam would have to be another file.")
        return
    path = named(files, before.name, ".ies")
    ies_write.write(path, after.profile)
    new = not prim.HasAPI(UsdLux.ShapingAPI)
    api = UsdLux.ShapingAPI.Apply(prim)
    if new:
        api.CreateShapingConeAngleAttr(float(np.degrees(after.cone_angle)))
    api.CreateShapingIesFileAttr(path.name)
    api.CreateShapingIesNormalizeAttr(False)


def _sizes(prim: Any, pairs: Sequence[tuple[float, Light, Light]]) -> None:
    unit = UsdGeom.GetStageMetersPerUnit(prim.GetStage())
    for field, per in (
        ("radius", unit),
        ("width", unit),
        ("height", unit),
        ("length", unit),
        ("angle", np.pi / 180),
    ):
        if all(getattr(a, field) == getattr(b, field) for _, a, b in pairs):
            continue
        name = f"inputs:{field}"
        values = []
        for time, a, b in pairs:
            old, new = getattr(a, field), getattr(b, field)
            now = prim.GetAttribute(name).Get(time)
            values.append((time, float(now * new / old) if old > 0 and now else new / per))
        put(prim, name, NAMES.Float, values)
        if pairs[0][1].kind is LightKind.SPHERE and prim.GetAttribute("treatAsPoint").Get():
            prim.GetAttribute("treatAsPoint").Set(False)


def _camera(stage: Usd.Stage, name: str, views: Sequence[tuple[float, Camera, Camera]], lose: Lose) -> None:
    prim = stage.GetPrimAtPath(name)
    _, before, after = views[0]
    if any(not np.array_equal(a.world_from_camera, b.world_from_camera) for _, a, b in views):
        motions = [(t, _motion(a.world_from_camera, b.world_from_camera)) for t, a, b in views]
        move(stage, name, motions, lose)
    usd, tenth = UsdGeom.Camera(prim), 0.1 * UsdGeom.GetStageMetersPerUnit(stage)
    if before.lens.focal_length != after.lens.focal_length:
        usd.GetFocalLengthAttr().Set(after.lens.focal_length / tenth)
    if before.lens.f_stop != after.lens.f_stop or before.lens.focus_distance != after.lens.focus_distance:
        usd.GetFStopAttr().Set(after.lens.f_stop)
        usd.GetFocusDistanceAttr().Set(after.lens.focus_distance * 0.1 / tenth)
    if before.principal_point != after.principal_point and after.principal_point is not None:
        (w, h), (px, py), (cx, cy) = after.sensor.resolution, after.sensor.pixel_pitch, after.principal_point
        usd.CreateHorizontalApertureOffsetAttr(((w - 1) / 2 - cx) * px / tenth)
        usd.CreateVerticalApertureOffsetAttr((cy - (h - 1) / 2) * py / tenth)
    if before.lens.distortion != after.lens.distortion:
        put(prim, "lens:distortion", NAMES.FloatArray, [(0.0, list(after.lens.distortion))])
    kept = {a.field for a in usd_sensor.ATTRIBUTES} | {
        "focal_length", "f_stop", "focus_distance", "distortion"
    }  # fmt: skip
    for part in ("lens", "sensor"):
        a, b = getattr(before, part), getattr(after, part)
        for f in fields(a):
            if getattr(a, f.name) != getattr(b, f.name) and f.name not in kept:
                lose(name, f"Its {f.name} has no attribute.")
    usd_sensor.author(prim, after)


def _body(stage: Usd.Stage, name: str, frames: Sequence[Frame], lose: Lose) -> None:
    motions, moved = [], False
    for f in frames:
        a = next((b for b in f.old.bodies if b.name == name), None)
        b = next((b for b in f.new.bodies if b.name == name), None)
        if a is None or b is None:
            motions.append((f.time, np.eye(4)))
            continue
        if a.mesh is not b.mesh and not only_laid(a.mesh, b.mesh):
            lose(name, "Its shape would have to be another mesh.")
        if a.world_from_body is b.world_from_body or np.array_equal(a.world_from_body, b.world_from_body):
            motions.append((f.time, np.eye(4)))
            continue
        moved = True
        motions.append((f.time, _motion(a.world_from_body, b.world_from_body)))
    if moved:
        move(stage, name, motions, lose)


def _material(stage: Usd.Stage, before: Material, after: Material, textures: Path | None, lose: Lose) -> None:
    prim = stage.GetPrimAtPath(before.name)
    material = UsdShade.Material(prim) if prim else None
    if not material or prim.IsInstanceProxy():
        lose(before.name, "The material has no prim of its own, which could be corrected.")
        return
    new = {n: t for n, t in after.maps.items() if before.maps.get(n) is not t}
    if new and textures is None:
        lose(before.name, "Its textures would have to be other files, laid on all that it is on.")
        return
    for f in ("normal_map", "emission", "emission_map", "opacity", "opacity_map", "glsl"):
        if getattr(before, f) != getattr(after, f):
            lose(before.name, f"Its {f} has changed, which is not written.")
    if before.brdf == after.brdf and not new:
        return
    source = material.GetOutput("brdf:surface") or material.GetSurfaceOutput()
    connected = source.GetConnectedSources()[0] if source else []
    shader = UsdShade.Shader(connected[0].source.GetPrim()) if connected else None
    if shader and type(after.brdf) is type(before.brdf):
        _inputs(shader, before.brdf, after.brdf, before.name, lose)
        if new and textures is not None:
            why = author_textures(shader, before.name, new, textures, list(parameters(after.brdf)))
            if why:
                lose(before.name, why)
    elif after.maps:
        lose(before.name, "Its model would have to be another one, which its textures do not fit.")
        return
    else:
        new = UsdShade.Shader.Define(stage, free_path(stage, before.name, "Corrected"))
        author_brdf(stage, new, after.brdf, {})
        material.CreateSurfaceOutput("brdf").ConnectToSource(new.CreateOutput("surface", NAMES.Token))
    preview = material.ComputeSurfaceSource()[0]
    if preview and (not shader or preview.GetPath() != shader.GetPath()):
        looks = preview_of(after.brdf)
        for name, about in parameters(looks).items():
            there = preview.GetInput(name)
            if there and not there.HasConnectedSource():
                there.Set(usd_value(getattr(looks, name), about.kind, about.per_lobe))


def _inputs(shader: Any, before: Any, after: Any, name: str, lose: Lose) -> None:
    """The inputs of one shader whose values differ; of a sum, those of its parts."""
    if isinstance(before, Sum):
        for k, (a, b) in enumerate(zip(before.parts, after.parts, strict=True)):
            source = shader.GetInput(f"part{k}").GetConnectedSources()[0]
            if a != b and source:
                _inputs(UsdShade.Shader(source[0].source.GetPrim()), a, b, name, lose)
            if before.weight[k] != after.weight[k]:
                shader.CreateInput(f"weight{k}", NAMES.Color3f).Set(Gf.Vec3f(*after.weight[k]))
        return
    for parameter, about in parameters(after).items():
        old, new = getattr(before, parameter), getattr(after, parameter)
        if old == new:
            continue
        there = shader.GetInput(parameter)
        if there and there.HasConnectedSource():
            lose(name, f"Its {parameter} comes from a texture, which would have to be another file.")
            continue
        there = there or shader.CreateInput(parameter, TYPES[about.kind, about.per_lobe])
        there.Set(usd_value(new, about.kind, about.per_lobe))


@dataclass(frozen=True)
class Moment:
    """A new time code: the poses of time code ``like``, and ``lamps`` on as bright as they ever are, the others off."""

    time: float
    like: float
    lamps: tuple[str, ...]


def author_moments(
    stage: Usd.Stage, times: Sequence[float], lamps: Sequence[str], moments: Sequence[Moment]
) -> None:
    """Add time codes to a stage, behind its own (``times``); ``lamps``: the prim paths of all of them."""
    for prim in stage.Traverse():
        for attribute in prim.GetAuthoredAttributes():
            if attribute.GetNumTimeSamples():
                for value, moment in [(attribute.Get(m.like), m) for m in moments]:
                    attribute.Set(value, moment.time)
    for path in lamps:
        prim = stage.GetPrimAtPath(path)
        powers = [p for p in POWERS if prim.GetAttribute(p) and prim.GetAttribute(p).HasAuthoredValue()]
        for name in powers or ["inputs:intensity"]:
            attribute = prim.GetAttribute(name) or prim.CreateAttribute(name, NAMES.Float)
            own = [(t, attribute.Get(t)) for t in times]
            own = [(t, 1.0 if v is None else v) for t, v in own]
            for t, value in own:
                attribute.Set(value, t)
            most = max(v for _, v in own)
            for m in moments:
                attribute.Set(most if path in m.lamps else 0.0, m.time)
    stage.SetEndTimeCode(max(stage.GetEndTimeCode(), *(m.time for m in moments)))

"""Edits of numbers: a lamp's, a camera's and a material's, under the names that the program has for them.

What is written is the attribute that the reader takes the number from; the unit is the program's (m, rad, W/sr).
An animated attribute gets a new sample at the time given.
"""

from dataclasses import replace
from enum import StrEnum
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from interchange.brdf import BY_NAME, Brdf
from interchange.brdf.usd_preview_surface import UsdPreviewSurface
from interchange.camera import Camera, Projection
from interchange.formats import usd_lamp, usd_sensor
from interchange.formats.usd_author import TYPES, author_brdf, usd_value
from interchange.formats.usd_edit_prims import prim_at
from interchange.formats.usd_preview import preview_of
from interchange.light import Light, LightKind
from interchange.parameter import parameters
from interchange.problems import BrightfieldError, did_you_mean

NAMES = Sdf.ValueTypeNames
PREVIEW_FIELDS = {"emission": "emissiveColor", "opacity": "opacity", "opacity_threshold": "opacityThreshold"}
LIGHT_FIELDS = (
    "intensity", "color", "radius", "width", "height", "length", "angle", "cone_angle", "cone_softness", "focus",
    "casts_shadows", "visible", "power", "flux", "spectrum", "profile", "texture",
    *(f"strobe.{field}" for field in usd_lamp.STROBE),
)  # fmt: skip


def set_light(stage: Usd.Stage, light: Light, name: str, value: Any, time: float | None) -> None:
    """``name``: a field of ``Light``; or intensity (of the brightest channel), color (relative), power (W), flux (lm),
    spectrum (a name). ``profile`` and ``texture`` take a file's path; ``strobe.duration``
    and the like are the strobe's."""
    prim = prim_at(stage, light.name)
    unit = UsdGeom.GetStageMetersPerUnit(stage)

    def get(word: str) -> Any:
        attribute = prim.GetAttribute(f"inputs:{word}")
        return attribute.Get(_code(time)) if attribute else None

    match name:
        case "intensity":
            for authored in ("lamp:power", "lamp:flux"):
                if prim.GetAttribute(authored).HasValue():
                    raise BrightfieldError(
                        f"{light.name} is given by its {authored[5:]}; change that, or remove it first."
                    )
            peak = max(light.intensity)
            if peak > 0:
                new = float(get("intensity")) * float(value) / peak
            else:
                factor = {LightKind.SPHERE: 4.0, LightKind.CYLINDER: np.pi}.get(light.kind, 1.0)
                new = float(value) * factor / 2.0 ** float(get("exposure") or 0.0)
                if light.kind is not LightKind.DOME:
                    UsdLux.LightAPI(prim).CreateNormalizeAttr(True)
            _check("intensity", new, 0, 1e30)
            _put(prim, "inputs:intensity", NAMES.Float, new, time, custom=False)
        case "color" if usd_lamp.has_spectrum(prim):
            raise BrightfieldError(
                f"{light.name} has the colour of its spectrum; change that, or remove it first."
            )
        case "color":
            color = np.broadcast_to(np.asarray(value, np.float64), 3)
            if not (np.isfinite(color).all() and (color >= 0).all() and color.max() > 0):
                raise BrightfieldError(f"A lamp's colour must be three numbers from 0 up; got {value}.")
            old = np.asarray(get("color") if get("color") is not None else (1, 1, 1), np.float64)
            color = (
                color / color.max() * max(float(old.max()), 1e-12)
            )  # the brightest channel stays what it is
            _put(prim, "inputs:color", NAMES.Color3f, Gf.Vec3f(*color.tolist()), time, custom=False)
        case "radius" | "width" | "height" | "length":
            _check(name, value, 0, 1e6)
            own, current = get(name), getattr(light, name)
            size = float(own) * float(value) / current if own and current > 0 else float(value) / unit
            _put(prim, f"inputs:{name}", NAMES.Float, size, time, custom=False)
            if name == "radius" and prim.GetAttribute("treatAsPoint").Get():
                prim.GetAttribute("treatAsPoint").Set(value == 0)
        case "angle":
            _check(name, value, 0, 2 * np.pi)
            _put(prim, "inputs:angle", NAMES.Float, float(np.degrees(value)), time, custom=False)
        case "cone_angle" | "cone_softness" | "focus":
            _shape(prim, light, name, value, time)
        case "casts_shadows":
            UsdLux.ShadowAPI.Apply(prim).CreateShadowEnableAttr().Set(bool(value))
        case "visible":
            _put(prim, "lamp:visible", NAMES.Bool, bool(value), None)
        case "power" | "flux":
            _check(name, value, 0, 1e12)
            other = "lamp:flux" if name == "power" else "lamp:power"
            prim.RemoveProperty(other)
            _put(prim, f"lamp:{name}", NAMES.Double, float(value), time)
        case _ if name in LIGHT_FIELDS and name.startswith("strobe."):
            field = name.removeprefix("strobe.")
            strobe = replace(light.strobe, **{field: value})  # checks it
            if not prim.HasAttribute(usd_lamp.STROBE["duration"]):
                usd_lamp.author_strobe(prim, light.strobe)
            kind = usd_lamp.strobe_type(field)
            _put(prim, usd_lamp.STROBE[field], kind, getattr(strobe, field), time)
        case "spectrum":
            if value:
                _put(prim, "lamp:spectrum", NAMES.String, str(value), None)
            else:
                prim.RemoveProperty("lamp:spectrum")
        case "profile":
            UsdLux.ShapingAPI.Apply(prim).CreateShapingIesFileAttr().Set(str(value))
            _shape(prim, light, "cone_angle", light.cone_angle, time)
        case "texture" if light.kind in (LightKind.RECT, LightKind.DOME):
            _put(prim, "inputs:texture:file", NAMES.Asset, str(value), None, custom=False)
        case _:
            raise BrightfieldError(
                f'A {light.kind} lamp has no number "{name}" to change.{did_you_mean(name, LIGHT_FIELDS)}'
            )


def _shape(prim: Any, light: Light, name: str, value: Any, time: float | None) -> None:
    """ShapingAPI's own default is a cone of 90 degrees: what it says is written in full."""
    high = np.pi if name == "cone_angle" else 1.0 if name == "cone_softness" else 1e6
    _check(name, value, 0, high)
    shaping = UsdLux.ShapingAPI.Apply(prim)
    shaping.CreateShapingConeAngleAttr()
    if not prim.GetAttribute("inputs:shaping:cone:angle").HasAuthoredValue() or name == "cone_angle":
        cone = float(value) if name == "cone_angle" else light.cone_angle
        _put(prim, "inputs:shaping:cone:angle", NAMES.Float, float(np.degrees(cone)), time, custom=False)
    if name != "cone_angle":
        word = {"cone_softness": "cone:softness", "focus": "focus"}[name]
        _put(prim, f"inputs:shaping:{word}", NAMES.Float, float(value), time, custom=False)


def set_camera(stage: Usd.Stage, camera: Camera, new: Camera, time: float | None) -> None:
    """Write what differs between a camera as it was read and as it should be; the pose is ``place``'s."""
    prim = prim_at(stage, camera.name)
    usd_sensor.check(new)
    usd = UsdGeom.Camera(prim)
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    tenth = 0.1 * unit
    old_lens, lens, old_sensor, sensor = camera.lens, new.lens, camera.sensor, new.sensor

    def put(attribute: Any, value: Any) -> None:
        _put_in(attribute, value, time)

    (width, height), (px, py) = sensor.resolution, sensor.pixel_pitch
    if sensor.resolution != old_sensor.resolution or not prim.HasAttribute("sensor:resolution"):
        _put(prim, "sensor:resolution", NAMES.Int2, Gf.Vec2i(width, height), None)
    if (sensor.resolution, sensor.pixel_pitch) != (old_sensor.resolution, old_sensor.pixel_pitch):
        put(usd.CreateHorizontalApertureAttr(), width * px / tenth)
        put(usd.CreateVerticalApertureAttr(), height * py / tenth)
    geometry = (sensor.resolution, sensor.pixel_pitch, new.principal_point)
    if geometry != (old_sensor.resolution, old_sensor.pixel_pitch, camera.principal_point):
        cx, cy = new.principal_point or ((width - 1) / 2, (height - 1) / 2)
        if new.principal_point is not None or usd.GetHorizontalApertureOffsetAttr().HasAuthoredValue():
            put(usd.CreateHorizontalApertureOffsetAttr(), ((width - 1) / 2 - cx) * px / tenth)
            put(usd.CreateVerticalApertureOffsetAttr(), (cy - (height - 1) / 2) * py / tenth)
    if lens.focal_length != old_lens.focal_length:
        put(usd.CreateFocalLengthAttr(), lens.focal_length / tenth)
    if lens.f_stop != old_lens.f_stop:
        put(usd.CreateFStopAttr(), lens.f_stop)
    if lens.focus_distance != old_lens.focus_distance:
        put(usd.CreateFocusDistanceAttr(), lens.focus_distance / unit)
    if lens.projection is not old_lens.projection:
        telecentric = lens.projection is Projection.ORTHOGRAPHIC
        usd.CreateProjectionAttr().Set(
            UsdGeom.Tokens.orthographic if telecentric else UsdGeom.Tokens.perspective
        )
    if new.clip != camera.clip:
        put(usd.CreateClippingRangeAttr(), Gf.Vec2f(*(c / unit for c in new.clip)))
    if new.t_exp != camera.t_exp:
        put(usd.CreateExposureTimeAttr(), new.t_exp)
    if lens.distortion != old_lens.distortion:
        _put(prim, "lens:distortion", NAMES.FloatArray, list(lens.distortion), time)
    if lens.model is not old_lens.model:
        _put(prim, "lens:model", NAMES.Token, lens.model.value, None)
    for a in usd_sensor.ATTRIBUTES:
        value = getattr(getattr(new, a.part), a.field)
        if value != getattr(getattr(camera, a.part), a.field):
            _put(prim, a.name, a.kind, _plain(value, a.kind), time)


def _plain(value: Any, kind: Any) -> Any:
    if isinstance(value, StrEnum):
        return value.value
    if kind == NAMES.Double3:
        return Gf.Vec3d(*value)
    return list(value) if isinstance(value, tuple) else value


def set_brdf(stage: Usd.Stage, material: str, brdf: Brdf) -> None:
    """Give a material another BRDF, textures of the old one gone; its preview surface follows for other software."""
    usd = UsdShade.Material(prim_at(stage, material))
    if not usd:
        raise BrightfieldError(f'"{material}" is not a material.')
    shader, preview = surfaces(usd)
    if isinstance(brdf, UsdPreviewSurface) and preview is None:
        preview = _new_preview(usd)
    if preview is not None:
        stand_in = brdf if isinstance(brdf, UsdPreviewSurface) else preview_of(brdf)
        for name in parameters(stand_in):
            value = getattr(stand_in, name)
            if value != getattr(UsdPreviewSurface(), name) or preview.GetInput(name):
                kind = NAMES.Int if name == "useSpecularWorkflow" else TYPES[_kind(stand_in, name)]
                given = preview.CreateInput(name, kind)
                given.ClearSources()
                given.Set(int(value) if kind == NAMES.Int else usd_value(value, *_kind(stand_in, name)))
    if isinstance(brdf, UsdPreviewSurface):
        output = usd.GetSurfaceOutput("brdf")
        if output:
            output.ClearSources()
            usd.GetPrim().RemoveProperty(output.GetAttr().GetName())
        return
    path = shader.GetPath() if shader is not None else usd.GetPath().AppendChild("Brdf")
    there = UsdShade.Shader(stage.GetPrimAtPath(path))  # of a model before, maybe no longer connected
    if there:
        shader = there
        for child in list(shader.GetPrim().GetChildren()):  # parts of a sum
            stage.RemovePrim(child.GetPath())
        for given in shader.GetInputs():
            given.ClearSources()
            shader.GetPrim().RemoveProperty(given.GetFullName())
        shader.GetPrim().RemoveProperty("info:glsl:sourceCode")
        shader.GetPrim().RemoveProperty("info:implementationSource")
    shader = UsdShade.Shader.Define(stage, path)
    author_brdf(stage, shader, brdf, {})
    usd.CreateSurfaceOutput("brdf").ConnectToSource(shader.CreateOutput("surface", NAMES.Token))


def set_material(stage: Usd.Stage, material: str, name: str, value: Any, time: float | None) -> None:
    """One parameter of a material's BRDF (``n``; ``part0.n`` of a sum's first part), or emission, opacity and
    opacity_threshold. A texture on the parameter is taken away. The value is checked when the scene is read."""
    usd = UsdShade.Material(prim_at(stage, material))
    if not usd:
        raise BrightfieldError(f'"{material}" is not a material.')
    shader, preview = surfaces(usd)
    if name in PREVIEW_FIELDS:
        if preview is None:
            preview = _new_preview(usd)
        kind = NAMES.Color3f if name == "emission" else NAMES.Float
        new = Gf.Vec3f(*value) if name == "emission" else float(value)
        _put_input(preview, PREVIEW_FIELDS[name], kind, new, time)
        return
    target = shader if shader is not None else preview
    if target is None:
        raise BrightfieldError(f'"{material}" has no BRDF; give it one first.')
    *parts, word = name.split(".")
    for part in parts:
        sources, _ = target.GetInput(part).GetConnectedSources() if target.GetInput(part) else ([], [])
        if not sources:
            raise BrightfieldError(f'The BRDF of "{material}" has no part "{part}".')
        target = UsdShade.Shader(sources[0].source.GetPrim())
    model = BY_NAME.get(str(target.GetIdAttr().Get()))
    if model is not None and model.__name__ == "Sum" and word.startswith("weight"):
        _put_input(target, word, NAMES.Color3f, Gf.Vec3f(*value), time)
        return
    about = parameters(model).get(word) if model is not None else None
    if about is None:
        known = list(parameters(model)) if model is not None else []
        raise BrightfieldError(
            f'The BRDF of "{material}" has no parameter "{word}".{did_you_mean(word, known)}'
        )
    kind = NAMES.Int if word == "useSpecularWorkflow" else TYPES[about.kind, about.per_lobe]
    new = int(value) if kind == NAMES.Int else usd_value(value, about.kind, about.per_lobe)
    _put_input(target, word, kind, new, time)


def surfaces(material: UsdShade.Material) -> tuple[UsdShade.Shader | None, UsdShade.Shader | None]:
    """(the shader that holds the BRDF of the catalogue, the preview surface), None for what is not there."""
    preview, _, _ = material.ComputeSurfaceSource()
    preview = preview if preview and preview.GetIdAttr().Get() == "UsdPreviewSurface" else None
    own = material.GetSurfaceOutput("brdf")
    sources, _ = own.GetConnectedSources() if own else ([], [])
    shader = UsdShade.Shader(sources[0].source.GetPrim()) if sources else None
    return shader, preview


def _new_preview(material: UsdShade.Material) -> UsdShade.Shader:
    stage = material.GetPrim().GetStage()
    preview = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("Preview"))
    preview.CreateIdAttr("UsdPreviewSurface")
    material.CreateSurfaceOutput().ConnectToSource(preview.CreateOutput("surface", NAMES.Token))
    return preview


def _kind(brdf: Brdf, name: str) -> tuple[Any, bool]:
    about = parameters(brdf)[name]
    return about.kind, about.per_lobe


def _put_input(shader: UsdShade.Shader, name: str, kind: Any, value: Any, time: float | None) -> None:
    given = shader.CreateInput(name, kind) if not shader.GetInput(name) else shader.GetInput(name)
    if given.HasConnectedSource():
        given.ClearSources()
    _put_in(given.GetAttr(), value, time)


def _put(prim: Any, name: str, kind: Any, value: Any, time: float | None, custom: bool = True) -> None:
    attribute = prim.GetAttribute(name)
    _put_in(attribute if attribute else prim.CreateAttribute(name, kind, custom=custom), value, time)


def _put_in(attribute: Any, value: Any, time: float | None) -> None:
    animated = time is not None and attribute.GetNumTimeSamples() > 0
    attribute.Set(value, _code(time) if animated else Usd.TimeCode.Default())


def _code(time: float | None) -> Usd.TimeCode:
    return Usd.TimeCode.Default() if time is None else Usd.TimeCode(time)


def _check(name: str, value: Any, low: float, high: float) -> None:
    if not (isinstance(value, int | float | np.floating) and low <= value <= high):
        raise BrightfieldError(f"A lamp's {name} must lie in [{low:g}, {high:g}]; got {value}.")

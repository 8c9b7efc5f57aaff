"""UsdLux lights and USD cameras as COLLADA's nearest, with every attribute in <extra>."""

from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom

from interchange.formats.collada.extra import format_numbers, prim_element
from interchange.formats.collada.xml_writer import Output, add, add_extra, add_kept_extras, add_name
from interchange.formats.usd_camera import clipping_range
from interchange.formats.usd_light import read_light
from interchange.formats.usd_read import SceneReader
from interchange.formats.usd_response import scene_response
from interchange.formats.usd_values import Finder
from interchange.light import Light, LightKind


def own_attributes(prim: Usd.Prim) -> list[str]:
    """Authored attributes but those that the node carries."""
    names = [a.GetName() for a in prim.GetAuthoredAttributes()]
    return [n for n in names if not n.startswith("xformOp") and n not in ("visibility", "purpose", "extent")]


def write_light(prim: Usd.Prim, time: Usd.TimeCode, out: Output, reader: SceneReader) -> str | None:
    """The id of a new <light>; None, with a finding, for a lamp that has no numbers."""
    find = Finder(out.find.file)
    light = read_light(
        prim, time, np.eye(4), find, reader.texture, reader.profile, reader.projector,
        lambda: scene_response(reader.stage, time),
    )  # fmt: skip
    for problem in find.problems:
        out.find.loss(problem.message, prim, problem.where.attribute)
    if light is None:
        return None
    name = out.new_id(prim.GetName())
    element = add(out.libraries["lights"], "light", id=name)
    common = add(element, "technique_common")
    unit = UsdGeom.GetStageMetersPerUnit(prim.GetStage())
    match light.kind:
        case LightKind.DISTANT:
            _color(add(common, "directional"), np.array(light.intensity) / np.pi)
        case LightKind.DOME:
            _color(add(common, "ambient"), np.array(light.intensity))
        case _:
            flat = light.kind in (LightKind.RECT, LightKind.DISK)
            shaped = flat or light.cone_angle < np.pi or light.focus > 0
            kind = add(common, "spot" if shaped else "point")
            _attenuated(kind, prim, light, unit)
            if shaped:
                angle = min(2 * np.degrees(light.cone_angle), 180.0 if flat else 360.0)
                add(kind, "falloff_angle", format_numbers(np.array([angle])), sid="falloff_angle")
                exponent = light.focus + (1.0 if flat else 0.0)
                add(kind, "falloff_exponent", format_numbers(np.array([exponent])), sid="falloff_exponent")
    plain = light.kind in (LightKind.DISTANT, LightKind.DOME) or not light.projected_area
    if not plain or light.beam is not None or light.texture is not None or light.focus_tint != (0, 0, 0):
        out.find.note("Other programs see a lamp without size or profile; the whole stands in <extra>.", prim)
    if any(prim.GetAttribute(n).GetNumTimeSamples() > 1 for n in own_attributes(prim)):
        out.find.note("Other programs see the lamp of one frame; its changes stand in <extra>.", prim)
    add_extra(element).append(prim_element(prim, own_attributes(prim), out.folder, out.find))
    add_name(element, prim)
    add_kept_extras(element, prim)
    return name


def _attenuated(kind: Any, prim: Usd.Prim, light: Light, unit: float) -> None:
    """Inverse square, or what the lamp had when it came from a COLLADA file, scaled as it was since."""
    kept = prim.GetCustomDataByKey("collada:attenuation")
    at_first = prim.GetCustomDataByKey("collada:intensity")
    color = np.array(light.intensity) / np.pi
    attenuation = np.array([0.0, 0.0, unit**2])
    if isinstance(kept, Gf.Vec3d) and isinstance(at_first, float) and at_first > 0:
        attenuation = np.array(kept)
        color = 4 * np.array(light.intensity) / at_first
    _color(kind, color)
    for tag, value in zip(("constant", "linear", "quadratic"), attenuation, strict=True):
        add(kind, f"{tag}_attenuation", format_numbers(np.array([value])), sid=f"{tag}_attenuation")


def _color(kind: Any, color: np.ndarray) -> None:
    add(kind, "color", format_numbers(np.array([float(f"{c:.9g}") for c in color])), sid="color")


def write_camera(prim: Usd.Prim, time: Usd.TimeCode, out: Output) -> str | None:
    """The id of a new <camera>; None, with a finding, for one that sees nothing."""
    usd = UsdGeom.Camera(prim)
    width, height = usd.GetHorizontalApertureAttr().Get(time), usd.GetVerticalApertureAttr().Get(time)
    focal = usd.GetFocalLengthAttr().Get(time)
    unit = UsdGeom.GetStageMetersPerUnit(prim.GetStage())
    near, far = (c / unit for c in clipping_range(usd, time, unit))
    if not (width > 0 and height > 0 and focal > 0):
        out.find.loss("A camera needs apertures and a focal length above 0; it is left out.", prim)
        return None
    name = out.new_id(prim.GetName())
    camera = add(out.libraries["cameras"], "camera", id=name)
    common = add(add(camera, "optics"), "technique_common")
    perspective = usd.GetProjectionAttr().Get(time) == UsdGeom.Tokens.perspective
    kind = add(common, "perspective" if perspective else "orthographic")
    # an orthographic magnification is half a height, and the attribute counts in tenths of a unit
    angle = 2 * np.degrees(np.arctan2(height, 2 * focal))
    sizes = [("yfov", angle) if perspective else ("ymag", height / 20)]
    sizes += [("aspect_ratio", width / height), ("znear", near), ("zfar", far)]
    for tag, value in sizes:
        add(kind, tag, format_numbers(np.array([float(f"{value:.9g}")])), sid=tag)
    if usd.GetHorizontalApertureOffsetAttr().Get(time) or usd.GetVerticalApertureOffsetAttr().Get(time):
        out.find.note("Other programs see the principal point in the middle; it stands in <extra>.", prim)
    if any(prim.GetAttribute(n).GetNumTimeSamples() > 1 for n in own_attributes(prim)):
        out.find.note("Other programs see the camera of one frame; its changes stand in <extra>.", prim)
    add_extra(camera).append(prim_element(prim, own_attributes(prim), out.folder, out.find))
    add_name(camera, prim)
    add_kept_extras(camera, prim)
    return name

"""A UsdLux light as a ``Light``: its numbers become physical ones that do not depend on size or stage unit."""

from collections.abc import Callable

import numpy as np
from pxr import Usd, UsdGeom, UsdLux

from interchange.formats.usd_lamp import read_power, read_projector, read_strobe
from interchange.formats.usd_response import Curves
from interchange.formats.usd_values import Finder, asset, rigid
from interchange.frames import z_up_from_y_up
from interchange.light import Light, LightKind, Profile
from interchange.material import Texture
from interchange.problems import FileError
from interchange.projector import Projector

KINDS = {
    "SphereLight": LightKind.SPHERE,
    "DiskLight": LightKind.DISK,
    "RectLight": LightKind.RECT,
    "CylinderLight": LightKind.CYLINDER,
    "DistantLight": LightKind.DISTANT,
    "DomeLight": LightKind.DOME,
    "DomeLight_1": LightKind.DOME,
}


def read_light(
    prim: Usd.Prim,
    time: Usd.TimeCode,
    world_from_prim: np.ndarray,
    find: Finder,
    texture: Callable[..., Texture],
    profile: Callable[[str, bool], Profile],
    keep: Callable[..., Projector],
    curves: Callable[[], Curves],
) -> Light | None:
    """``world_from_prim`` in metres: its scale turns sizes of the stage into metres. None where it cannot be read.

    ``keep`` makes a projector of its parts, the same one of the same parts; ``curves`` gives the response that spectra
    go to channels through."""
    kind = KINDS.get(prim.GetTypeName())
    if kind is None:
        find.error(f"Lights of type {prim.GetTypeName()} cannot be drawn; UsdLux's own shapes can.", prim)
        return None

    def get(name: str, default: float = 0.0) -> float:
        value = find.value(prim, f"inputs:{name}", time)
        return default if value is None else float(value)

    color = np.array(find.value(prim, "inputs:color", time) or (1, 1, 1), np.float64)
    if find.value(prim, "inputs:enableColorTemperature", time):
        color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(get("colorTemperature", 6500)))
    number = get("intensity", 1.0) * 2.0 ** get("exposure") * color
    if not np.isfinite(number).all() or (number < 0).any():
        find.error(
            f"Emission must be finite and not negative; got {tuple(number)}.", prim, "inputs:intensity"
        )
        return None
    for name in ("diffuse", "specular"):
        if get(name, 1.0) != 1.0:
            find.loss(
                f"The unphysical {name} multiplier {get(name):g} is not applied.", prim, f"inputs:{name}"
            )

    pose, scale = rigid(world_from_prim)
    sizes = _sizes(kind, get, scale)
    if any(s < 0 for s in sizes.values()):
        find.error(f"Sizes must not be negative; got {sizes}.", prim)
        return None
    round_axes = {LightKind.SPHERE: (0, 1, 2), LightKind.DISK: (0, 1), LightKind.CYLINDER: (1, 2)}.get(
        kind, ()
    )
    stretched = [scale[i] for i in round_axes]
    if stretched and not np.allclose(stretched, stretched[0], rtol=1e-4):
        find.error("A round lamp must be scaled alike along its round axes; this one is stretched.", prim)
        return None
    normalize = bool(find.value(prim, "inputs:normalize", time))
    intensity = number * _intensity_per_number(kind, sizes, normalize)
    if find.value(prim, "treatAsPoint", time):
        sizes["radius"] = 0.0

    cone, softness, focus, tint, angle_scale, beam = np.pi, 0.0, 0.0, (0.0, 0.0, 0.0), 0.0, None
    if prim.HasAPI(UsdLux.ShapingAPI):
        cone = np.radians(min(get("shaping:cone:angle", 90.0), 180.0))
        softness = min(max(get("shaping:cone:softness"), 0.0), 1.0)
        focus = get("shaping:focus")
        r, g, b = find.value(prim, "inputs:shaping:focusTint", time) or (0, 0, 0)
        tint = (float(r), float(g), float(b))
        angle_scale = get("shaping:ies:angleScale")
        beam = _profile(prim, time, find, profile)
    shown = read_projector(prim, time, find, texture, keep) if kind is LightKind.SPHERE else None
    if shown is not None:  # beyond its image a lens model may fold back
        cone, sizes["radius"] = min(cone, shown.field() + 1e-6), 0.0
    face = _texture(prim, time, find, texture) if kind in (LightKind.RECT, LightKind.DOME) else None
    if kind is LightKind.DOME:
        pole = find.value(prim, "poleAxis", time)
        up = UsdGeom.GetStageUpAxis(prim.GetStage())
        if pole == "Z" or (pole == "scene" and up == "Z"):
            # our dome has its pole along y; longitude 0, +z, goes to -y
            turn = np.eye(4)
            turn[:3, :3] = z_up_from_y_up[:3, :3]
            pose = pose @ turn
    shadow = find.value(prim, "inputs:shadow:enable", time)
    light = Light(
        name=str(prim.GetPath()),
        kind=kind,
        intensity=(float(intensity[0]), float(intensity[1]), float(intensity[2])),
        world_from_light=pose,
        cone_angle=float(cone),
        cone_softness=softness,
        focus=focus,
        focus_tint=tint,
        profile=beam,
        profile_angle_scale=angle_scale,
        texture=face,
        projector=shown,
        strobe=read_strobe(prim, time, find),
        casts_shadows=shadow is not False,
        visible=bool(find.value(prim, "lamp:visible", time)),
        where=find.where(prim),
        radius=sizes.get("radius", 0.0),
        width=sizes.get("width", 0.0),
        height=sizes.get("height", 0.0),
        length=sizes.get("length", 0.0),
        angle=sizes.get("angle", 0.0),
    )
    return read_power(prim, time, find, light, curves)


def _sizes(kind: LightKind, get: Callable[[str, float], float], scale: np.ndarray) -> dict[str, float]:
    match kind:
        case LightKind.SPHERE | LightKind.DISK:
            return {"radius": get("radius", 0.5) * float(scale[0])}
        case LightKind.RECT:
            return {
                "width": get("width", 1.0) * float(scale[0]),
                "height": get("height", 1.0) * float(scale[1]),
            }
        case LightKind.CYLINDER:
            return {
                "radius": get("radius", 0.5) * float(scale[1]),
                "length": get("length", 1.0) * float(scale[0]),
            }
        case LightKind.DISTANT:
            return {"angle": float(np.radians(min(max(get("angle", 0.53), 0.0), 360.0)))}
        case LightKind.DOME:
            return {}


def _intensity_per_number(kind: LightKind, size: dict[str, float], normalize: bool) -> float:
    """What one unit of radiance (or, with ``normalize``, of radiance x area) is in ``Light.intensity``'s unit."""
    r = size.get("radius", 0.0)
    match kind:
        case LightKind.SPHERE:
            return 0.25 if normalize else np.pi * r**2
        case LightKind.DISK:
            return 1.0 if normalize else np.pi * r**2
        case LightKind.RECT:
            return 1.0 if normalize else size["width"] * size["height"]
        case LightKind.CYLINDER:
            return 1 / np.pi if normalize else 2 * r * size["length"]
        case LightKind.DISTANT:
            if normalize or size["angle"] == 0.0:
                return 1.0
            return float(np.pi * np.sin(min(size["angle"], np.pi) / 2) ** 2)
        case LightKind.DOME:
            return 1.0


def _profile(
    prim: Usd.Prim, time: Usd.TimeCode, find: Finder, load: Callable[[str, bool], Profile]
) -> Profile | None:
    name = "inputs:shaping:ies:file"
    written, file = asset(prim.GetAttribute(name), time)
    if not written:
        return None
    if not file:
        find.error(f'The photometric file "{written}" is not there.', prim, name)
        return None
    try:
        return load(file, bool(find.value(prim, "inputs:shaping:ies:normalize", time)))
    except FileError as error:
        find.error(str(error), prim, name)
        return None


def _texture(
    prim: Usd.Prim, time: Usd.TimeCode, find: Finder, load: Callable[[str], Texture]
) -> Texture | None:
    name = "inputs:texture:file"
    written, file = asset(prim.GetAttribute(name), time)
    if not written:
        return None
    if not file:
        find.error(f'The texture "{written}" is not there.', prim, name)
        return None
    layout = find.value(prim, "inputs:texture:format", time)
    if layout not in (None, "automatic", "latlong"):
        find.error(
            f'Dome textures must be laid out as "latlong"; got "{layout}".', prim, "inputs:texture:format"
        )
        return None
    try:
        return load(file)
    except FileError as error:
        find.error(str(error), prim, name)
        return None

"""COLLADA's lights as UsdLux lights.

COLLADA's lighting equation is k_d I (n . l) for a surface of diffuse colour k_d; a BRDF k_d / pi gives that
under the irradiance pi I. So a colour I becomes

    directional   irradiance pi I
    point, spot   radiant intensity pi I d² / A(d),   A(d) = constant + linear d + quadratic d², d in the file's unit
    ambient       a dome of radiance I: k_a I on a surface with k_a = k_d that nothing shades

A lamp in USD falls off with the square of the distance, so A(d) is exact where only ``quadratic`` is not 0;
otherwise the lamp is as bright as in COLLADA at the centre of the scene, which is said as a loss, and the
three numbers stay in the prim's ``customData`` and go back into a COLLADA file.
``falloff_angle`` is the whole angle of the cone, as FCollada and the reference renderings of the conformance
suite have it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdLux

from interchange.formats.collada.animation import Animations
from interchange.formats.collada.library import Library
from interchange.formats.collada.source import floats

KINDS = ("ambient", "directional", "point", "spot")
ATTENUATION = (("constant_attenuation", 1.0), ("linear_attenuation", 0.0), ("quadratic_attenuation", 0.0))
NUMBER = {
    "ambient": 1.0,
    "directional": np.pi,
    "point": 4 * np.pi,
    "spot": 4 * np.pi,
}  # a normalised sphere: I / 4


@dataclass(frozen=True)
class Lamp:
    """A point or spot light whose intensity waits for the distance at which it is to be right."""

    prim: Usd.Prim
    attenuation: tuple[float, float, float]
    element: Any


def author_light(
    stage: Usd.Stage, path: str, light: Any, lib: Library, animations: Animations
) -> tuple[Usd.Prim, Lamp | None] | None:
    """The prim of a <light>; None, with a finding, where it cannot be read."""
    common = light.find("technique_common")
    kind = next((c for c in (() if common is None else common) if c.tag in KINDS), None)
    if kind is None:
        lib.find.error(f"A light must be one of {', '.join(KINDS)}.", light)
        return None
    define = {"ambient": UsdLux.DomeLight, "directional": UsdLux.DistantLight}.get(
        kind.tag, UsdLux.SphereLight
    )
    usd = define.Define(stage, path)
    usd.CreateIntensityAttr(NUMBER[kind.tag])
    color = kind.find("color")
    numbers = np.ones(3) if color is None else floats(color, lib)
    if numbers is None or len(numbers) < 3 or not np.isfinite(numbers).all() or (numbers < 0).any():
        lib.find.error("A light's colour must be three numbers that are not negative.", light)
        return None
    usd.CreateColorAttr(Gf.Vec3f(*numbers[:3]))
    track = None if color is None else animations.track(color, numbers)
    if track is not None:
        times = track.samples()
        for time, value in zip(times, track.at(times), strict=True):
            usd.GetColorAttr().Set(Gf.Vec3f(*np.maximum(value[:3], 0)), time)
    if kind.tag == "ambient":
        return usd.GetPrim(), None
    usd.CreateNormalizeAttr(True)
    if kind.tag == "directional":
        usd.CreateAngleAttr(0.0)
        return usd.GetPrim(), None
    usd.CreateRadiusAttr(0.0)
    usd.CreateTreatAsPointAttr(True)
    if kind.tag == "spot":
        _shape(usd, kind, lib, animations)
    attenuation = []
    for name, default in ATTENUATION:
        value = number(kind, name, default, lib)
        if not value >= 0:
            lib.find.error(f"<{name}> must not be negative; got {value:g}.", kind)
            return None
        attenuation.append(value)
    if not any(attenuation):
        lib.find.error("The three attenuations of a light must not all be 0.", kind)
        return None
    return usd.GetPrim(), Lamp(usd.GetPrim(), (attenuation[0], attenuation[1], attenuation[2]), light)


def number(parent: Any, name: str, default: float, lib: Library) -> float:
    """The one number in a child element, ``default`` where there is none; NaN, with a finding, where it is bad."""
    child = parent.find(name)
    if child is None or not (child.text or "").strip():
        return default
    values = floats(child, lib, 1)
    return float("nan") if values is None else float(values[0])


def _shape(usd: Any, spot: Any, lib: Library, animations: Animations) -> None:
    shaping = UsdLux.ShapingAPI.Apply(usd.GetPrim())
    for name, default, factor, attribute, high in (
        ("falloff_angle", 180.0, 0.5, shaping.CreateShapingConeAngleAttr(), 360.0),
        ("falloff_exponent", 0.0, 1.0, shaping.CreateShapingFocusAttr(), 1e6),
    ):
        value = number(spot, name, default, lib)
        if not 0 <= value <= high:
            lib.find.error(f"<{name}> must lie in [0, {high:g}]; got {value:g}.", spot)
            continue
        attribute.Set(value * factor)
        element = spot.find(name)
        track = None if element is None else animations.track(element, np.array([value]))
        if track is not None:
            times = track.samples()
            for time, moment in zip(times, track.at(times)[:, 0], strict=True):
                attribute.Set(float(np.clip(moment, 0, high)) * factor, time)
    shaping.CreateShapingConeSoftnessAttr(0.0)


def set_intensities(stage: Usd.Stage, lamps: list[Lamp], lib: Library) -> None:
    """Give each lamp the inverse-square intensity that is right at the centre of the scene."""
    if not lamps:
        return
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_, UsdGeom.Tokens.render])
    box = Gf.Range3d()
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh):
            box.UnionWith(cache.ComputeWorldBound(prim).ComputeAlignedRange())
    xforms = UsdGeom.XformCache()
    for lamp in lamps:
        constant, linear, quadratic = lamp.attenuation
        distance = 1.0
        if not box.IsEmpty():
            here = xforms.GetLocalToWorldTransform(lamp.prim).ExtractTranslation()
            distance = max((here - box.GetMidpoint()).GetLength(), 1e-6 * box.GetSize().GetLength(), 1e-12)
        if constant or linear:
            ratio = distance**2 / (constant + linear * distance + quadratic * distance**2)
            lib.find.loss(
                f"The attenuation {constant:g} + {linear:g} d + {quadratic:g} d² is not an inverse square; "
                f"the lamp is right at {distance * unit:.4g} m, the centre of the scene.",
                lamp.element,
            )
        else:
            ratio = 1.0 / quadratic
        intensity = UsdLux.SphereLight(lamp.prim).GetIntensityAttr()
        intensity.Set(NUMBER["point"] * ratio * unit**2)
        lamp.prim.SetCustomDataByKey("collada:attenuation", Gf.Vec3d(*lamp.attenuation))
        lamp.prim.SetCustomDataByKey("collada:intensity", float(intensity.Get()))

"""COLLADA's cameras as UsdGeomCameras: an angle of view gives the apertures for a lens of ``FOCAL_LENGTH``.

``xmag`` and ``ymag`` are half the width and height of what an orthographic camera sees.
"""

from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom

from interchange.formats.collada.animation import Animations, Track
from interchange.formats.collada.library import Library
from interchange.formats.collada.source import floats

FOCAL_LENGTH = 25e-3  # m: COLLADA gives angles alone
SIZES = {"perspective": ("xfov", "yfov"), "orthographic": ("xmag", "ymag")}


def author_camera(stage: Usd.Stage, path: str, camera: Any, lib: Library, animations: Animations) -> Any:
    """The prim of a <camera>; None, with a finding, where it cannot be read."""
    common = camera.find("optics/technique_common")
    kind = next((c for c in (() if common is None else common) if c.tag in SIZES), None)
    if kind is None:
        lib.find.error("A camera must be perspective or orthographic.", camera)
        return None
    tracks: dict[str, Track] = {}
    for name in (*SIZES[kind.tag], "aspect_ratio", "znear", "zfar"):
        element = kind.find(name)
        if element is None or not (element.text or "").strip():
            continue
        value = floats(element, lib, 1)
        if value is None:
            return None
        tracks[name] = animations.track(element, value) or Track(value, ())
    x, y = SIZES[kind.tag]
    if x not in tracks and y not in tracks:
        lib.find.error(f"A {kind.tag} camera must have {x} or {y}.", kind)
        return None
    if "aspect_ratio" not in tracks and not (x in tracks and y in tracks):
        lib.find.note("The camera names no aspect ratio; its image is taken as square.", kind)

    moving = [t for t in tracks.values() if t.channels]
    times = np.unique(np.concatenate([t.samples() for t in moving])) if moving else np.zeros(0)
    rest = {name: track.base[0] for name, track in tracks.items()}
    size = _size(kind.tag, rest)
    near, far = rest.get("znear", 0.1), rest.get("zfar", 1e4)
    if size is None or not 0 <= near < far:
        wanted = "angles in (0, 180)" if kind.tag == "perspective" else "sizes above 0"
        lib.find.error(f"A camera must have {wanted}, an aspect ratio above 0 and 0 <= znear < zfar.", kind)
        return None
    usd = UsdGeom.Camera.Define(stage, path)
    tenth = 0.1 * UsdGeom.GetStageMetersPerUnit(stage)  # m: the unit of focal length and apertures
    # an orthographic aperture is a width in the scene; the file's unit is ten of the attribute's
    scale = FOCAL_LENGTH / tenth if kind.tag == "perspective" else 10.0
    usd.CreateFocalLengthAttr(FOCAL_LENGTH / tenth)
    usd.CreateProjectionAttr(kind.tag)
    usd.CreateHorizontalApertureAttr(2 * scale * size[0])
    usd.CreateVerticalApertureAttr(2 * scale * size[1])
    usd.CreateClippingRangeAttr(Gf.Vec2f(near, far))
    values = {name: track.at(times)[:, 0] for name, track in tracks.items()}
    for k, time in enumerate(times):
        moment = {name: v[k] for name, v in values.items()}
        size = _size(kind.tag, moment)
        if size is None:
            lib.find.error("An animated camera must keep an angle of view that can be.", kind)
            break
        usd.GetHorizontalApertureAttr().Set(2 * scale * size[0], time)
        usd.GetVerticalApertureAttr().Set(2 * scale * size[1], time)
        usd.GetClippingRangeAttr().Set(Gf.Vec2f(moment.get("znear", near), moment.get("zfar", far)), time)
    return usd.GetPrim()


def _size(kind: str, given: dict[str, float]) -> tuple[float, float] | None:
    """Half width and half height: on the plane at distance 1 (perspective), or in the file's unit."""
    x, y = (given.get(name) for name in SIZES[kind])
    if kind == "perspective":
        if any(a is not None and not 0 < a < 180 for a in (x, y)):
            return None
        x, y = (None if a is None else float(np.tan(np.radians(a) / 2)) for a in (x, y))
    aspect = given.get("aspect_ratio", 1.0)
    if x is None or y is None:
        if not aspect > 0:
            return None
        x, y = (y * aspect, y) if y is not None else (x, None if x is None else x / aspect)
    if x is None or y is None or not (0 < x < np.inf and 0 < y < np.inf):
        return None
    return x, y

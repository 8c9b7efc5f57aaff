"""A UsdGeomCamera with ``sensor:*`` and ``lens:*`` attributes as a ``Camera``."""

from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from interchange.camera import CLIP, Camera, Lens, Projection, Sensor
from interchange.distortion import LensModel
from interchange.formats import usd_sensor
from interchange.formats.usd_values import Finder, rigid
from interchange.frames import gl_from_camera
from interchange.parameter import ParameterError

DEFAULT_WIDTH = 640  # px, for a camera that names no resolution


def read_camera(
    prim: Usd.Prim, time: Usd.TimeCode, world_from_prim: np.ndarray, unit: float, find: Finder
) -> Camera | None:
    """``unit``: metres per stage unit. Returns None, with the reasons in ``find``, where a value cannot be."""
    usd = UsdGeom.Camera(prim)
    tenth = 0.1 * unit
    aperture = (
        np.array([usd.GetHorizontalApertureAttr().Get(time), usd.GetVerticalApertureAttr().Get(time)]) * tenth
    )
    if not (aperture > 0).all():
        width_mm, height_mm = aperture * 1e3
        find.error(
            f"Apertures must be above 0; got {width_mm:g} x {height_mm:g} mm.", prim, "horizontalAperture"
        )
        return None
    resolution = find.value(prim, "sensor:resolution", time)
    if resolution is None:
        resolution = (DEFAULT_WIDTH, max(1, round(DEFAULT_WIDTH * aperture[1] / aperture[0])))
        find.note(
            f"The camera names no sensor:resolution; {resolution[0]} x {resolution[1]} px are taken.", prim
        )
    width, height = (int(n) for n in resolution)
    if not (0 < width <= 65536 and 0 < height <= 65536):
        find.error(
            f"A resolution must lie in [1, 65536] px; got {width} x {height}.", prim, "sensor:resolution"
        )
        return None
    pitch = aperture / (width, height)
    offset = np.array(
        [usd.GetHorizontalApertureOffsetAttr().Get(time), usd.GetVerticalApertureOffsetAttr().Get(time)]
    )
    offset = offset * tenth / pitch
    principal = ((width - 1) / 2 - offset[0], (height - 1) / 2 + offset[1])
    given = usd_sensor.read(prim, time, find)
    model = find.value(prim, "lens:model", time) or LensModel.OPENCV.value
    if model not in list(LensModel):
        known = ", ".join(LensModel)
        find.error(f'lens:model must be one of {known}; got "{model}".', prim, "lens:model")
        return None
    f_stop = usd.GetFStopAttr().Get(time)
    focus = usd.GetFocusDistanceAttr().Get(time) * unit
    orthographic = usd.GetProjectionAttr().Get(time) == UsdGeom.Tokens.orthographic
    near, far = clipping_range(usd, time, unit)
    if not 0 <= near < far:
        find.error(
            f"clippingRange must rise from 0; got ({near / unit:g}, {far / unit:g}).", prim, "clippingRange"
        )
        return None
    try:
        lens = usd_sensor.record(
            Lens,
            focal_length=usd.GetFocalLengthAttr().Get(time) * tenth,
            f_stop=f_stop,  # without a distance in focus, it says exposure alone
            focus_distance=focus,
            distortion=tuple(find.value(prim, "lens:distortion", time) or ()),
            model=LensModel(model),
            projection=Projection.ORTHOGRAPHIC if orthographic else Projection.PERSPECTIVE,
            **given["lens"],
        )
        sensor = usd_sensor.record(
            Sensor,
            resolution=(width, height),
            pixel_pitch=(float(pitch[0]), float(pitch[1])),
            **given["sensor"],
        )
    except ParameterError as error:
        find.error(str(error), prim)
        return None
    pose, scale = rigid(world_from_prim)
    if not np.allclose(scale, scale.mean(), rtol=1e-4):
        if not between_matrices(prim, time):
            find.error(
                "A camera's transform must not stretch one axis more than another.", prim, "xformOpOrder"
            )
            return None
        u, _, vt = np.linalg.svd(world_from_prim[:3, :3])
        pose[:3, :3] = u @ vt  # of two turns about one axis: the one half-way, exactly
    centred = np.allclose(offset, 0.0, atol=1e-9)
    camera = Camera(
        name=str(prim.GetPath()),
        world_from_camera=pose @ gl_from_camera,
        lens=lens,
        sensor=sensor,
        principal_point=None if centred else (float(principal[0]), float(principal[1])),
        clip=(max(near, 1e-6), far),
        t_exp=float(usd.GetExposureTimeAttr().Get(time)),
        where=find.where(prim),
    )
    try:
        if given["lens"] or given["sensor"]:
            usd_sensor.check(camera)
    except ParameterError as error:
        find.error(str(error), prim)
        return None
    return camera


def between_matrices(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    """Whether the prim, or what it hangs from, is between two time samples of a matrix: USD blends their numbers, which
    squeezes what turns."""
    while prim and not prim.IsPseudoRoot():
        for op in UsdGeom.Xformable(prim).GetOrderedXformOps() if prim.IsA(UsdGeom.Xformable) else ():
            if op.GetOpType() == UsdGeom.XformOp.TypeTransform and op.GetNumTimeSamples() > 1:
                low, high = op.GetAttr().GetBracketingTimeSamples(time.GetValue())
                if low < time.GetValue() < high:
                    return True
        prim = prim.GetParent()
    return False


def is_camera(prim: Any) -> bool:
    return bool(prim.IsA(UsdGeom.Camera))


def clipping_range(usd: UsdGeom.Camera, time: Usd.TimeCode, unit: float) -> tuple[float, float]:
    """m. Where nothing is said, ours: the schema's own, from 1 unit on, would cut a station in metres away."""
    given = usd.GetClippingRangeAttr()
    if not given.HasAuthoredValue():
        return CLIP
    near, far = given.Get(time)
    return near * unit, far * unit

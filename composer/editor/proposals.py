"""Where a new lamp or camera goes, so that it is of use at once: sized and aimed by what is in the scene."""

import numpy as np

from composer.editor.commands import AddCamera, AddLamp
from composer.editor.workspace import Workspace

IRRADIANCE = 10.0  # W/m² that a new lamp gives the middle of the scene
FOCAL, HEIGHT, PITCH = 16e-3, 1080, 3.45e-6  # a common lens and sensor


def _scene(on: Workspace) -> tuple[np.ndarray, float]:
    """Middle and size, m, of what there is."""
    chosen = [p for p in on.selection if on.kind(p) in ("mesh", "group")]
    bounds = on.bounds(chosen) if chosen else None
    bounds = on.bounds() if bounds is None else bounds
    if bounds is None:
        return np.zeros(3), 0.1
    return bounds.mean(axis=0), max(float(np.linalg.norm(bounds[1] - bounds[0])), 0.01)


def lamp(on: Workspace, kind: str) -> AddLamp:
    """Above and beside the scene, shining at its middle with 10 W/m² there."""
    middle, size = _scene(on)
    offset = np.array([-0.9, -0.8, 1.6]) * size
    if kind == "distant":
        strength = IRRADIANCE
    elif kind == "dome":
        strength = IRRADIANCE / np.pi
    else:
        strength = IRRADIANCE * float(offset @ offset)
    name = {"sphere": "Lamp", "disk": "DiskLamp", "rect": "AreaLamp", "cylinder": "TubeLamp"}.get(kind)
    return AddLamp(
        kind=kind,
        name=name or {"distant": "DistantLight", "dome": "Dome"}[kind],
        position=_rounded(middle + offset),
        target=_rounded(middle),
        intensity=float(f"{strength:.3g}"),
        size=float(f"{0.25 * size:.2g}"),
    )


def camera(on: Workspace) -> AddCamera:
    """In front of the scene, as far as its lens needs to see all of it."""
    middle, size = _scene(on)
    distance = 1.15 * size * FOCAL / (HEIGHT * PITCH) + size / 2
    towards = np.array([-0.25, -0.8, 0.9])
    eye = middle + distance * towards / np.linalg.norm(towards)
    return AddCamera(
        position=_rounded(eye), target=_rounded(middle), focal_length=FOCAL, pixel_pitch=PITCH, exposure=4e-3
    )


def _rounded(v: np.ndarray) -> tuple[float, float, float]:
    """To tenths of a millimetre."""
    x, y, z = (round(float(c), 4) for c in v)
    return x, y, z

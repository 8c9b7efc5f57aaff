"""Strobed lamps as an exposure has them: one definition for every renderer.

    L(row) = L_steady + Σ share_l(row) L_l

Radiance is linear in the lamps, so a lamp whose flash falls on all rows alike is drawn as a steady one of its share.
A rolling shutter's row r is exposed ``line_time`` · r later: where shares differ by row, lamps are drawn one by one at
the most that a row gets, and the rows of their images weighted. The bands are the sensor's rows before the lens's
blur, which then spreads their edges by as much as it spreads an edge.
"""

from collections.abc import Collection, Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from interchange.camera import Camera
from interchange.image import Image
from interchange.light import Light
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.strobe import Strobe

STROBED = "strobed"  # in ``Image.made_by``: the shutter that the lamps were drawn for


def steady(scene: Scene) -> Scene:
    """The scene with its lamps always on, for views that are no exposure of a camera."""
    if not any(x.strobe.is_there for x in scene.lights):
        return scene
    return replace(scene, lights=tuple(replace(x, strobe=Strobe()) for x in scene.lights))


def shares(strobe: Strobe, camera: Camera, seconds: float) -> np.ndarray:
    """(H,) of each row, the lamp over its steady intensity, in an exposure that begins at ``seconds``."""
    late = camera.sensor.line_time * np.arange(camera.sensor.resolution[1])
    return strobe.share(camera.t_exp, late if strobe.triggered else seconds + late)


def exposed(scene: Scene, camera: Camera) -> tuple[Scene, dict[str, np.ndarray]]:
    """The scene with steady lamps that light the camera's exposure as much, and {lamp: (H,) factor} for the rows of
    those that light some rows less. Raises BrightfieldError where there is no exposure to light."""
    if not any(x.strobe.is_there for x in scene.lights):
        return scene, {}
    rows: dict[str, np.ndarray] = {}
    lights: list[Light] = []
    for light in scene.lights:
        if not light.strobe.is_there:
            lights.append(light)
            continue
        share = shares(light.strobe, camera, scene.seconds)
        most = float(share.max())
        r, g, b = (most * x for x in light.intensity)
        lights.append(replace(light, intensity=(r, g, b), strobe=Strobe()))
        if light.is_on and share.min() < (1 - 1e-9) * most:
            rows[light.name] = share / most
    names = [x.name for x in scene.lights]
    if twice := [n for n in rows if names.count(n) > 1]:
        raise BrightfieldError(
            f"Lamps that flash over a rolling shutter need a name each; {twice[0]} is the name of several."
        )
    return replace(scene, lights=tuple(lights)), rows


def banded(image: Image, rows: Mapping[str, np.ndarray], asked: Collection[str]) -> Image:
    """The image of ``exposed``'s scene, drawn with pass ``light`` (and ``indirect`` where ``direct`` or ``indirect`` is
    asked for), as the rows were lit, with the passes that were ``asked`` for."""
    if not rows:
        return image
    pixels, found = image.pixels, dict(image.passes)
    for name, factor in rows.items():
        less = (factor - 1).astype(np.float32)[:, None, None]
        own = found[f"light:{name}"] * less
        bounced = found.get(f"indirect:{name}", np.float32(0)) * less
        pixels = pixels + own
        for whole, change in (
            ("direct", own - bounced),
            ("indirect", bounced),
            (f"light:{name}", own),
            (f"indirect:{name}", bounced),
        ):
            if whole in found:
                found[whole] = found[whole] + change
    kept = {
        name: plane
        for name, plane in found.items()
        if ("light" in asked or not name.startswith(("light:", "indirect:")))
        and ("indirect" in asked or name.split(":")[0] != "indirect")
    }
    return replace(image, pixels=np.maximum(pixels, 0), passes=kept)  # a sum less its part rounds below 0


def shutter_of(scene: Scene, camera: Camera) -> dict[str, dict[str, Any]]:
    """What ``made_by`` says of an image with strobed lamps; nothing where there are none. ``flash``: when light comes,
    where all of it comes at one time."""
    if not any(x.strobe.is_there for x in scene.lights):
        return {}
    given = [(x.strobe, shares(x.strobe, camera, scene.seconds)) for x in scene.lights if x.is_on]
    times = {strobe for strobe, share in given if share.any()}
    if any(any(b.material.emission) or b.material.emission_map for b in scene.bodies):
        times.add(Strobe())
    about = {
        "seconds": scene.seconds,
        "t_exp_s": camera.t_exp,
        "line_time_s": camera.sensor.line_time,
        "flash": asdict(next(iter(times), Strobe())) if len(times) < 2 else None,
        "bands": any(np.ptp(share) > 1e-9 * share.max() for _, share in given),
    }
    return {STROBED: about}


def lit(image: Image) -> tuple[np.ndarray, np.ndarray]:
    """(H,) each: when the light of each row's exposure begins and ends, over the exposure time. For what moves in it.

    Raises BrightfieldError where that is not one time, alike for all lamps.
    """
    drawn, rows = image.made_by.get(STROBED), len(image.pixels)
    if drawn is None:
        return np.zeros(rows), np.ones(rows)
    if drawn["flash"] is None or drawn["bands"]:
        what = "bands of a flash" if drawn["bands"] else "lamps that light it at different times"
        raise BrightfieldError(
            f"What moves can be exposed from one rendering only where all light comes at one time; this image has "
            f"{what}. Render moments of it (--moments), or take sensor:frameRate away for one that stands still."
        )
    flash = Strobe(**drawn["flash"])
    start = np.arange(rows) * drawn["line_time_s"]
    return flash.lit(drawn["t_exp_s"], start if flash.triggered else drawn["seconds"] + start)


def check_shutter(image: Image, camera: Camera) -> None:
    """Raise BrightfieldError where ``camera`` exposes the image otherwise than its strobed lamps were drawn for."""
    drawn = image.made_by.get(STROBED)
    if drawn is None:
        return
    for key, now, what in (
        ("t_exp_s", camera.t_exp, "an exposure"),
        ("line_time_s", camera.sensor.line_time, "a line time"),
    ):
        if not np.isclose(drawn[key], now, rtol=1e-6, atol=0):
            raise BrightfieldError(
                f"An image with strobed lamps holds for the shutter that it was rendered with, {what} of "
                f"{drawn[key]:g} s; got {now:g} s. Render it with that."
            )

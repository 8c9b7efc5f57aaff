"""An exposure as renderings of its moments, joined row by row: what moves and what flashes, exactly.

    L(row) = Σ_k |[t_k, t_k + Δt] ∩ [late(row), late(row) + t_exp]| / t_exp · L_k(row),   late(row) = row · line_time

L_k is the rendering of moment k, lit as the slice of Δt is. Motion blur, the lean of a rolling shutter, the bands of a
flash and the frozen picture that it leaves follow from it, where things hide each other too; the error falls with Δt.
The scene is taken where it is at the middle of a slice, the frame's time being the middle of row 0's exposure.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from interchange.camera import Camera
from interchange.image import Image
from interchange.lamps.exposed import shutter_of
from interchange.light import Light
from interchange.problems import BrightfieldError
from interchange.scene import Scene

MOST = 10_000
OF_ONE_MOMENT = ("direct", "indirect", "lit", "light", "motion")  # passes that no single moment has


def over_exposure(
    scene_at: Callable[[float], Scene],
    camera_of: Callable[[Scene], Camera],
    render: Callable[[Scene, Camera, int, tuple[str, ...]], Image],
    time: float,
    per_second: float,
    count: int,
    passes: tuple[str, ...] = (),
) -> Image:
    """Radiance over the exposure that ``camera_of`` gives a frame at time code ``time``, by ``count`` renderings.

    ``per_second``: time codes a second. ``render(scene, camera, k, passes)``: moment k, so that noise differs from one
    to the next. ``passes`` are those of the frame's own time. Raises BrightfieldError for a pass that no single moment
    has, and where there is no exposure.
    """
    frame = scene_at(time)
    camera = camera_of(frame)
    if wrong := [p for p in passes if p in OF_ONE_MOMENT]:
        raise BrightfieldError(f"An image of several moments has no pass {', '.join(wrong)}.")
    if not (1 <= count <= MOST and camera.t_exp > 0):
        raise BrightfieldError(
            f"An exposure has 1 to {MOST} moments and lasts longer than 0 s; got {count} in {camera.t_exp:g} s."
        )
    late = camera.sensor.line_time * np.arange(camera.sensor.resolution[1])
    step = (camera.t_exp + late[-1]) / count
    total: np.ndarray | None = None
    for k in range(count):
        begin = k * step
        share = np.clip(np.minimum(begin + step, late + camera.t_exp) - np.maximum(begin, late), 0, None)
        scene = scene_at(time + per_second * (begin + step / 2 - camera.t_exp / 2))
        lights = tuple(_by_frame(x, frame.seconds) for x in scene.lights)
        now = camera_of(scene)
        slice_of = replace(now, t_exp=step, sensor=replace(now.sensor, line_time=0.0))
        image = render(replace(scene, lights=lights, seconds=frame.seconds + begin), slice_of, k, ())
        part = image.pixels * (share / camera.t_exp)[:, None, None]
        total = part if total is None else total + part
    assert total is not None
    seen = render(replace(frame, lights=()), camera, 0, passes).passes if passes else {}
    made_by = {**image.made_by, "time": time, "moments": count}
    return replace(
        image,
        pixels=total.astype(np.float32),
        camera=camera,
        made_by={**made_by, **shutter_of(frame, camera)},
        passes=seen,
    )


def _by_frame(light: Light, seconds: float) -> Light:
    """A lamp that is triggered flashes by its frame's clock, not by each slice's."""
    strobe = light.strobe
    if not (strobe.is_there and strobe.triggered):
        return light
    return replace(light, strobe=replace(strobe, start=strobe.start + seconds, triggered=False))

"""A set-up from numbers: values set, cameras and lamps turned to what they are aimed at, the lens focused."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from analysis.optimise.plan import Plan
from analysis.sweep.placing import PREFIX
from analysis.sweep.placing import scene_of as with_defects
from interchange.camera import Camera
from interchange.effects.parts import bounds, with_cameras, with_lights
from interchange.light import Light
from interchange.scene import Scene


def scene_of(plan: Plan, base: Scene, values: Mapping[str, float]) -> tuple[Scene, Scene | None]:
    """The scene of a set-up, and that with the plan's defects in it, None without any. Raises BrightfieldError."""
    numbers = {**plan.fixed, **values}
    good, _ = with_defects(base, {a: v for a, v in numbers.items() if not a.startswith(PREFIX)}, ())
    good = focused(aimed(good, plan.aim), plan.camera, plan.focus)
    if not plan.defects:
        return good, None
    own = {a: v for a, v in numbers.items() if a.startswith(PREFIX)}
    bad, _ = with_defects(good, own, plan.defects)
    return good, bad


def aimed(scene: Scene, aim: Mapping[str, str]) -> Scene:
    """Cameras and lamps turned about where they stand by the least angle that brings their axis to the middle of the
    object's box."""
    for name, target in aim.items():
        middle = bounds(scene, target).mean(axis=0)
        if any(c.name == name for c in scene.cameras):
            scene = with_cameras(scene, name, partial(_camera_turned, towards=middle))
        else:
            scene = with_lights(scene, name, partial(_light_turned, towards=middle))
    return scene


def _camera_turned(camera: Camera, towards: np.ndarray) -> Camera:
    return replace(camera, world_from_camera=turned(camera.world_from_camera, towards, 1.0))


def _light_turned(light: Light, towards: np.ndarray) -> Light:
    return replace(light, world_from_light=turned(light.world_from_light, towards, -1.0))


def turned(world_from_thing: np.ndarray, towards: np.ndarray, sign: float) -> np.ndarray:
    """(4, 4) turned so that ``sign`` z points at ``towards``, by the shortest way (Rodrigues)."""
    axis = sign * world_from_thing[:3, 2]
    aim = towards - world_from_thing[:3, 3]
    length = float(np.linalg.norm(aim))
    if length < 1e-12:
        return world_from_thing
    aim = aim / length
    v, c = np.cross(axis, aim), float(axis @ aim)
    if c < -1 + 1e-12:  # right behind: about any axis at right angles
        v = np.asarray(world_from_thing[:3, 0])
        R = 2 * np.outer(v, v) - np.eye(3)
    else:
        K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
        R = np.eye(3) + K + K @ K / (1 + c)
    new = np.array(world_from_thing)
    new[:3, :3] = R @ world_from_thing[:3, :3]
    return new


def focused(scene: Scene, camera: str, target: str) -> Scene:
    """The lens focused on the middle of the object's box."""
    if not target:
        return scene
    own = scene.camera(camera)
    away = bounds(scene, target).mean(axis=0) - own.world_from_camera[:3, 3]
    distance = max(float(away @ own.world_from_camera[:3, 2]), 1e-6)
    return with_cameras(scene, own.name, lambda c: replace(c, lens=replace(c.lens, focus_distance=distance)))

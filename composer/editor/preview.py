"""The scene as it looks while something is dragged: records moved, the stage untouched until the mouse is released."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from interchange.camera import Camera
from interchange.formats.usd_values import rigid
from interchange.light import Light, LightKind
from interchange.scene import Scene


def moved(scene: Scene, paths: Iterable[str], by: np.ndarray) -> Scene:
    """``scene`` with what lies at or below ``paths`` moved by a motion of the world (4, 4), m."""
    heads = tuple(paths)

    def meant(name: str) -> bool:
        return any(name == p or name.startswith((p + "/", p + "[")) for p in heads)

    return replace(
        scene,
        bodies=tuple(
            replace(b, world_from_body=by @ b.world_from_body) if meant(b.name) else b for b in scene.bodies
        ),
        lights=tuple(_light(x, by) if meant(x.name) else x for x in scene.lights),
        cameras=tuple(_camera(c, by) if meant(c.name) else c for c in scene.cameras),
    )


def _light(light: Light, by: np.ndarray) -> Light:
    pose, scale = rigid(by @ light.world_from_light)
    if light.kind in (LightKind.DISTANT, LightKind.DOME) or np.allclose(scale, 1.0):
        return replace(light, world_from_light=pose)
    return replace(
        light,
        world_from_light=pose,
        radius=light.radius * float(scale[1]),
        width=light.width * float(scale[0]),
        height=light.height * float(scale[1]),
        length=light.length * float(scale[0]),
    )


def _camera(camera: Camera, by: np.ndarray) -> Camera:
    pose = by @ camera.world_from_camera
    linear = pose[:3, :3]
    u, _, vt = np.linalg.svd(linear)
    pose = pose.copy()
    pose[:3, :3] = u @ vt  # a camera turns and moves, it has no size
    return replace(camera, world_from_camera=pose)

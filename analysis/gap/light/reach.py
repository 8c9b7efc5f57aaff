"""Where in an image it can be seen that objects are elsewhere: around their boxes and the shadows of these.

A lamp at p throws the shadow of a point x onto the plane under the scene at x + (x - p) (z - low) / (p_z - z); what
stands between catches it before, on the way there.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from interchange.camera import Camera
from interchange.light import Light, LightKind
from interchange.scene import Scene

MARGIN = 8  # px, for what lenses bend between corners
WHOLE = 16  # px that regions are made of, so that steps of one object share theirs
LOW = 0.05  # of a lamp's distance: lamps that stand lower over a point throw shadows out of every image


def region(scene: Scene, boxes: Sequence[np.ndarray], camera: Camera) -> tuple[slice, slice] | None:
    """Rows and columns that show ``boxes`` (2, 3) m, lowest and highest corner each, or what they throw shadows on;
    None where that may be the whole image."""
    corners = np.concatenate([np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3) for box in boxes])
    ground = float(min(scene.bounds[0, 2], corners[:, 2].min()))
    points = [corners]
    for light in scene.lights:
        cast = _shadows(light, corners, ground)
        if cast is None:
            return None
        points += cast
    seen = camera.project(np.concatenate(points))
    if not np.isfinite(seen).all():
        return None
    width, height = camera.sensor.resolution
    low, high = np.floor(seen.min(axis=0)) - MARGIN, np.ceil(seen.max(axis=0)) + MARGIN + 1
    u0, v0 = np.clip(WHOLE * np.floor(low / WHOLE), 0, [width - 1, height - 1]).astype(int)
    u1, v1 = np.clip(WHOLE * np.ceil(high / WHOLE), [u0 + 1, v0 + 1], [width, height]).astype(int)
    return slice(int(v0), int(v1)), slice(int(u0), int(u1))


def _shadows(light: Light, points: np.ndarray, ground: float) -> list[np.ndarray] | None:
    if not light.casts_shadows or light.kind is LightKind.DOME:
        return []
    M = light.world_from_light
    if light.kind is LightKind.DISTANT:
        along = -M[:3, 2] / np.linalg.norm(M[:3, 2])
        if along[2] > -LOW:
            return None
        return [points + along * ((points[:, 2:] - ground) / -along[2])]
    out = []
    for source in M[:3, 3] + _extent(light):
        away = points - source
        down = -away[:, 2:]
        if (down < LOW * np.linalg.norm(away, axis=1, keepdims=True)).any():
            return None
        out.append(points + away * ((points[:, 2:] - ground) / down))
    return out


def _extent(light: Light) -> np.ndarray:
    """(n, 3) m: its middle, and as far aside as it reaches."""
    size = max(light.radius, light.width / 2, light.height / 2, light.length / 2)
    return size * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])


def cropped(camera: Camera, rows: slice, columns: slice) -> Camera:
    """The same camera, of which only these pixels are read out."""
    cx, cy = camera.K[0, 2], camera.K[1, 2]
    sensor = replace(camera.sensor, resolution=(columns.stop - columns.start, rows.stop - rows.start))
    return replace(camera, sensor=sensor, principal_point=(cx - columns.start, cy - rows.start))

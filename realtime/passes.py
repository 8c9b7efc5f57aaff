"""Passes of an image from one G-buffer through the pixels' centres, in 64 bits.

Depth, position, normal and ids are those of the surface that the pixel's own ray meets: the facet's plane is met
exactly, also under a distorting lens.
"""

from dataclasses import dataclass

import numpy as np

from interchange.camera import Camera
from interchange.frames import apply
from interchange.scene import Scene
from realtime.gbuffer import NOTHING, GBuffer
from realtime.lens import Lensmap
from realtime.view import View


@dataclass(frozen=True, eq=False)
class Centre:
    """What the pixels' centres show. ``body`` (H, W) index into the scene's bodies, -1 where nothing is;
    ``depth`` (H, W), ``position`` and ``normal`` (H, W, 3), NaN where nothing is."""

    body: np.ndarray
    depth: np.ndarray
    position: np.ndarray
    normal: np.ndarray


def centre(
    camera: Camera, view: View, buffer: GBuffer, lensmap: Lensmap | None, origin: np.ndarray
) -> Centre:
    """Read a G-buffer back."""
    assert buffer.facet is not None
    surface, slope = (
        np.frombuffer(t.read(), np.float32).reshape(view.size[1], view.size[0], t.components)
        for t in (buffer.surface, buffer.facet)
    )
    width, height = camera.sensor.resolution
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    if lensmap is None:
        d = view.rays(np.stack([column, row], -1) + 0.5)
        q = surface[..., 0].astype(np.float64)
        found = surface[..., 3] > NOTHING
    else:
        K = camera.K
        d = np.stack(camera.lens.undistort((column - K[0, 2]) / K[0, 0], (row - K[1, 2]) / K[1, 1]), axis=-1)
        window = d * view.focal + view.centre
        finite = np.isfinite(window).all(axis=-1)
        texel = np.where(finite[..., None], np.floor(np.nan_to_num(window)), 0).astype(int)
        inside = finite & (texel >= 0).all(axis=-1) & (texel < view.size).all(axis=-1)
        i, j = np.where(inside, texel[..., 1], 0), np.where(inside, texel[..., 0], 0)
        surface, slope = surface[i, j], slope[i, j]
        off = window - (texel + 0.5)
        q = surface[..., 0] + np.where(inside, slope[..., 0] * off[..., 0] + slope[..., 1] * off[..., 1], 0)
        found = inside & (surface[..., 3] > NOTHING)
    with np.errstate(all="ignore"):
        z = q if view.telecentric else 1 / q
        xy = d if view.telecentric else d * z[..., None]
        position = apply(view.world_from_eye, np.concatenate([xy, z[..., None]], axis=-1)) + origin
        normal = _towards_eye(_from_octahedral(surface[..., 1:3].astype(np.float64)), slope, q, d, view)
    return Centre(
        body=np.where(found, surface[..., 3], -1).astype(np.int32),
        depth=np.where(found, z, np.inf),
        position=np.where(found[..., None], position, np.nan),
        normal=np.where(found[..., None], normal, np.nan),
    )


def _from_octahedral(e: np.ndarray) -> np.ndarray:
    """(H, W, 3) directions of shaders/common.glsl's code (H, W, 2)."""
    z = 1 - np.abs(e).sum(axis=-1, keepdims=True)
    xy = e - np.maximum(-z, 0) * np.where(e >= 0, 1.0, -1.0)
    n = np.concatenate([xy, z], axis=-1)
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def _towards_eye(n: np.ndarray, slope: np.ndarray, q: np.ndarray, d: np.ndarray, view: View) -> np.ndarray:
    """The shading normals (H, W, 3) on the side that is seen, as shaders/lighting_fragment.glsl turns them."""
    g = slope[..., :2] * view.focal
    if view.telecentric:
        facet = np.concatenate([g, np.full_like(q, -1.0)[..., None]], axis=-1)
        ray = np.broadcast_to([0.0, 0.0, 1.0], n.shape)
    else:
        facet = np.concatenate([-g, ((g * d).sum(axis=-1) - q)[..., None]], axis=-1)
        ray = np.concatenate([d, np.ones_like(q)[..., None]], axis=-1)
    R = view.world_from_eye[:3, :3]
    n = np.where(((facet @ R.T) * n).sum(axis=-1, keepdims=True) < 0, -n, n)
    to_eye = -(ray / np.linalg.norm(ray, axis=-1, keepdims=True)) @ R.T
    n = n + np.maximum(1e-3 - (n * to_eye).sum(axis=-1, keepdims=True), 0) * to_eye
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def motion(seen: Centre, scene: Scene, camera: Camera, following: Scene) -> np.ndarray:
    """(H, W, 2) px that each surface point moves until ``following``: bodies and camera both move. Bodies are matched
    by their place in the scene; NaN where nothing is seen, or where the body is gone."""
    height, width = seen.body.shape
    there = next((c for c in following.cameras if c.name == camera.name), camera)
    moved = np.full((height, width, 3), np.nan)
    for i, body in enumerate(scene.bodies):
        mask = seen.body == i
        if not mask.any() or i >= len(following.bodies) or following.bodies[i].name != body.name:
            continue
        to_body = np.linalg.inv(body.world_from_body)
        moved[mask] = apply(following.bodies[i].world_from_body @ to_body, seen.position[mask])
    return (there.project(moved) - camera.project(seen.position)).astype(np.float32)

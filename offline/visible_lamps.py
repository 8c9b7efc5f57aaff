"""Lamps that the camera itself sees: drawn over the path-traced image, ray by ray.

Lamps are no surfaces to Cycles (their light is sampled by the shaders), so what the camera sees of them is added
here: their own radiance, over a grid of rays in each pixel, where nothing stands in front at the pixel's centre. A
dome fills what the image leaves open.
"""

import numpy as np

from interchange.camera import Camera, Projection
from interchange.light import Light, LightKind
from interchange.material import Texture, Wrap, evaluate_texture
from interchange.scene import Scene

GRID = 4  # GRID² rays a pixel


def add(arrays: dict[str, np.ndarray], scene: Scene, camera: Camera) -> None:
    """Add every visible lamp to ``pixels``, ``direct`` and its own ``light``, in place (arrays as in offline.frame)."""
    shown = [
        (k, x)
        for k, x in enumerate(scene.lights)
        if x.visible and (not x.is_delta or x.kind is LightKind.DOME)
    ]
    if not shown:
        return
    position = arrays["position"].astype(np.float64)
    hit = np.rint(arrays["truth"][..., 2]) > 0
    origin = camera.world_from_camera[:3, 3]
    axis = camera.world_from_camera[:3, 2]
    far = np.where(hit, (position - origin) @ axis, np.inf)
    clear = np.clip(1 - arrays["alpha"], 0, 1)  # share of each pixel that shows nothing
    for k, light in shown:
        rows, columns = _window(light, camera)
        radiance, share = _seen(light, camera, far[rows, columns], rows, columns)
        if light.kind in (
            LightKind.DOME,
            LightKind.DISTANT,
        ):  # behind everything: no matter what the centre shows
            share = share * clear[rows, columns]
        keep = 1 - share if light.kind not in (LightKind.DOME, LightKind.DISTANT) else np.ones_like(share)
        for name in ("pixels", "direct"):
            arrays[name][rows, columns] = arrays[name][rows, columns] * keep + radiance * share
        if "light" in arrays:
            arrays["light"][:, rows, columns] *= keep
            arrays["light"][k, rows, columns] += (radiance * share).astype(np.float32)
            arrays["light_indirect"][:, rows, columns] *= keep


def _window(light: Light, camera: Camera) -> tuple[slice, slice]:
    """Rows and columns that can show the lamp."""
    width, height = camera.sensor.resolution
    whole = slice(0, height), slice(0, width)
    if light.kind in (LightKind.DOME, LightKind.DISTANT):
        return whole
    size = max(light.radius, light.width / 2, light.height / 2) + light.length / 2
    corners = size * (np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]))
    pixels = camera.project(corners + light.world_from_light[:3, 3])
    if np.isnan(pixels).any() or camera.lens.distorts:
        return whole
    low, high = np.floor(pixels.min(0)).astype(int) - 1, np.ceil(pixels.max(0)).astype(int) + 2
    (c0, r0), (c1, r1) = (np.clip(p, 0, [width, height]) for p in (low, high))
    return slice(r0, r1), slice(c0, c1)


def _seen(
    light: Light, camera: Camera, far: np.ndarray, rows: slice, columns: slice
) -> tuple[np.ndarray, np.ndarray]:
    """Mean radiance (h, w, 3) of the lamp where it is seen, and the share (h, w, 1) of each pixel that shows it."""
    column, row = np.meshgrid(np.arange(columns.start, columns.stop), np.arange(rows.start, rows.stop))
    total, count = np.zeros((*column.shape, 3)), np.zeros((*column.shape, 1))
    for i in range(GRID):
        for j in range(GRID):
            offset = (np.array([i, j]) + 0.5) / GRID - 0.5
            start, along = camera.rays(np.stack([column, row], axis=-1) + offset)
            distance, value = intersect(light, start, along)
            depth = distance * (along @ camera.world_from_camera[:3, 2])
            if camera.lens.projection is Projection.PERSPECTIVE:
                depth = np.where(np.isnan(depth), np.inf, depth)
            seen = np.isfinite(distance) & (depth < far)
            if light.kind in (LightKind.DOME, LightKind.DISTANT):
                seen = np.isfinite(value[..., 0]) & (distance == np.inf)
            total += np.where(seen[..., None], value, 0)
            count += seen[..., None]
    return total / np.maximum(count, 1), count / GRID**2


def intersect(light: Light, start: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance (...) to the lamp along unit rays (..., 3), NaN for a miss and inf for what is infinitely far, and the
    radiance (..., 3) that it sends back."""
    R = light.world_from_light[:3, :3]
    q, m = (start - light.world_from_light[:3, 3]) @ R, along @ R
    image = np.ones(m.shape)
    with np.errstate(invalid="ignore", divide="ignore"):
        match light.kind:
            case LightKind.SPHERE:
                k = np.sum(q * m, axis=-1)
                distance = -k - np.sqrt(light.radius**2 - np.sum(np.cross(q, m) ** 2, axis=-1))
            case LightKind.DISK | LightKind.RECT:
                distance = np.where(m[..., 2] > 0, -q[..., 2] / m[..., 2], np.nan)
                x, y = (q[..., k] + distance * m[..., k] for k in (0, 1))
                if light.kind is LightKind.DISK:
                    inside = np.hypot(x, y) < light.radius
                else:
                    u, v = 0.5 - x / light.width, 0.5 + y / light.height
                    inside = (np.abs(u - 0.5) < 0.5) & (np.abs(v - 0.5) < 0.5)
                    if light.texture is not None:
                        face = Texture(light.texture.pixels, (Wrap.CLAMP, Wrap.CLAMP))
                        uv = np.where(inside[..., None], np.stack([u, v], axis=-1), 0.0)
                        image = np.broadcast_to(evaluate_texture(face, uv), m.shape)
                distance = np.where(inside, distance, np.nan)
            case LightKind.CYLINDER:
                a = m[..., 1] ** 2 + m[..., 2] ** 2
                k = q[..., 1] * m[..., 1] + q[..., 2] * m[..., 2]
                c = q[..., 1] ** 2 + q[..., 2] ** 2 - light.radius**2
                distance = (-k - np.sqrt(k * k - a * c)) / a
                distance = np.where(
                    np.abs(q[..., 0] + distance * m[..., 0]) < light.length / 2, distance, np.nan
                )
            case LightKind.DISTANT:
                within = m[..., 2] > np.cos(min(light.angle, np.pi) / 2)
                distance = np.where(within, np.inf, np.nan)
            case LightKind.DOME:
                distance = np.full(m.shape[:-1], np.inf)
                if light.texture is not None:
                    u = 0.5 - np.arctan2(m[..., 0], m[..., 2]) / (2 * np.pi)
                    v = 1 - np.arccos(np.clip(m[..., 1], -1, 1)) / np.pi
                    around = Texture(light.texture.pixels, (Wrap.REPEAT, Wrap.CLAMP))
                    image = np.broadcast_to(evaluate_texture(around, np.stack([u, v], axis=-1)), m.shape)
    distance = np.where(distance > 0, distance, np.nan)
    return distance, np.where(
        np.isnan(distance)[..., None], np.nan, light.radiance * light.shaping(-m) * image
    )

"""Lamps at a finite distance: their direction and irradiance differ from pixel to pixel.

w(x) = (p - x) / |p - x|,     E(x) = I / |p - x|²
"""

import numpy as np

from interchange.camera import Camera
from interchange.problems import BrightfieldError


def on_plane(camera: Camera, shape: tuple[int, int], height: float = 0.0) -> np.ndarray:
    """(H, W, 3) m: where the camera's rays meet the plane z = ``height``."""
    origin, ray = pixel_rays(camera, shape)
    return _meet(origin, ray, np.full(shape, height))


def pixel_rays(camera: Camera, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions (H, W, 3) of the rays through the pixels' centres. Raises BrightfieldError."""
    if camera.sensor.resolution != (shape[1], shape[0]):
        width, height = camera.sensor.resolution
        raise BrightfieldError(
            f"The camera must have the images' size, {shape[1]} x {shape[0]} px; it has {width} x {height} px."
        )
    column, row = np.meshgrid(np.arange(shape[1]), np.arange(shape[0]))
    origin, ray = camera.rays(np.stack([column, row], axis=-1).astype(np.float64))
    return np.broadcast_to(origin, ray.shape), ray


def at_heights(camera: Camera, z: np.ndarray) -> np.ndarray:
    """(H, W, 3) m: the surface points of a height map ``z`` (H, W) m over the pixels."""
    origin, ray = pixel_rays(camera, z.shape)  # type: ignore[arg-type]
    return _meet(origin, ray, z)


def _meet(origin: np.ndarray, ray: np.ndarray, z: np.ndarray) -> np.ndarray:
    if not (np.abs(ray[..., 2]) > 1e-3).all():
        raise BrightfieldError("The camera must look at the plane, not along it.")
    return origin + ray * ((z - origin[..., 2]) / ray[..., 2])[..., None]


def seen_from(
    points: np.ndarray, positions: np.ndarray, intensity: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (L, H, W, 3) float32 from ``points`` (H, W, 3) to the lamps, and their irradiance (L, H, W).

    ``positions`` (L, 3) m, ``intensity`` (L,) W/sr.
    """
    to = positions[:, None, None] - points
    distance = np.linalg.norm(to, axis=-1)
    if not (distance > 0).all():
        raise BrightfieldError("A lamp must not lie on the surface.")
    return (to / distance[..., None]).astype(np.float32), intensity[:, None, None] / distance**2

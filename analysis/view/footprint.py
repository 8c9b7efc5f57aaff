"""What a pixel covers on the surface that it sees, and how much it is blurred there.

The rays through the middles of a pixel's four sides meet the tangent plane of the surface; their differences a, b are
the pixel's footprint. Its singular values are the longest and the shortest length of surface to a pixel, |a x b| its
area.
"""

from dataclasses import dataclass

import numpy as np

from interchange.camera import Camera, Projection
from interchange.effects.defocus import Defocus
from interchange.image import Image


@dataclass(frozen=True, eq=False)
class Footprint:
    """(H, W) each, NaN where nothing is seen. ``across``: m per pixel of a surface that faces the camera; ``longest``,
    ``shortest``: m per pixel along the surface; ``area``: m² a pixel; ``slant``: rad between the ray and the normal;
    ``blur``: diameter of the disc of confusion, px, 0 without an f-number."""

    across: np.ndarray
    longest: np.ndarray
    shortest: np.ndarray
    area: np.ndarray
    slant: np.ndarray
    blur: np.ndarray


def footprint(image: Image, camera: Camera) -> Footprint:
    """From the passes ``depth``, ``position`` and ``normal`` of an image by ``camera``."""
    depth, position, normal = (
        np.asarray(image.passes[name], np.float64) for name in ("depth", "position", "normal")
    )
    depth = depth.reshape(depth.shape[:2])
    depth = np.where(np.isfinite(position[..., 0]), depth, np.nan)
    rows, columns = np.indices(depth.shape, float)
    at = np.stack([columns, rows], axis=-1)
    meet = {}
    for name, offset in {"left": (-0.5, 0), "right": (0.5, 0), "up": (0, -0.5), "down": (0, 0.5)}.items():
        origin, direction = camera.rays(at + offset)
        along = np.sum((position - origin) * normal, axis=-1) / np.sum(direction * normal, axis=-1)
        meet[name] = origin + along[..., None] * direction
    a, b = meet["right"] - meet["left"], meet["down"] - meet["up"]
    aa, bb, ab = (np.sum(x * y, axis=-1) for x, y in ((a, a), (b, b), (a, b)))
    half, root = (aa + bb) / 2, np.sqrt(np.maximum(((aa - bb) / 2) ** 2 + ab**2, 0))
    _, direction = camera.rays(at)
    cosine = np.abs(np.sum(direction * normal, axis=-1))
    pitch = float(np.mean(camera.sensor.pixel_pitch))
    telecentric = camera.lens.projection is not Projection.PERSPECTIVE
    across = np.where(
        np.isnan(depth), np.nan, pitch * (1.0 if telecentric else depth / camera.lens.focal_length)
    )
    lens = camera.lens
    blur = np.zeros_like(depth)
    if lens.f_stop > 0 and lens.focus_distance > 0 and not telecentric:
        blur = np.abs(
            Defocus(f_stop=lens.f_stop, focus_distance=lens.focus_distance).confusion(depth, camera)
        )
    return Footprint(
        across,
        np.sqrt(half + root),
        np.sqrt(np.maximum(half - root, 0)),
        np.sqrt(np.maximum(aa * bb - ab**2, 0)),
        np.arccos(np.clip(cosine, 0, 1)),
        np.where(np.isnan(depth), np.nan, blur),
    )

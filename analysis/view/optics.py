"""What a camera sees in numbers, before anything stands in front of it: field of view, scale, depth of field.

    scale        pitch z / v       m on the object per pixel, v the principal distance
    sharp where  z_f / (1 + k) <= z <= z_f / (1 - k),   k = c N z_f pitch / v²

for a disc of confusion of at most c px (thin lens, as in interchange.effects.defocus): from k = 1 on the far limit is
infinite, and z_f is then at least the hyperfocal distance v² / (c N pitch).
"""

from dataclasses import dataclass

import numpy as np

from interchange.camera import Camera, Projection
from interchange.problems import BrightfieldError


@dataclass(frozen=True)
class FieldOfView:
    """``angles``: horizontal, vertical, diagonal, rad, between the rays through opposite edges and corners of the
    image, distortion included (0 for a telecentric lens). ``size``: width and height, m, of what the middle row and
    column see of the plane across the axis at ``distance`` m."""

    angles: tuple[float, float, float]
    size: tuple[float, float]
    distance: float


@dataclass(frozen=True)
class DepthOfField:
    """Depths along the axis, m, between which a point is blurred by at most ``blur`` px."""

    near: float
    far: float
    hyperfocal: float
    blur: float


def field_of_view(camera: Camera, distance: float) -> FieldOfView:
    """Raises BrightfieldError where the lens images nothing at an edge of the sensor."""
    width, height = camera.sensor.resolution
    left, right, top, bottom = -0.5, width - 0.5, -0.5, height - 0.5
    row, column = (height - 1) / 2, (width - 1) / 2
    edges = [(left, row), (right, row), (column, top), (column, bottom), (left, top), (right, bottom)]
    origins, directions = camera.rays(np.array(edges))
    if not np.isfinite(directions).all():
        raise BrightfieldError(f"The lens of {camera.name} images nothing at an edge of its sensor.")
    cosines = np.clip(np.sum(directions[::2] * directions[1::2], axis=-1), -1, 1)
    axis = camera.world_from_camera[:3, 2]
    start = (distance - (origins - camera.world_from_camera[:3, 3]) @ axis) / (directions @ axis)
    points = origins + start[:, None] * directions
    sides = np.linalg.norm(points[1:4:2] - points[0:4:2], axis=-1)
    angles = np.arccos(cosines)
    return FieldOfView(
        (float(angles[0]), float(angles[1]), float(angles[2])), (float(sides[0]), float(sides[1])), distance
    )


def depth_of_field(camera: Camera, blur: float = 1.0) -> DepthOfField:
    """``blur``: the largest disc of confusion, px. Without an f-number everything is sharp. Raises BrightfieldError for
    a telecentric lens, whose depth of field this model does not know."""
    lens = camera.lens
    if lens.f_stop <= 0 or lens.focus_distance <= 0:
        return DepthOfField(0.0, float("inf"), 0.0, blur)
    if lens.projection is not Projection.PERSPECTIVE:
        raise BrightfieldError(
            f"Depth of field needs a perspective lens; that of {camera.name} is telecentric."
        )
    pitch = float(np.mean(camera.sensor.pixel_pitch))
    hyperfocal = lens.focal_length**2 / (blur * lens.f_stop * pitch)
    k = lens.focus_distance / hyperfocal
    far = lens.focus_distance / (1 - k) if k < 1 else float("inf")
    return DepthOfField(lens.focus_distance / (1 + k), far, hyperfocal, blur)

"""Photometric stereo under near lamps: where a pixel lies, and so from where it is lit, follows from its own normals.

Normals, heights by integration, directions and irradiance at these heights, and again, until the heights rest. Clark:
Active photometric stereo. CVPR 1992, in the form of fixed-point iteration as in Quéau et al.: LED-based photometric
stereo. J. Math. Imaging Vision 2018.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from analysis.series.integration import heights
from analysis.series.near_lamps import at_heights, on_plane, seen_from
from analysis.series.photometric_stereo import Method, SurfaceNormals, photometric_stereo
from interchange.camera import Camera, Projection
from interchange.problems import BrightfieldError
from interchange.series import Series


@dataclass(frozen=True, eq=False)
class NearSurface:
    """``heights`` (H, W) m, world z; ``steps`` taken, ``change`` of the last, rms m."""

    normals: SurfaceNormals
    heights: np.ndarray
    steps: int
    change: float


def near_photometric_stereo(
    series: Series,
    plane: float = 0.0,
    method: Method = Method.LEAST_SQUARES,
    steps: int = 8,
    tolerance: float = 1e-7,
    **options: Any,
) -> NearSurface:
    """``series`` has ``positions`` of its lamps, and a telecentric camera that looks along -z. ``plane``: mean height,
    m, which images alone do not tell. Ends where heights change by less than ``tolerance`` m, rms.

    Raises BrightfieldError.
    """
    camera = series.camera
    if series.positions is None or camera is None:
        raise BrightfieldError("Near photometric stereo needs the lamps' positions and the camera.")
    axis = np.asarray(camera.world_from_camera)[:3, :3]
    if (
        camera.lens.projection is not Projection.ORTHOGRAPHIC
        or np.abs(axis - np.diag([1, -1, -1])).max() > 1e-6
    ):
        raise BrightfieldError(
            "Near photometric stereo needs a telecentric camera that looks along -z, y up."
        )
    # what the series took the surface for gives back what the lamps emit
    first = on_plane(camera, series.shape, _assumed_height(series, camera, series.positions[0]))
    to = np.linalg.norm(series.positions[:, None, None] - first, axis=-1)
    intensity = (series.irradiance * to**2).mean(axis=(1, 2))
    z = np.full(series.shape, plane)
    step = 0
    while True:
        wi, irradiance = seen_from(at_heights(camera, z), series.positions, intensity)
        found = photometric_stereo(replace(series, wi=wi, irradiance=irradiance), method, **options)
        new = plane + heights(found.n, camera.sensor.pixel_pitch[0])
        change = float(np.sqrt(np.mean((new - z) ** 2)))
        z, step = new, step + 1
        if change < tolerance or step >= steps:
            return NearSurface(found, z, step, change)


def _assumed_height(series: Series, camera: Camera, position: np.ndarray) -> float:
    """z, m, that the series' directions were worked out for: where the rays to the first lamp come from."""
    w = series.wi[0].astype(np.float64)
    xy = on_plane(camera, series.shape, 0.0)[..., :2]
    across = np.linalg.norm(position[:2] - xy, axis=-1)
    row, column = np.unravel_index(int(np.argmax(across)), across.shape)
    slope = w[row, column, 2] / np.linalg.norm(w[row, column, :2])
    return float(position[2] - slope * across[row, column])

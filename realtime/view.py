"""The pinhole (or telecentric) view that one pass is drawn through.

    window = f d + c,    d = (X / Z, Y / Z), or (X, Y) for a telecentric lens,   eye frame as the camera's

A thin lens is a pinhole that wanders over its aperture (Haeberli, Akeley 1990): the eye moves by e, and the
window by f e / z_f, so that points at the distance in focus stay where they are.
"""

from dataclasses import dataclass

import numpy as np

from interchange.camera import Camera, Projection
from interchange.problems import BrightfieldError
from realtime.lens import Lensmap


@dataclass(frozen=True, eq=False)
class View:
    """``size``: (width, height) of the window, texels; ``world_from_eye``: relative to ``origin``."""

    world_from_eye: np.ndarray  # (4, 4)
    focal: np.ndarray  # (2,) texels per unit of d
    centre: np.ndarray  # (2,) texel edges count: the first texel's centre is 0.5
    size: tuple[int, int]
    telecentric: bool
    near: float
    far: float

    @property
    def clip_from_world(self) -> np.ndarray:
        """(4, 4), depth 1 at ``near`` and 0 at ``far``; the first image row is the window's lowest."""
        scale, shift = 2 * self.focal / self.size, 2 * self.centre / self.size - 1
        n, f = self.near, self.far
        m = np.zeros((4, 4))
        m[0, 0], m[1, 1] = scale
        if self.telecentric:
            m[:2, 3], m[2, 2], m[2, 3], m[3, 3] = shift, -1 / (f - n), f / (f - n), 1
        else:
            m[:2, 2], m[2, 2], m[2, 3], m[3, 2] = shift, -n / (f - n), n * f / (f - n), 1
        return m @ self.eye_from_world

    @property
    def eye_from_world(self) -> np.ndarray:
        """(4, 4); the pose is rigid."""
        R, t = self.world_from_eye[:3, :3], self.world_from_eye[:3, 3]
        inverse = np.eye(4)
        inverse[:3, :3], inverse[:3, 3] = R.T, -R.T @ t
        return inverse

    def rays(self, window: np.ndarray) -> np.ndarray:
        """d (..., 2) of window positions (..., 2)."""
        return (window - self.centre) / self.focal


def view(
    camera: Camera,
    origin: np.ndarray,
    bounds: np.ndarray,
    grid: int,
    jitter: np.ndarray,
    aperture: np.ndarray,
    lensmap: Lensmap | None,
    shift: np.ndarray,
    through: bool = False,
) -> View:
    """The view of one pass: ``grid``² texels a pixel, moved by ``jitter`` px, from the spot ``aperture`` of the lens
    (both (2,); the aperture's unit disk). ``shift``: of a distorting lens's wide view, texels. ``through``: the
    sensor's own window instead, for bodies drawn through the lens; ``focal`` and ``centre`` are then behind it."""
    telecentric = camera.lens.projection is Projection.ORTHOGRAPHIC
    K = camera.K
    if lensmap is None or through:
        width, height = camera.sensor.resolution
        focal = grid * np.array([K[0, 0], K[1, 1]])
        centre = grid * (K[:2, 2] + 0.5 - jitter)
        size = (grid * width, grid * height)
    else:
        finer = max(1, grid // 2)  # the wide view has two texels a pixel as it is
        focal, size = lensmap.focal * finer, (lensmap.size[0] * finer, lensmap.size[1] * finer)
        centre = lensmap.centre * finer + shift  # so that no texel edge stays at one place
    pose = camera.world_from_camera.copy()
    pose[:3, 3] -= origin
    if has_depth_of_field(camera):
        moved = aperture * camera.lens.focal_length / (2 * camera.lens.f_stop)
        pose[:3, 3] += pose[:3, :2] @ moved
        if not through:
            centre = centre + focal * moved / camera.lens.focus_distance
    near, far = camera.clip
    if telecentric:  # linear depth: no wider than what there is to see
        corners = np.stack(np.meshgrid(*(bounds - origin).T, indexing="ij"), -1).reshape(-1, 3)
        z = (corners - pose[:3, 3]) @ pose[:3, 2]
        margin = 1e-3 * (np.ptp(z) + 1e-9)
        near, far = max(near, z.min() - margin), min(far, z.max() + margin)
        far = max(far, near + 1e-6)
    return View(pose, focal, centre, size, telecentric, near, far)


def has_depth_of_field(camera: Camera) -> bool:
    """Whether the lens is a thin lens with a set distance in focus; BrightfieldError where it cannot be drawn."""
    if camera.lens.f_stop <= 0 or camera.lens.focus_distance <= 0:
        return False
    if camera.lens.projection is Projection.ORTHOGRAPHIC:
        raise BrightfieldError(
            f"A telecentric lens must have f_stop 0 in the rasteriser, which draws no blur for it; got "
            f"{camera.lens.f_stop:g}. ({str(camera.where) or camera.name})"
        )
    return True

"""The overview's own camera: it orbits a point, pans, zooms, fits, and stands where CAD programs have their views.

eye = target - distance (cos e cos a, cos e sin a, -sin e)    looking along azimuth a, from elevation e
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera, Lens, Projection, Sensor

FILM = 24e-3  # m, the film's height, as of a small-format camera
STEEPEST = np.radians(89.999)


@dataclass(frozen=True)
class Orbit:
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    distance: float = 0.5  # m
    azimuth: float = np.radians(60.0)  # rad
    elevation: float = np.radians(28.0)
    focal: float = 40e-3  # m
    orthographic: bool = False

    @property
    def axes(self) -> np.ndarray:
        """(3, 3): right, down and forward in the world, as columns."""
        ce, se, ca, sa = (
            np.cos(self.elevation),
            np.sin(self.elevation),
            np.cos(self.azimuth),
            np.sin(self.azimuth),
        )
        forward = np.array([ce * ca, ce * sa, -se])
        right = np.array([sa, -ca, 0.0])
        return np.stack([right, np.cross(forward, right), forward], axis=1)

    @property
    def world_from_camera(self) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, :3] = self.axes
        pose[:3, 3] = np.asarray(self.target) - self.distance * self.axes[:, 2]
        return pose

    def turned(self, dx: float, dy: float) -> "Orbit":
        """By radians of a drag to the right and downwards."""
        elevation = float(np.clip(self.elevation + dy, -STEEPEST, STEEPEST))
        return replace(self, azimuth=float((self.azimuth - dx) % (2 * np.pi)), elevation=elevation)

    def panned(self, dx: float, dy: float, height: int) -> "Orbit":
        """By px of a drag in a view of ``height`` px: the target stays under the cursor."""
        scale = self.distance * FILM / self.focal / height
        moved = np.asarray(self.target) - scale * (dx * self.axes[:, 0] + dy * self.axes[:, 1])
        return replace(self, target=_triple(moved))

    def zoomed(self, steps: float) -> "Orbit":
        return replace(self, distance=float(np.clip(self.distance * 0.88**steps, 1e-4, 1e5)))

    def fitted(self, bounds: np.ndarray | None, aspect: float = 1.5) -> "Orbit":
        """All of a box (2, 3), m, in view; ``aspect`` is the view's width over its height."""
        if bounds is None:
            return Orbit()
        radius = max(float(np.linalg.norm(bounds[1] - bounds[0])) / 2, 1e-3)
        half = np.arctan(FILM / 2 / self.focal * min(1.0, aspect))
        return replace(
            self, target=_triple(bounds.mean(axis=0)), distance=1.08 * radius / float(np.sin(half))
        )

    def seen_from(self, side: str) -> "Orbit":
        """front, back, left, right, top or bottom: orthographic, as on the numeric keypad."""
        azimuth, elevation = {
            "front": (90.0, 0.0), "back": (270.0, 0.0), "right": (180.0, 0.0), "left": (0.0, 0.0),
            "top": (90.0, 90.0), "bottom": (90.0, -90.0),
        }[side]  # fmt: skip
        steep = float(np.clip(np.radians(elevation), -STEEPEST, STEEPEST))
        return replace(self, azimuth=float(np.radians(azimuth)), elevation=steep, orthographic=True)

    def camera(self, width: int, height: int) -> Camera:
        """What the overview is drawn with, ``width`` x ``height`` px."""
        pitch = FILM / height
        if self.orthographic:
            pitch *= self.distance / self.focal
        projection = Projection.ORTHOGRAPHIC if self.orthographic else Projection.PERSPECTIVE
        reach = self.distance
        return Camera(
            name="overview",
            world_from_camera=self.world_from_camera,
            lens=Lens(self.focal, projection=projection),
            sensor=Sensor(resolution=(max(width, 1), max(height, 1)), pixel_pitch=(pitch, pitch)),
            clip=(reach * 0.005, reach * 200.0),
        )


def gl_matrices(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """(view, projection) (4, 4) in OpenGL's convention, for a gizmo that draws over the overview."""
    from interchange.frames import gl_from_camera

    view = gl_from_camera @ np.linalg.inv(camera.world_from_camera)
    (width, height), K = camera.sensor.resolution, camera.K
    near, far = camera.clip
    P = np.zeros((4, 4))
    P[0, 0], P[1, 1] = 2 * K[0, 0] / width, 2 * K[1, 1] / height
    if camera.lens.projection is Projection.ORTHOGRAPHIC:
        P[2, 2], P[2, 3], P[3, 3] = -2 / (far - near), -(far + near) / (far - near), 1
    else:
        P[2, 2], P[2, 3], P[3, 2] = -(far + near) / (far - near), -2 * far * near / (far - near), -1
    return view, P


def _triple(v: np.ndarray) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])

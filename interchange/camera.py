"""The camera: where it stands, what its lens does, what its sensor does."""

from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from interchange.parameter import freeze, parameter
from interchange.problems import Where


class Projection(StrEnum):
    PERSPECTIVE = "perspective"
    ORTHOGRAPHIC = "orthographic"  # a telecentric lens: pixel_pitch is then m on the object


@dataclass(frozen=True)
class Lens:
    """``distortion``: k1, k2, p1, p2, k3, k4, k5, k6 in OpenCV's order and sense. ``f_stop`` 0 is a pinhole."""

    focal_length: float = parameter(25e-3, "f", "m", 1e-6, 1e3, "principal distance")
    f_stop: float = parameter(0.0, "N", "1", 0, 1e3, "f-number; 0 is a pinhole")
    focus_distance: float = parameter(0.0, "z_f", "m", 0, 1e6, "distance in focus; 0 is not set")
    distortion: tuple[float, ...] = (0.0,) * 8
    projection: Projection = Projection.PERSPECTIVE

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True)
class Sensor:
    """EMVA 1288's linear model. Only the resolution and the pitch matter to a renderer; the rest is ``expose``'s."""

    resolution: tuple[int, int] = (640, 480)  # (width, height), px
    pixel_pitch: tuple[float, float] = (3.45e-6, 3.45e-6)  # (x, y), m
    responsivity: float = parameter(
        1.0, "R", "e- m² sr / (W s)", 0, 1e12, "electrons per radiance and second"
    )
    full_well: float = parameter(1e4, "µ_e.sat", "e-", 1, 1e9, "electrons that read as the highest DN")
    bit_depth: int = 12
    black_level: float = parameter(0.0, "µ_y.dark", "DN", 0, 65535, "DN of no electrons")
    read_noise: float = parameter(0.0, "σ_d", "e-", 0, 1e6, "temporal noise in the dark, rms")
    prnu: float = parameter(0.0, "PRNU", "1", 0, 1, "spread of the pixels' gain, rms")
    dsnu: float = parameter(0.0, "DSNU", "e-", 0, 1e6, "spread of the pixels' offset, rms")
    dark_current: float = parameter(0.0, "µ_I", "e-/s", 0, 1e9, "dark current")

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, eq=False)
class Camera:
    """Its frame is x right, y down, z forward; pixel (0, 0) is the centre of the top-left pixel."""

    name: str = "camera"
    world_from_camera: np.ndarray = field(default_factory=lambda: np.eye(4))  # (4, 4), m, rigid
    lens: Lens = field(default_factory=Lens)
    sensor: Sensor = field(default_factory=Sensor)
    principal_point: tuple[float, float] | None = None  # (column, row) px; None is the image centre
    clip: tuple[float, float] = (1e-3, 1e4)  # m: nearest and farthest depth that is drawn
    t_exp: float = 1.0  # s
    where: Where = field(default=Where(), compare=False)

    @property
    def K(self) -> np.ndarray:
        """(3, 3) camera matrix, px. Orthographic: px = K @ (X, Y, 1), focal lengths in px per metre."""
        (width, height), (px, py) = self.sensor.resolution, self.sensor.pixel_pitch
        f = self.lens.focal_length if self.lens.projection is Projection.PERSPECTIVE else 1.0
        cx, cy = self.principal_point or ((width - 1) / 2, (height - 1) / 2)
        return np.array([[f / px, 0, cx], [0, f / py, cy], [0, 0, 1]])

    @property
    def camera_from_world(self) -> np.ndarray:
        return np.linalg.inv(self.world_from_camera)

    def resized(self, width: int) -> "Camera":
        """The same field of view on ``width`` columns, rows in proportion."""
        (w, h), (px, py) = self.sensor.resolution, self.sensor.pixel_pitch
        height = max(1, round(h * width / w))
        sx, sy = width / w, height / h
        cx, cy = self.principal_point or ((w - 1) / 2, (h - 1) / 2)
        return replace(
            self,
            sensor=replace(self.sensor, resolution=(width, height), pixel_pitch=(px / sx, py / sy)),
            principal_point=((cx + 0.5) * sx - 0.5, (cy + 0.5) * sy - 0.5),
        )

    def project(self, points: np.ndarray) -> np.ndarray:
        """World points (..., 3) -> pixels (..., 2); NaN behind a perspective camera. OpenCV's rational model."""
        p = points @ self.camera_from_world[:3, :3].T + self.camera_from_world[:3, 3]
        if self.lens.projection is Projection.PERSPECTIVE:
            z = np.where(p[..., 2] > 0, p[..., 2], np.nan)
            x, y = p[..., 0] / z, p[..., 1] / z
        else:
            x, y = p[..., 0], p[..., 1]
        x, y = distort(x, y, self.lens.distortion)
        K = self.K
        return np.stack([K[0, 0] * x + K[0, 2], K[1, 1] * y + K[1, 2]], axis=-1)

    def rays(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """World origins and unit directions (..., 3) of the rays through ``pixels`` (..., 2)."""
        K = self.K
        x, y = undistort(
            (pixels[..., 0] - K[0, 2]) / K[0, 0], (pixels[..., 1] - K[1, 2]) / K[1, 1], self.lens.distortion
        )
        one = np.ones_like(x)
        if self.lens.projection is Projection.PERSPECTIVE:
            origin, direction = np.zeros((*x.shape, 3)), np.stack([x, y, one], axis=-1)
        else:
            origin, direction = np.stack([x, y, 0 * one], axis=-1), np.stack([0 * one, 0 * one, one], axis=-1)
        direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
        R, t = self.world_from_camera[:3, :3], self.world_from_camera[:3, 3]
        return origin @ R.T + t, direction @ R.T


def distort(x: np.ndarray, y: np.ndarray, d: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Normalised image coordinates after the lens: OpenCV's rational radial and tangential model."""
    if not any(d):
        return x, y
    k1, k2, p1, p2, k3, k4, k5, k6 = d
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return (
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )


def undistort(x: np.ndarray, y: np.ndarray, d: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The inverse of ``distort`` by Newton's method; NaN where the model folds and there is none."""
    if not any(d):
        return x, y
    k1, k2, p1, p2, k3, k4, k5, k6 = d
    u, v = np.array(x, np.float64), np.array(y, np.float64)
    for _ in range(20):
        r2 = u * u + v * v
        num, den = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        q = num / den
        dq = ((k1 + r2 * (2 * k2 + 3 * r2 * k3)) * den - num * (k4 + r2 * (2 * k5 + 3 * r2 * k6))) / (
            den * den
        )
        xx = q + 2 * u * u * dq + 2 * p1 * v + 6 * p2 * u
        xy = 2 * u * v * dq + 2 * p1 * u + 2 * p2 * v
        yy = q + 2 * v * v * dq + 6 * p1 * v + 2 * p2 * u
        fx, fy = distort(u, v, d)
        ex, ey, det = fx - x, fy - y, xx * yy - xy * xy
        u, v = u - (yy * ex - xy * ey) / det, v - (xx * ey - xy * ex) / det
    fx, fy = distort(u, v, d)
    bad = ~(np.hypot(fx - x, fy - y) < 1e-9)
    return np.where(bad, np.nan, u), np.where(bad, np.nan, v)

"""The camera: where it stands, what its lens does, what its sensor does."""

from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from interchange.distortion import LensModel, distort, padded, undistort
from interchange.parameter import ParameterError, freeze, parameter
from interchange.problems import Where
from interchange.sensor import Sensor as Sensor  # cameras are made with it; mypy wants the second name
from interchange.sensor import freeze_numbers

CLIP = (1e-3, 1e4)  # m: what is drawn where nothing says so


class Projection(StrEnum):
    PERSPECTIVE = "perspective"
    ORTHOGRAPHIC = "orthographic"  # a telecentric lens: pixel_pitch is then m on the object


@dataclass(frozen=True)
class Lens:
    """``distortion``: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, τx, τy in OpenCV's order and sense (8 or 14
    numbers; fewer are filled up with zeros), or a fisheye's k1, k2, k3, k4: interchange.distortion has the formulas.
    ``f_stop`` 0 is a pinhole.

    What follows ``model`` matters to ``expose`` alone: the parameters of the effects that a lens causes, under
    the names and in the order of their files in ``interchange/effects``. Zero is an effect that is not there.
    """

    focal_length: float = parameter(25e-3, "f", "m", 1e-6, 1e3, "principal distance")
    f_stop: float = parameter(0.0, "N", "1", 0, 1e3, "f-number; 0 is a pinhole")
    focus_distance: float = parameter(0.0, "z_f", "m", 0, 1e6, "distance in focus; 0 is not set")
    distortion: tuple[float, ...] = ()
    projection: Projection = Projection.PERSPECTIVE
    model: LensModel = LensModel.OPENCV
    transmission: float = parameter(1.0, "τ", "1", 1e-9, 1, "share of the light that the lens lets through")
    vignetting: tuple[float, ...] = ()
    lateral_chromatic_aberration: tuple[float, ...] = ()
    axial_chromatic_aberration: tuple[float, ...] = ()
    blur: float = parameter(0.0, "σ", "px", 0, 100, "blur of the whole image, Gaussian, rms")
    field_blur: tuple[float, ...] = ()
    measured_blur: tuple[float, ...] = ()
    diffraction: bool = False  # blur by the Airy pattern of f_stop
    veiling_glare: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        freeze(self)
        try:
            object.__setattr__(self, "distortion", padded(self.distortion, self.model))
        except ValueError as error:
            raise ParameterError(str(error)) from None
        if self.model is LensModel.FISHEYE and self.projection is not Projection.PERSPECTIVE:
            raise ParameterError(f"A fisheye lens must be perspective; got {self.projection}.")
        freeze_numbers(self, vignetting=2, lateral_chromatic_aberration=8, axial_chromatic_aberration=3)
        freeze_numbers(self, veiling_glare=4, field_blur=4, measured_blur=None)
        object.__setattr__(self, "diffraction", bool(self.diffraction))

    @property
    def distorts(self) -> bool:
        """Whether straight lines may be imaged bent; a fisheye's always are."""
        return self.model is LensModel.FISHEYE or any(self.distortion)

    @property
    def projected_solid_angle(self) -> float:
        """sr: image irradiance on the axis per radiance, τ π / (4 N²); τ · 1 sr where there is no f-number.

        N is the working f-number of the aberration-free lens (Born and Wolf: Principles of Optics, 4.8.3).
        """
        return self.transmission * (np.pi / (4 * self.f_stop**2) if self.f_stop > 0 else 1.0)

    def distort(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Normalised image coordinates after the lens."""
        return distort(x, y, self.distortion, self.model)

    def undistort(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Before the lens; NaN where the lens images nothing."""
        return undistort(x, y, self.distortion, self.model)


@dataclass(frozen=True, eq=False)
class Camera:
    """Its frame is x right, y down, z forward; pixel (0, 0) is the centre of the top-left pixel."""

    name: str = "camera"
    world_from_camera: np.ndarray = field(default_factory=lambda: np.eye(4))  # (4, 4), m, rigid
    lens: Lens = field(default_factory=Lens)
    sensor: Sensor = field(default_factory=Sensor)
    principal_point: tuple[float, float] | None = None  # (column, row) px; None is the image centre
    clip: tuple[float, float] = CLIP  # m: nearest and farthest depth that is drawn
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
        line_time = self.sensor.line_time / sy  # the read-out takes as long
        cx, cy = self.principal_point or ((w - 1) / 2, (h - 1) / 2)
        return replace(
            self,
            sensor=replace(
                self.sensor,
                resolution=(width, height),
                pixel_pitch=(px / sx, py / sy),
                line_time=line_time,
            ),
            principal_point=((cx + 0.5) * sx - 0.5, (cy + 0.5) * sy - 0.5),
        )

    def project(self, points: np.ndarray) -> np.ndarray:
        """World points (..., 3) -> pixels (..., 2); NaN behind a perspective camera."""
        p = points @ self.camera_from_world[:3, :3].T + self.camera_from_world[:3, 3]
        if self.lens.projection is Projection.PERSPECTIVE:
            z = np.where(p[..., 2] > 0, p[..., 2], np.nan)
            x, y = p[..., 0] / z, p[..., 1] / z
        else:
            x, y = p[..., 0], p[..., 1]
        x, y = self.lens.distort(x, y)
        K = self.K
        return np.stack([K[0, 0] * x + K[0, 2], K[1, 1] * y + K[1, 2]], axis=-1)

    def rays(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """World origins and unit directions (..., 3) of the rays through ``pixels`` (..., 2); NaN where
        the lens images nothing."""
        K = self.K
        x, y = self.lens.undistort((pixels[..., 0] - K[0, 2]) / K[0, 0], (pixels[..., 1] - K[1, 2]) / K[1, 1])
        one = np.ones_like(x)
        if self.lens.projection is Projection.PERSPECTIVE:
            origin, direction = np.zeros((*x.shape, 3)), np.stack([x, y, one], axis=-1)
        else:
            origin, direction = np.stack([x, y, 0 * one], axis=-1), np.stack([0 * one, 0 * one, one], axis=-1)
        direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
        R, t = self.world_from_camera[:3, :3], self.world_from_camera[:3, 3]
        return origin @ R.T + t, direction @ R.T

"""Cameras that were measured, as a scene of their own or inside another one.

Every importer of calibrations builds its cameras by ``measured``, in this program's convention: the centre of the
top-left pixel is (0, 0). Files give focal lengths in pixels; millimetres follow from the pixel pitch, which they do
not know.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from interchange.camera import Camera, Lens, Sensor
from interchange.distortion import LensModel
from interchange.formats.base import Options
from interchange.formats.calibration_tree import Entry
from interchange.formats.document import Document, open_scene
from interchange.parameter import ParameterError
from interchange.problems import FileError, Problem, Severity, Where

PIXEL_PITCH = 3.45  # µm, where nobody says


@dataclass
class Measured:
    """The cameras of one file, and what was noticed."""

    path: Path
    options: Options
    cameras: list[Camera] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)

    def note(self, message: str, line: int = 0, severity: Severity = Severity.NOTE) -> None:
        place = f"line {line}" if line else ""
        self.problems.append(Problem(message, Where(str(self.path), place), severity))

    def add(
        self,
        name: str,
        line: int,
        focal: Sequence[float],
        centre: Sequence[float],
        resolution: tuple[int, int] | None,
        distortion: Sequence[float] = (),
        model: LensModel = LensModel.OPENCV,
        camera_from_world: np.ndarray | None = None,
    ) -> None:
        """``focal`` and ``centre``: fx, fy and cx, cy, px. ``resolution`` None: the file does not say it."""
        where = Where(str(self.path), f"line {line}")
        resolution = resolution or self.options.resolution
        if resolution is None:
            raise FileError(
                Problem(
                    "The file does not say how large the images are; name it by --resolution 640x480.", where
                )
            )
        if not all(0 < n <= 65536 for n in resolution):
            raise FileError(
                Problem(
                    f"A resolution must lie in [1, 65536] px; got {resolution[0]} x {resolution[1]}.", where
                )
            )
        fx, fy = (float(f) for f in focal)
        if not (1e-3 < fx < 1e9 and 1e-3 < fy < 1e9):
            raise FileError(Problem(f"Focal lengths must be above 0; got {fx:g} and {fy:g} px.", where))
        if not np.abs(centre).max() < 1e6:
            raise FileError(
                Problem(f"The principal point cannot be ({centre[0]:g}, {centre[1]:g}) px.", where)
            )
        pitch = 1e-6 * (self.options.pixel_um or PIXEL_PITCH)
        try:
            lens = Lens(focal_length=fx * pitch, distortion=tuple(map(float, distortion)), model=model)
        except ParameterError as error:
            raise FileError(Problem(str(error), where)) from None
        pose = np.eye(4) if camera_from_world is None else rigid_inverse(camera_from_world, where)
        self.cameras.append(
            Camera(
                name=name,
                world_from_camera=pose,
                lens=lens,
                sensor=Sensor(resolution, (pitch, fx * pitch / fy)),
                principal_point=(float(centre[0]), float(centre[1])),
                where=where,
            )
        )

    def matrix(self, K: Entry) -> tuple[tuple[float, float], tuple[float, float]]:
        """Focal lengths and principal point of a camera matrix, which must have no skew."""
        m = K.numbers(9).reshape(3, 3)
        if not np.allclose(m[[1, 2, 2], [0, 0, 1]], 0) or not np.isclose(m[2, 2], 1):
            K.fail("A camera matrix must be fx 0 cx, 0 fy cy, 0 0 1.")
        self.no_skew(float(m[0, 1]), float(m[0, 0]), K)
        return (m[0, 0], m[1, 1]), (m[0, 2], m[1, 2])

    def no_skew(self, skew: float, fx: float, where: Entry) -> None:
        if abs(skew) > 1e-9 * abs(fx):
            where.fail(f"A camera's pixels must be rectangular here; the file says a skew of {skew:g} px.")

    def document(self) -> Document:
        """A scene of the cameras."""
        if not self.options.pixel_um:
            self.note(
                f"A calibration does not know the pixel pitch; {PIXEL_PITCH} µm is taken (--pixel). Only the focal "
                "length in mm follows from it."
            )
        document = camera_document(self.cameras, self.path)
        document.problems = self.problems
        return document


def rigid_inverse(camera_from_world: np.ndarray, where: Where) -> np.ndarray:
    """World_from_camera (4, 4), its rotation brought to the nearest true one. FileError where it is none."""
    R, t = camera_from_world[:3, :3], camera_from_world[:3, 3]
    u, s, v = np.linalg.svd(R)
    if np.abs(s - 1).max() > 1e-3 or np.linalg.det(R) < 0:
        raise FileError(Problem("A camera's pose must be a rotation and a translation.", where))
    R = u @ v
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = R.T, -R.T @ t
    return pose


def pose_from(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """(4, 4) of a rotation matrix (9,) or (3, 3), or a rotation vector (3,), and a translation (3,)."""
    from scipy.spatial.transform import Rotation

    R = np.asarray(rotation, np.float64)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(R).as_matrix() if R.size == 3 else R.reshape(3, 3)
    pose[:3, 3] = translation
    return pose


def camera_document(cameras: Sequence[Camera], path: Path) -> Document:
    """A scene of cameras alone; ``path``: the file that told of them."""
    from interchange.formats.usd_author import author_camera, free_path, new_stage

    stage = new_stage()
    for camera in cameras:
        author_camera(stage, free_path(stage, "/World", camera.name.rsplit("/", 1)[-1]), camera)
    return Document(stage, path)


def write_cameras(cameras: Sequence[Camera], path: Path, scene: Path | None = None) -> None:
    """Write cameras to a USD file; with ``scene``, a copy of it with the cameras in it, in place of those that have
    their names. Raises FileError."""
    if scene is None:
        camera_document(cameras, path).save(path)
        return
    from interchange.formats.usd_author import author_camera, free_path

    document = open_scene(scene, Options())
    stage = document.stage
    named = [str(p.GetPath()) for p in stage.Traverse() if p.GetTypeName() == "Camera"]
    default = stage.GetDefaultPrim()
    parent = str(default.GetPath()) if default else ""
    for camera in cameras:
        last = camera.name.rsplit("/", 1)[-1]
        for place in [p for p in named if last == p.rsplit("/", 1)[-1]]:
            stage.RemovePrim(place)
        author_camera(stage, free_path(stage, parent, last), camera)
    document.save(path)

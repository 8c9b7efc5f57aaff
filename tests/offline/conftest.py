"""One worker for the whole folder, and small scenes to show it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from interchange.brdf import Brdf
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.formats import gprims
from interchange.frames import look_at
from interchange.light import Light
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.scene import Body, Scene
from offline.renderers.cycles import Cycles


@pytest.fixture(scope="session")
def cycles() -> Iterator[Cycles]:
    with Cycles(timeout=120) as renderer:
        yield renderer


class Build:
    """Ready-made parts."""

    @staticmethod
    def at(x: float, y: float, z: float, turn: np.ndarray | None = None) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, 3] = x, y, z
        if turn is not None:
            pose[:3, :3] = turn
        return pose

    @staticmethod
    def plane(half: float = 10.0, uv: bool = False) -> Mesh:
        """z = 0, normal up."""
        corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        return Mesh(
            corners * half,
            np.array([[0, 1, 2], [0, 2, 3]], np.int32),
            np.tile([0.0, 0, 1], (4, 1)),
            (corners[:, :2] + 1) / 2 if uv else None,
        )

    @staticmethod
    def sphere(radius: float, rings: int = 96) -> Mesh:
        """Without uv, so that tangents lie along the body's axes."""
        return replace(gprims.sphere(radius, 2 * rings), uv=None)

    @staticmethod
    def camera(eye: tuple[float, float, float], target: tuple[float, float, float], field: float = 40.0,
               size: tuple[int, int] = (64, 48), **lens: object) -> Camera:  # fmt: skip
        """``field``: degrees across the columns, or, for an orthographic camera, metres."""
        if lens.get("projection") is Projection.ORTHOGRAPHIC:
            pitch = field / size[0]
        else:
            pitch = 2 * 0.025 * np.tan(np.radians(field / 2)) / size[0]
        return Camera(
            "camera",
            look_at(np.array(eye), np.array(target)),
            Lens(focal_length=0.025, **lens),  # type: ignore[arg-type]
            Sensor(resolution=size, pixel_pitch=(pitch, pitch)),
        )

    def spot(self, x: float = 0.0, y: float = 0.0, size: int = 24) -> Camera:
        """Looks straight down at a square of 2 mm around (x, y, 0), from above every lamp."""
        return self.camera((x, y, 5), (x, y, 0), 0.002, (size, size), projection=Projection.ORTHOGRAPHIC)

    def lit_plane(self, lights: list[Light], brdf: Brdf, *others: Body) -> Scene:
        return Scene((Body("/plane", self.plane(), Material("matte", brdf)), *others), tuple(lights))


@pytest.fixture(scope="session")
def build() -> Build:
    return Build()

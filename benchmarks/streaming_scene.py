"""What the streaming benchmarks look at: a bright square on a dark belt, under a distant lamp, seen from above."""

import numpy as np

from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh, from_corners
from interchange.scene import Body, Scene

HEIGHT, FIELD = 0.5, 0.2  # m: camera above the belt, width of what it sees
PART = "/World/Part"


def square(size: float) -> Mesh:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * size / 2
    return from_corners(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def pose(x: float, y: float, z: float = 0.0) -> np.ndarray:
    m = np.eye(4)
    m[:3, 3] = x, y, z
    return m


def camera(name: str, resolution: tuple[int, int], x: float = 0.0) -> Camera:
    pitch = 5e-6 * 640 / resolution[0]
    sensor = Sensor(
        resolution,
        (pitch, pitch),
        responsivity=2e6,
        full_well=10_000,
        bit_depth=12,
        black_level=64,
        read_noise=7,
    )
    eye = np.array([x, 0, HEIGHT])
    world_from_camera = look_at(eye, np.array([x, 0, 0]), (0, 1, 0))
    return Camera(name, world_from_camera, Lens(resolution[0] * pitch * HEIGHT / FIELD), sensor, t_exp=2e-3)


def scene(resolution: tuple[int, int], name: str = "Top") -> Scene:
    bodies = (
        Body("/World/Belt", square(2.0), Material("rubber", Lambert((0.04,) * 3)), pose(0, 0, -0.01)),
        Body(PART, square(0.04), Material("paint", Lambert((0.7,) * 3))),
    )
    lamp = Light("/World/Lamp", LightKind.DISTANT, (2.0, 2.0, 2.0))
    return Scene(bodies, (lamp,), (camera(f"/World/{name}", resolution),))

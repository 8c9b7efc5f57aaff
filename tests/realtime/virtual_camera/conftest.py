from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.frames import look_at
from interchange.image import Image, Quantity
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh, from_corners
from interchange.scene import Body, Scene
from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.moving_scene import MovingScene
from realtime.virtual_camera.publisher import Publisher
from realtime.virtual_camera.transports.mjpeg import Mjpeg

# one DN for each W m⁻² sr⁻¹ at 1 ms: what is drawn is what is read
UNIT = Sensor(
    resolution=(64, 48), pixel_pitch=(1e-5, 1e-5), responsivity=1000.0, full_well=255.0, bit_depth=8
)


def pattern(number, height=48, width=64):
    """Every pixel of frame ``number`` follows from the number: a frame of two halves is none of these."""
    row, column = np.mgrid[:height, :width]
    return ((row * 3 + column * 5 + number * 37) % 251).astype(np.uint8)


class Pattern:
    """Stands for the rasteriser: the picture of call k is ``pattern(k)``."""

    def __init__(self):
        self.calls = 0

    def __call__(self, scene, camera, passes):
        self.calls += 1
        width, height = camera.sensor.resolution
        values = np.repeat(pattern(self.calls, height, width)[..., None], 3, axis=2).astype(np.float32)
        return Image(values, Quantity.RADIANCE, camera)


class Flat:
    """Frame n is flat, of 50 + 20 (n mod 8) DN, which a JPEG keeps; it has some hundred kB where it is ``rich``."""

    def __init__(self, rich=False):
        self.calls, self.rich = 0, rich
        self.texture = np.random.default_rng(0).integers(0, 255, (480, 640, 1)) if rich else None

    def __call__(self, scene, camera, passes):
        self.calls += 1
        width, height = camera.sensor.resolution
        values = np.full((height, width, 3), level(self.calls), np.float32)
        if self.rich:
            values[:] = np.roll(self.texture[:height, :width], self.calls, axis=1)
        return Image(values, Quantity.RADIANCE, camera)


def level(call):
    return 50.0 + 20 * (call % 8)


@contextmanager
def streaming(scene, draw, transport=Mjpeg, name="Top", **settings):
    camera = VirtualCamera(
        MovingScene(scene, live=True), name, draw=draw, noise=False, format="Mono8", **settings
    )
    with Publisher(camera) as publisher:
        served = transport([publisher])
        served.start()
        try:
            publisher.start()
            yield publisher, served
        finally:
            publisher.stop()
            served.stop()


def camera_above(name="/World/Top", sensor=UNIT, height=0.5, width=0.2, t_exp=1e-3):
    """Looks straight down from ``height`` m on ``width`` m of the plane z = 0; world x is to the right."""
    columns = sensor.resolution[0]
    f = columns * sensor.pixel_pitch[0] * height / width
    pose = look_at(np.array([0, 0, height]), np.zeros(3), (0, 1, 0))
    return Camera(name, pose, Lens(focal_length=f), sensor, t_exp=t_exp)


def square(size, z=0.0):
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * size / 2 + [0, 0, z]
    return from_corners(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def at(x, y, z=0.0):
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


@pytest.fixture(scope="session")
def live():
    class Live:
        pass

    for name, thing in {
        "UNIT": UNIT, "pattern": pattern, "Pattern": Pattern, "camera_above": camera_above, "square": square, "at": at,
        "Flat": Flat, "level": level, "streaming": streaming,
    }.items():  # fmt: skip
        setattr(Live, name, thing if not callable(thing) or isinstance(thing, type) else staticmethod(thing))
    return Live


@pytest.fixture(scope="session")
def bench():
    """A white square of 30 mm on a dark ground under a distant lamp, seen from above."""
    sensor = replace(
        UNIT, full_well=10_000.0, bit_depth=12, black_level=64.0, responsivity=2e6, read_noise=5.0
    )
    lamp = Light("/World/Lamp", LightKind.DISTANT, (1.0, 1.0, 1.0))
    bodies = (
        Body("/World/Ground", square(0.6, -0.01), Material("dark", Lambert((0.05,) * 3))),
        Body("/World/Part", square(0.03), Material("white", Lambert((0.8,) * 3)), at(0.02, -0.01)),
    )
    return Scene(bodies, (lamp,), (camera_above(sensor=sensor),))


def mesh_of_nothing():
    return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros((0, 3)))


@pytest.fixture(scope="session")
def empty():
    """For what is drawn by ``Pattern``: a body without a surface, two cameras."""
    body = Body("/World/Part", mesh_of_nothing(), Material("none"))
    return Scene((body,), (), (camera_above("/World/Top"), camera_above("/World/Side")))

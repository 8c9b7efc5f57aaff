import numpy as np
import pytest

from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.formats import gprims
from interchange.frames import look_at
from interchange.mesh import Mesh
from realtime.renderers.rasterizer import Rasterizer


@pytest.fixture(scope="session")
def rasterizer():
    with Rasterizer() as renderer:
        yield renderer


def at(x, y, z):
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def facing(eye, target):
    """``world_from_light`` of a lamp at ``eye`` that shines at ``target`` along its -z."""
    pose = look_at(np.asarray(eye, float), np.asarray(target, float))
    pose[:3, 1:3] *= -1
    return pose


def plane(width=1.0, height=1.0):
    """In z = 0, facing +z, u along x and v along y."""
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    vertices = np.column_stack([(corner - 0.5) * [width, height], np.zeros(4)])
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.tile([0.0, 0, 1], (4, 1)), corner)


def ball(segments=64, radius=1.0):
    return gprims.sphere(radius, segments)


def telecentric(eye, target, pixel=1e-5, resolution=(4, 4)):
    """A camera of which every pixel sees nearly the same point."""
    lens = Lens(projection=Projection.ORTHOGRAPHIC)
    return Camera(
        "telecentric",
        look_at(np.asarray(eye, float), np.asarray(target, float)),
        lens,
        Sensor(resolution, (pixel, pixel)),
    )


def pinhole(eye, target, resolution=(96, 72), fov=0.8, **lens):
    """``fov``: rad, horizontal."""
    pitch = 1e-5
    f = resolution[0] * pitch / 2 / np.tan(fov / 2)
    pose = look_at(np.asarray(eye, float), np.asarray(target, float))
    return Camera("pinhole", pose, Lens(focal_length=f, **lens), Sensor(resolution, (pitch, pitch)))


@pytest.fixture(scope="session")
def make():
    """What the tests build their scenes from."""

    class Make:
        pass

    for function in (at, facing, plane, ball, telecentric, pinhole):
        setattr(Make, function.__name__, staticmethod(function))
    return Make

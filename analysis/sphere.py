"""A ball of a material under two lamps: how a BRDF is looked at.

A telecentric camera looks at a ball of radius 1 m; the main lamp is a sphere of 0.25 m, 5 m off, to the upper left; a
tenth as much comes from the lower right. The main lamp gives a surface that faces it at the middle the irradiance pi:
a white matte surface there shows radiance 1.
"""

from functools import cache

import numpy as np

from interchange.brdf import Brdf
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.formats import gprims
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.scene import Body, Scene

LAMP = 5.0 * np.array([-0.55, -0.6, 0.58])
FILL = 5.0 * np.array([0.7, -0.6, -0.4])
EYE = np.array([0.0, -4.0, 0.0])


@cache
def ball() -> Mesh:
    """A ball of radius 1 m whose poles are above and below; the tangent runs around it."""
    return gprims.sphere(1.0, 256)


def sphere_scene(brdf: Brdf) -> Scene:
    """The ball and its lamps."""
    pose = np.eye(4)
    pose[:3, 3] = LAMP
    distance2 = float(LAMP @ LAMP)
    lamp = Light("/lamp", LightKind.SPHERE, (np.pi * distance2,) * 3, pose, radius=0.25)
    second = np.eye(4)
    second[:3, 3] = FILL
    fill = Light("/fill", LightKind.SPHERE, (0.1 * np.pi * float(FILL @ FILL),) * 3, second, radius=0.25)
    return Scene((Body("/ball", ball(), Material("/material", brdf)),), (lamp, fill))


def sphere_camera(size: int) -> Camera:
    """A telecentric camera of ``size`` by ``size`` px that the ball nearly fills."""
    pitch = 2.1 / size
    return Camera(
        "/camera",
        look_at(EYE, np.zeros(3)),
        Lens(projection=Projection.ORTHOGRAPHIC),
        Sensor((size, size), (pitch, pitch)),
    )

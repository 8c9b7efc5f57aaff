"""A colour camera that gives out JPEGs: a mosaic, a matrix, sRGB's curve, 8 bits; and a scene with one lamp."""

from interchange.camera import Camera
from interchange.light import Light, LightKind
from interchange.scene import Scene
from interchange.sensor import Mosaic, Response, Sensor

MIXED = (1.4, -0.3, -0.1, -0.2, 1.5, -0.3, 0.0, -0.4, 1.4)
SENSOR = Sensor(
    (160, 120),
    (5e-6, 5e-6),
    2e4,
    9000.0,
    12,
    read_noise=8.0,
    mosaic=Mosaic.GRBG,
    color_correction=MIXED,
    response=Response.SRGB,
    output_bit_depth=8,
    jpeg_quality=95,
)
CAMERA = Camera("/World/Camera", sensor=SENSOR, t_exp=1.0)
LAMP = "/lamp"
SCENE = Scene(lights=(Light(LAMP, LightKind.SPHERE, (1.0, 1.0, 1.0)),), cameras=(CAMERA,))

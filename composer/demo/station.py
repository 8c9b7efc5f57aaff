"""The demo's inspection station: a machined part in a fixture, a ring of LEDs, a bar light, two cameras.

It is built as an engineer would in Python: a part read from STEP, the rest from solids, everything in metres.
The oblique camera moves round the part, one position a frame (Gruna and Irgenfried, Fig. 5).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from interchange.brdf.lafortune import Lafortune
from interchange.camera import Camera, Lens, Sensor
from interchange.formats import gprims
from interchange.formats.document import open_scene
from interchange.frames import camera_from_gl, look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.scene import Body, Scene

PART = "cad/featuretype.STEP"
LEDS = 12
FRAMES = 12

# Lobes in the shape that fits of machined and of anodised metal take (Ngan et al. 2005: one narrow lobe near the
# mirror direction, Cx a little below Cz, and a broad one under it); not measurements of these parts.
ALUMINIUM = Lafortune(
    diffuse=(0.09, 0.09, 0.095),
    weight=((0.9, 0.9, 0.92), (0.25, 0.25, 0.26)),
    C=((-0.98, -0.98, 0.99), (-0.9, -0.9, 0.96)),
    n=(22.0, 4.0),
)
ANODISED = Lafortune(
    diffuse=(0.035, 0.04, 0.06), weight=((0.1, 0.1, 0.1),), C=((-0.97, -0.97, 0.98),), n=(12.0,)
)

SENSOR = Sensor(
    resolution=(480, 360),
    pixel_pitch=(15e-6, 15e-6),
    responsivity=90.0,
    full_well=10500.0,
    bit_depth=12,
    black_level=64.0,
    read_noise=7.0,
)


def station(assets: Path) -> list[Scene]:
    """The scene at each of its frames. ``assets``: the folder that holds the part."""
    first = _at(0, _bodies(assets), _lights())
    return [first, *(_at(k, first.bodies, first.lights) for k in range(1, FRAMES))]


def _at(frame: int, bodies: tuple[Body, ...], lights: tuple[Light, ...]) -> Scene:
    target = np.array([0.0, 0.0, 0.012])
    azimuth = np.radians(-150 + 120 * frame / (FRAMES - 1))
    eye = target + 0.40 * np.array([np.cos(azimuth) * 0.75, np.sin(azimuth) * 0.75, 0.66])
    cameras = (
        Camera(
            "Top",
            look_at(np.array([0.0, 0.0, 0.43]), target, up=(0, 1, 0)),
            Lens(16e-3),
            SENSOR,
            clip=(0.01, 5),
        ),
        Camera("Oblique", look_at(eye, target), Lens(16e-3), SENSOR, clip=(0.01, 5)),
    )
    return Scene(bodies=bodies, lights=lights, cameras=cameras, time=float(frame))


def _bodies(assets: Path) -> tuple[Body, ...]:
    part = open_scene(assets / PART).scene()
    low, high = part.bounds
    to_origin = np.eye(4)
    to_origin[:3, 3] = [-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2]]
    metal, black = Material("Aluminium", ALUMINIUM), Material("Anodised", ANODISED)
    lying = tuple(
        replace(b, name="Part", material=metal, world_from_body=to_origin @ b.world_from_body)
        for b in part.bodies
    )
    width = (high - low)[0]
    jaw = _block(0.012, 0.05, 0.022)
    return (
        *lying,
        Body("Plate", _block(0.26, 0.18, 0.012), black, _moved(0, 0, -0.006)),
        Body("JawLeft", jaw, black, _moved(-width / 2 - 0.006, 0, 0.011)),
        Body("JawRight", jaw, black, _moved(width / 2 + 0.006, 0, 0.011)),
    )


def _lights() -> tuple[Light, ...]:
    target = np.array([0.0, 0.0, 0.015])
    ring = []
    for k in range(LEDS):
        angle = 2 * np.pi * k / LEDS
        place = np.array([0.11 * np.cos(angle), 0.11 * np.sin(angle), 0.2])
        ring.append(
            Light(
                f"Led{k:02d}",
                LightKind.SPHERE,
                (0.26, 0.256, 0.24),  # W/sr a channel on the axis; a die of 1 mm is a point from 0.2 m
                look_at(place, target) @ camera_from_gl,
                cone_angle=np.radians(60),
                cone_softness=0.4,
                focus=1.0,
            )
        )
    bar = Light(
        "Bar",
        LightKind.RECT,
        (0.9, 0.5, 0.3),
        look_at(np.array([0.0, 0.24, 0.10]), target) @ camera_from_gl,
        width=0.2,
        height=0.012,
    )
    return (*ring, bar)


def _block(x: float, y: float, z: float) -> Mesh:
    box = gprims.box(1.0)
    return Mesh(box.vertices * [x, y, z], box.faces, box.normals, box.uv)


def _moved(x: float, y: float, z: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose

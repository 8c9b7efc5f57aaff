"""Projected images in both renderers: where their edges fall, how bright they are, and their shadows."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.distortion import LensModel
from interchange.formats import gprims
from interchange.frames import look_at
from interchange.lamps.projecting import projector
from interchange.material import Material
from interchange.scene import Body, Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from realtime.renderers.rasterizer import Rasterizer

RHO = 0.5
SIZE = (64, 48)
LENSES = {
    "pinhole": Lens(8e-3),
    "bent": Lens(
        8e-3,
        distortion=(-0.25, 0.1, 0.003, -0.002, 0.02, 0.03, -0.01, 0.004, 0.002, 0, -0.003, 0, 0.03, -0.02),
    ),
    "fisheye": Lens(6e-3, distortion=(0.06, -0.01, 0.0, 0.0), model=LensModel.FISHEYE),
}


@pytest.fixture(scope="module")
def renderers():
    settings = CyclesSettings(samples=16, max_bounces=0)
    with Rasterizer() as live, Cycles(timeout=120) as true:
        yield {
            "realtime": lambda scene, camera: live.render(scene, camera, samples=16).pixels,
            "offline": lambda scene, camera: true.render(scene, camera, settings).pixels,
        }


def beamer(lens: Lens) -> Camera:
    pose = look_at(np.array([0.05, -0.25, 0.4]), np.array([0.0, 0.02, 0.0]))
    return Camera("/p", pose, lens, Sensor(SIZE, (1e-4, 1e-4)), principal_point=(30.0, 25.5))


def above(width: float, pixels: int) -> Camera:
    return Camera(
        "/above",
        look_at(np.array([0, 0, 1.0]), np.zeros(3), up=(0, 1, 0)),
        Lens(projection=Projection.ORTHOGRAPHIC),
        Sensor((pixels, pixels), (width / pixels, width / pixels)),
    )


def floor(light, *others: Body) -> Scene:
    matte = Body("/floor", gprims.plane(1.0, 1.0), Material("matte", Lambert(RHO)))
    return Scene((matte, *others), (light,))


def on_floor(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    origin, direction = camera.rays(pixels)
    return origin - direction * (origin[..., 2:] / direction[..., 2:])


def crossings(ratio: np.ndarray) -> np.ndarray:
    """(N, 2) pixels, column and row, at which a row of ``ratio`` passes one half, between two neighbours."""
    low, high = ratio[:, :-1], ratio[:, 1:]
    row, column = np.nonzero((low - 0.5) * (high - 0.5) < 0)
    share = (0.5 - low[row, column]) / (high - low)[row, column]
    return np.stack([column + share, row], axis=-1)


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("renderer", ["realtime", "offline"])
def test_edges_fall_where_the_camera_would_see_them(renderers, renderer: str, lens: str) -> None:
    """Where the light on the floor passes one half, the world point lies on the edge between two projector pixels:
    0.05 px of the projector, over the whole field."""
    camera, view = beamer(LENSES[lens]), above(0.3, 240)
    white = np.ones((*SIZE[::-1], 1), np.float32)
    stripes = white.copy()
    stripes[:, (np.arange(SIZE[0]) // 8) % 2 == 1] = 0
    render = renderers[renderer]
    lit = render(floor(projector(camera, white, intensity=1.0)), view)[..., 0]
    seen = render(floor(projector(camera, stripes, intensity=1.0)), view)[..., 0]
    points = on_floor(view, np.stack(np.meshgrid(np.arange(240.0), np.arange(240.0)), -1))
    inside = camera.project(points)
    well = ((inside > 2) & (inside < np.array(SIZE) - 3)).all(axis=-1)  # away from the image's own border
    ratio = np.where(well, seen / np.where(lit > 0, lit, 1), np.nan)
    edges = crossings(ratio)
    pixels = camera.project(on_floor(view, edges))
    off = (pixels[:, 0] + 0.5 + 4) % 8 - 4
    assert len(edges) > 500
    assert np.abs(off).max() < 0.05
    assert abs(off.mean()) < 0.01


@pytest.mark.parametrize("renderer", ["realtime", "offline"])
def test_brightness_falls_with_distance_squared_and_the_floors_cosine(renderers, renderer: str) -> None:
    """E = I cos / d²: no cos⁴ of a lens. A projector that looks straight down at height h gives I cos³ / h²."""
    pose = look_at(np.array([0, 0, 0.3]), np.zeros(3), up=(0, 1, 0))
    camera = Camera("/p", pose, Lens(6e-3), Sensor(SIZE, (1e-4, 1e-4)))
    view = above(0.2, 40)
    light = projector(camera, np.ones((*SIZE[::-1], 1)), intensity=2.0)
    E = renderers[renderer](floor(light), view)[..., 1] * np.pi / RHO
    p = on_floor(view, np.stack(np.meshgrid(np.arange(40.0), np.arange(40.0)), -1))
    cosine = 0.3 / np.linalg.norm(p - camera.world_from_camera[:3, 3], axis=-1)
    assert pytest.approx(2.0 * cosine**3 / 0.3**2, rel=2e-3) == E  # 16 samples of a pixel of 5 mm


def test_shadows_and_colours_agree(renderers) -> None:
    """A coloured image over a box: the two renderers, pixel by pixel, and the box's shadow where it must be."""
    camera, view = beamer(LENSES["bent"]), above(0.2, 80)
    rng = np.random.default_rng(4)
    image = np.kron(rng.uniform(0.2, 1, (6, 8, 3)), np.ones((8, 8, 1))).astype(np.float32)
    box = np.eye(4)
    box[:3, 3] = 0.0, 0.02, 0.015
    part = Body("/box", gprims.box(0.03), Material("matte", Lambert((0.3, 0.5, 0.7))), box)
    scene = floor(projector(camera, image, power=3.0), part)
    images = [renderers[name](scene, view) for name in ("realtime", "offline")]
    difference = np.abs(images[0] - images[1]).max(axis=-1) / images[1].max()
    assert np.percentile(difference, 95) < 0.005
    assert difference.mean() < 0.003
    # the shadow of the box's far upper edge: the middle of it, seen from the projector, ends on the floor
    top = np.array([0.0, 0.035, 0.03])
    eye = camera.world_from_camera[:3, 3]
    end = eye + (top - eye) * eye[2] / (eye[2] - top[2])
    for shown in images:
        column = round(float(view.project(end[None])[0, 0]))
        dark = np.nonzero(shown[:, column, 1] < 1e-6)[0]
        last = on_floor(view, np.array([[column, dark.min() - 0.5]]))[0, 1]
        assert last == pytest.approx(end[1], abs=0.2 / 80)
    dark = replace(scene, lights=())
    assert renderers["realtime"](dark, view).max() == 0

"""The views that benchmarks/drivers.py draws: together they run every kind of program that the rasteriser composes."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rasterizer import camera as circling
from rasterizer import scene as bumpy

from interchange.brdf import MODELS
from interchange.brdf.ashikhmin_shirley import AshikhminShirley
from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.brdf.tabulated_goniometer import TabulatedGoniometer
from interchange.brdf.ward_anisotropic import WardAnisotropic
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.distortion import LensModel
from interchange.formats import gprims, photometry
from interchange.formats.document import open_scene
from interchange.frames import camera_from_gl, look_at
from interchange.lamps.projecting import projector
from interchange.light import Light, LightKind
from interchange.material import Material, Texture, Wrap
from interchange.scene import Body, Scene

ROOT = Path(__file__).parents[1]
SIZE, SMALL = (640, 480), (320, 240)  # px; of the images of one lamp each
WHITE = (1.0, 1.0, 1.0)
BENT = (-0.18, 0.06, 0.0005, -0.0004, -0.01, 0.0)


@dataclass(frozen=True, eq=False)
class Shot:
    """One image to draw. ``per_light``: each lamp's own as well."""

    name: str
    scene: Scene
    camera: Camera
    samples: int
    shading: str = "sample"
    per_light: bool = False


def shots() -> Iterator[Shot]:
    """All of them, one after the other."""
    station = open_scene(ROOT / "docs" / "examples" / "station.usda").scene(0.0)
    for one in station.cameras:
        yield Shot(f"station, {one.name.rsplit('/', 1)[-1]}", station, one.resized(SIZE[0]), 16)
    bench = open_scene(ROOT / "assets" / "bench_sample" / "scene.usda").scene(0.0)
    yield Shot("bench sample", bench, bench.cameras[0].resized(SIZE[0]), 16)
    yield Shot("lamps", lit_table(), pinhole((0.5, -1.1, 0.9), (0, 0, 0.05), 0.7, SMALL), 16, per_light=True)
    yield Shot("models", balls(), pinhole((0, -0.6, 3.2), (0, 0, 0), 0.62), 1)
    yield Shot("surfaces", surfaces(), pinhole((0.3, -1.4, 1.1), (0, 0, 0.1), 0.8), 16)
    still, plain = bumpy(20_000), circling(SIZE, 3)
    yield Shot("three lamps, live", still, plain, 1)
    yield Shot("three lamps, ×4 lit once", still, plain, 4, "pixel")
    yield Shot("three lamps, ×16", still, plain, 16)
    for name, lens in lenses(plain).items():
        bent = replace(plain, lens=lens)
        yield Shot(f"{name}, live", still, bent, 1)
        yield Shot(f"{name}, ×4 lit once", still, bent, 4, "pixel")
    f = plain.lens.focal_length
    thin = replace(plain, lens=Lens(f, f_stop=f / 0.08, focus_distance=3.4))
    yield Shot("depth of field", still, thin, 64)
    flat = Sensor(SIZE, (5e-3, 5e-3))
    pose = look_at(np.array([2.0, 2.0, 2.0]), np.array([0, 0, -0.2]))
    yield Shot(
        "telecentric", still, Camera("camera", pose, Lens(projection=Projection.ORTHOGRAPHIC), flat), 16
    )


def lenses(plain: Camera) -> dict[str, Lens]:
    f = plain.lens.focal_length
    return {
        "distorting lens": Lens(f, distortion=BENT),
        "fisheye": Lens(0.6 * f, distortion=(0.06, -0.01, 0.0, 0.0), model=LensModel.FISHEYE),
    }


def pinhole(
    eye: tuple[float, float, float],
    target: tuple[float, float, float],
    fov: float,
    size: tuple[int, int] = SIZE,
) -> Camera:
    """``fov``: rad, horizontal."""
    pose = look_at(np.array(eye, float), np.array(target, float))
    return Camera("camera", pose, Lens(size[0] * 1e-5 / 2 / np.tan(fov / 2)), Sensor(size, (1e-5, 1e-5)))


def placed(x: float, y: float, z: float, size: float = 1.0) -> np.ndarray:
    pose = np.diag([size, size, size, 1.0])
    pose[:3, 3] = x, y, z
    return pose


def aimed(place: tuple[float, float, float], target: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """``world_from_light`` of a lamp that shines at ``target``."""
    return np.asarray(look_at(np.array(place, float), np.array(target, float)) @ camera_from_gl)


def lit_table() -> Scene:
    """A table, a ball and a block under one lamp of each kind, and of each kind of beam."""
    files = ROOT / "assets" / "photometry"
    rng = np.random.default_rng(5)
    sky = Texture(rng.uniform(0, 1, (16, 32, 3)).astype(np.float32), (Wrap.REPEAT, Wrap.CLAMP))
    face = Texture(rng.uniform(0, 1, (8, 8, 1)).astype(np.float32))
    beams = {n: photometry.read(files / f"luxpy_test_lid_file{n}.ies") for n in ("", "2t")}
    panel = Camera(
        "/p", look_at(np.array([0.3, -0.3, 0.9]), np.zeros(3)), Lens(8e-3), Sensor((64, 48), (1e-4,) * 2)
    )
    bent = replace(panel, lens=Lens(8e-3, distortion=(-0.25, 0.1, 0.003, -0.002, 0.02, 0.03, -0.01, 0.004)))
    stripes = np.ones((48, 64, 1), np.float32) * ((np.arange(64) // 8) % 2)[None, :, None]
    left, right = aimed((-0.6, -0.2, 0.8)), aimed((0.4, 0.5, 0.9))
    lamps = (
        Light("point", LightKind.SPHERE, WHITE, left),
        Light("cone", LightKind.SPHERE, WHITE, right, cone_angle=0.5, cone_softness=0.5),
        Light("focus", LightKind.SPHERE, WHITE, left, focus=8.0, focus_tint=(0.1, 0.05, 0.0)),
        Light("sphere", LightKind.SPHERE, WHITE, right, radius=0.08),
        Light("disk", LightKind.DISK, WHITE, left, radius=0.1),
        Light("rect", LightKind.RECT, WHITE, right, width=0.3, height=0.15),
        Light("picture", LightKind.RECT, WHITE, left, width=0.3, height=0.3, texture=face),
        Light("cylinder", LightKind.CYLINDER, WHITE, right, radius=0.02, length=0.4),
        Light("sun", LightKind.DISTANT, WHITE, left, angle=0.0),
        Light("wide sun", LightKind.DISTANT, WHITE, right, angle=0.1),
        Light("dome", LightKind.DOME, WHITE, right),
        Light("sky", LightKind.DOME, WHITE, left, texture=sky),
        Light("profile", LightKind.SPHERE, (1e-3,) * 3, left, profile=beams[""]),
        Light("ring of LEDs", LightKind.DISK, (1e-3,) * 3, right, radius=0.02, profile=beams["2t"]),
        projector(panel, stripes, intensity=1.0, name="projector"),
        projector(bent, stripes, intensity=1.0, name="bent projector"),
    )
    metal = Lafortune((0.1,) * 3, weight=((0.8, 0.8, 0.8),), C=((-0.97, -0.97, 0.97),), n=(20,))
    bodies = (
        Body("/table", gprims.plane(2, 2), Material("matte", Lambert((0.5, 0.4, 0.3)))),
        Body("/ball", gprims.sphere(1.0), Material("metal", metal), placed(-0.15, 0.05, 0.12, 0.12)),
        Body("/block", gprims.box(0.15), Material("white", Lambert((0.8,) * 3)), placed(0.2, -0.1, 0.075)),
    )
    return Scene(bodies, lamps)


def balls() -> Scene:
    """A ball of every reflectance model with its example's parameters, and one of a table of random numbers."""
    table = TabulatedGoniometer.drawn(np.random.default_rng(6))
    brdfs = [*(model(**model.example) for model in MODELS.values()), table]
    bodies = [Body("/floor", gprims.plane(4, 3), Material("matte", Lambert((0.3,) * 3)), placed(0, 0, -0.13))]
    mesh = gprims.sphere(1.0)
    for k, brdf in enumerate(brdfs):
        x, y = 0.27 * (k % 7 - 3), 0.27 * (k // 7 - 2)
        bodies.append(Body(f"/ball{k}", mesh, Material(f"model {k}", brdf), placed(x, y, 0, 0.12)))
    lamps = (
        Light("/left", LightKind.SPHERE, (4.0,) * 3, aimed((-1.5, -1.0, 2.0)), radius=0.02),
        Light("/right", LightKind.SPHERE, (1.0, 1.2, 1.4), aimed((1.5, 0.5, 1.5)), radius=0.02),
    )
    return Scene(tuple(bodies), lamps)


def surfaces() -> Scene:
    """Maps of parameters, normals, opacity and emission, brushed metal, lamps in view."""
    rng = np.random.default_rng(7)

    def noise(channels: int, low: float, high: float, side: int = 24) -> np.ndarray:
        return rng.uniform(low, high, (side, side, channels)).astype(np.float32)

    checks = (np.indices((12, 12)).sum(axis=0) % 2)[..., None].astype(np.float32)
    turned = np.array([[6.0, -1.5, 0.3], [1.2, 5.0, -0.4], [0, 0, 1]])
    bumps = np.dstack([noise(2, -0.4, 0.4), np.ones((24, 24))])
    bumps = (bumps / np.linalg.norm(bumps, axis=2, keepdims=True)).astype(np.float32)
    floor = Material(
        "painted", Lambert((0.5,) * 3), {"diffuse": Texture(noise(3, 0.1, 0.9), uv_from_st=turned)}
    )
    rough = Texture(noise(1, 0.05, 0.4), (Wrap.MIRROR, Wrap.CLAMP), uv_from_st=turned)
    bumpy_paint = Material("bumpy", AshikhminShirley(), {}, Texture(bumps))
    brush = WardAnisotropic((0.05,) * 3, specular=(0.3,) * 3, alpha_x=0.08, alpha_y=0.4)
    brushed, worn = Material("brushed", brush), Material("worn", brush, {"alpha_x": rough})
    veil = Material("veil", Lambert((0.7,) * 3), opacity_map=Texture(0.2 + 0.6 * checks))
    grid = Material("grid", Lambert((0.7,) * 3), opacity_map=Texture(checks), opacity_threshold=0.5)
    glow = Material(
        "glow", Lambert((0.1,) * 3), emission_map=Texture(noise(3, 0, 0.5), (Wrap.BLACK, Wrap.REPEAT))
    )
    mesh, sheet = gprims.sphere(1.0), gprims.plane(0.35, 0.35)
    bodies = (
        Body("/floor", gprims.plane(2, 2), floor),
        Body("/bumpy", mesh, bumpy_paint, placed(-0.45, 0.1, 0.15, 0.15)),
        Body("/brushed", mesh, brushed, placed(-0.1, 0.1, 0.15, 0.15)),
        Body("/worn", mesh, worn, placed(0.25, 0.1, 0.15, 0.15)),
        Body("/glow", gprims.box(0.2), glow, placed(0.55, 0.1, 0.1)),
        Body("/veil", sheet, veil, placed(-0.25, -0.35, 0.2)),
        Body("/grid", sheet, grid, placed(0.2, -0.35, 0.2)),
    )
    lamps = (
        Light("/sphere", LightKind.SPHERE, (1.0, 0.9, 0.8), aimed((-0.4, 0.7, 0.6)), radius=0.05, visible=True),
        Light("/rect", LightKind.RECT, (1.0, 1.1, 1.2), aimed((0.5, 0.8, 0.5)), width=0.3, height=0.2, visible=True),
        Light("/sun", LightKind.DISTANT, (0.5,) * 3, aimed((0.3, -0.5, 1.0)), angle=0.02),
    )  # fmt: skip
    return Scene(bodies, lamps)

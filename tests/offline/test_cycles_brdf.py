"""Every BRDF of the catalogue: direct light pixel by pixel, and the light of a surrounding glow against quadrature."""

import numpy as np
import pytest

from interchange.brdf import MODELS, Brdf
from interchange.brdf.blinn_phong import BlinnPhong
from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.brdf.phong import Phong
from interchange.brdf.usd_preview_surface import UsdPreviewSurface
from interchange.camera import Projection
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from offline.settings import CyclesSettings

OFF_MIRROR = Lafortune(diffuse=(0.2, 0.1, 0.05), weight=((0.4, 0.5, 0.6),), C=((-1, -1, 0.75),), n=(15,))
RETRO = Lafortune(diffuse=0.1, weight=((0.5, 0.5, 0.5),), C=((0.8, 0.8, 0.7),), n=(8,))
ANISOTROPIC = Lafortune(diffuse=0.1, weight=(1.0, 0.3), C=((-1, -0.6, 0.9), (-0.97, -0.97, 0.97)), n=(20, 60))
CASES: list[Brdf] = [
    Lambert(0.5),
    OFF_MIRROR,
    RETRO,
    ANISOTROPIC,
    Phong(diffuse=0.3, specular=0.5, n=30),
    BlinnPhong(diffuse=0.3, specular=0.5, n=60),
    UsdPreviewSurface(diffuseColor=(0.5, 0.3, 0.1), roughness=0.4),
    UsdPreviewSurface(
        diffuseColor=(0.8, 0.6, 0.3), metallic=1.0, roughness=0.25, clearcoat=0.5, clearcoatRoughness=0.2
    ),
    *(model() for model in MODELS.values()),
]


def names(brdf: Brdf) -> str:
    return f"{type(brdf).__name__}-{CASES.index(brdf)}"


@pytest.mark.parametrize("brdf", CASES, ids=names)
def test_direct_light_of_a_point_is_the_formula(cycles, build, brdf):
    """One ray through each pixel's centre: no noise, so what is left is single precision."""
    lamp, eye = np.array([0.5, -0.3, 0.7]), (-0.9, -0.35, 0.6)
    light = Light("/l", LightKind.SPHERE, (4.0, 3.0, 2.0), build.at(*lamp))
    camera = build.camera(eye, (0.05, -0.05, 0), 40)
    image = cycles.render(
        build.lit_plane([light], brdf), camera, CyclesSettings(samples=1, max_bounces=0), ["position"]
    )
    x = image.passes["position"].astype(np.float64)
    d = lamp - x
    r = np.linalg.norm(d, axis=-1, keepdims=True)
    wo = np.array(eye) - x
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    expected = np.array(light.intensity) / r**2 * (d / r)[..., 2:] * brdf.evaluate(d / r, wo)
    assert np.abs(image.pixels - expected).max() < 1e-3 * expected.max()
    assert np.percentile(np.abs(image.pixels / expected - 1), 95) < 1e-3


def test_highlight_on_a_sphere(cycles, build):
    """Lafortune on a curved surface: the frame follows the shading normal and the mesh's tangent."""
    mesh = build.sphere(0.1)
    lamp, eye = np.array([0.4, -0.5, 0.6]), (0.0, -0.8, 0.3)
    scene = Scene(
        (Body("/ball", mesh, Material("m", ANISOTROPIC), build.at(0.01, 0.02, 0.03)),),
        (Light("/l", LightKind.SPHERE, (1.0, 1, 1), build.at(*lamp)),),
    )
    camera = build.camera(eye, (0.01, 0.02, 0.03), 10)
    image = cycles.render(scene, camera, CyclesSettings(samples=1, max_bounces=0), ["position", "normal"])
    x, n = (image.passes[k].astype(np.float64) for k in ("position", "normal"))
    assert np.nanmax(np.abs(n - (x - [0.01, 0.02, 0.03]) / 0.1)) < 2e-3  # 96 rings
    t = np.array([1.0, 0, 0]) - n * n[..., :1]
    steep = np.abs(n[..., 0]) >= 0.9
    t[steep] = (np.array([0, 1.0, 0]) - n * n[..., 1:2])[steep]
    t /= np.linalg.norm(t, axis=-1, keepdims=True)
    b = np.cross(n, t)
    d = lamp - x
    r = np.linalg.norm(d, axis=-1, keepdims=True)
    frame = np.stack([t, b, n], axis=-2)
    v = np.array(eye) - x
    wi = np.einsum("hwij,hwj->hwi", frame, d / r)
    wo = np.einsum("hwij,hwj->hwi", frame, v / np.linalg.norm(v, axis=-1, keepdims=True))
    expected = np.nan_to_num(wi[..., 2:] / r**2 * ANISOTROPIC.evaluate(wi, wo))
    # away from the rim, the terminator, and the seam where the fallback tangent changes its axis
    ok = (wo[..., 2] > 0.3) & (wi[..., 2] > 0.15) & (np.abs(np.abs(n[..., 0]) - 0.9) > 0.05)
    error = np.abs(image.pixels - expected)[ok]
    assert ok.sum() > 500
    assert error.max() < 2e-3 * expected[ok].max()


def albedo(brdf: Brdf, wo: np.ndarray) -> np.ndarray:
    """Directional albedo ∫ f cos dω by quadrature, fine around the mirror direction."""
    t = (np.arange(1500) + 0.5) / 1500 * np.pi / 2
    p = (np.arange(1500) + 0.5) / 1500 * 2 * np.pi
    wi = np.stack(
        [np.sin(t)[:, None] * np.cos(p), np.sin(t)[:, None] * np.sin(p), np.cos(t)[:, None] + 0 * p], axis=-1
    )
    weight = np.sin(t) * np.cos(t) * (np.pi / 2 / 1500) * (2 * np.pi / 1500)
    return np.einsum("tpc,t->c", brdf.evaluate(wi, wo), weight)


@pytest.mark.parametrize("brdf", CASES[:8], ids=names)
@pytest.mark.parametrize("by", ["dome", "glow"])
def test_furnace(cycles, build, brdf, by):
    """Under radiance 1 from everywhere a surface shows its directional albedo: by shadow rays to a dome (direct)
    and by reflected paths to a glowing shell (indirect). 576 pixels of 64 paths leave about 0.3 %."""
    camera = build.camera((1.0, 0, 1.2), (0, 0, 0), 0.002, (24, 24), projection=Projection.ORTHOGRAPHIC)
    wo = np.array([1.0, 0, 1.2]) / np.hypot(1.0, 1.2)
    bodies = [Body("/plane", build.plane(0.5), Material("m", brdf))]
    lights = []
    if by == "dome":
        lights = [Light("/dome", LightKind.DOME, (1.0, 1, 1))]
    else:
        shell = Material("shell", Lambert(0.0), emission=(1.0, 1, 1))
        bodies.append(Body("/shell", build.sphere(50.0, 24), shell))
    settings = CyclesSettings(samples=64, max_bounces=1, lamp_grid=1)
    image = cycles.render(Scene(tuple(bodies), tuple(lights)), camera, settings, ["direct", "indirect"])
    assert image.pixels.mean(axis=(0, 1)) == pytest.approx(albedo(brdf, wo), rel=1e-2)
    part = image.passes["direct" if by == "dome" else "indirect"]
    assert part.mean() == pytest.approx(image.pixels.mean(), rel=1e-4)


@pytest.mark.parametrize("by", ["dome", "glow"])
def test_a_lobe_of_exponent_2000_converges(cycles, build, by):
    """As the furnace, but every pixel by itself: drawn from its own lobe, a narrow one is no noisier than a wide one.
    One path in eleven is drawn elsewhere in case, hence a scatter of sqrt(0.1 / 64) = 4 % a pixel."""
    brdf = Lafortune(diffuse=0.0, weight=((50.0, 50, 50),), C=((-1, -1, 1),), n=(2000,))
    camera = build.camera((1.0, 0, 1.2), (0, 0, 0), 0.002, (24, 24), projection=Projection.ORTHOGRAPHIC)
    bodies, lights = [Body("/plane", build.plane(0.5), Material("m", brdf))], []
    if by == "dome":
        lights = [Light("/dome", LightKind.DOME, (1.0, 1, 1))]
    else:
        shell = Material("shell", Lambert(0.0), emission=(1.0, 1, 1))
        bodies.append(Body("/shell", build.sphere(50.0, 24), shell))
    settings = CyclesSettings(samples=64, max_bounces=1, lamp_grid=1)
    pixels = cycles.render(Scene(tuple(bodies), tuple(lights)), camera, settings).pixels
    wo = np.array([1.0, 0, 1.2]) / np.hypot(1.0, 1.2)
    # ∫ w (wi . r)^n cos dω of a narrow lobe: 2 pi / (n + 1) w cos, within 1 / n
    assert pixels.mean() == pytest.approx(50 * 2 * np.pi / 2001 * wo[2], rel=5e-3)
    assert pixels[..., 0].std() < 0.05 * pixels.mean()


def test_large_lamp_on_a_shiny_surface(cycles, build):
    """A rect lamp in the highlight of a narrow lobe, by quadrature over the lamp."""
    brdf = Lafortune(diffuse=0.1, weight=((5.0, 5, 5),), C=((-1, -1, 1),), n=(200,))
    light = Light("/l", LightKind.RECT, (1.0, 1, 1), build.at(-0.5, 0, 0.6), width=0.4, height=0.2)
    camera = build.camera((1.0, 0.05, 1.2), (0, 0, 0), 0.002, (24, 24), projection=Projection.ORTHOGRAPHIC)
    wo = np.array([1.0, 0.05, 1.2]) / np.linalg.norm([1.0, 0.05, 1.2])
    u, v = np.meshgrid((np.arange(600) + 0.5) / 600 - 0.5, (np.arange(600) + 0.5) / 600 - 0.5)
    d = np.stack([-0.5 + 0.4 * u, 0.2 * v, 0.6 + 0 * u], axis=-1)
    r2 = np.sum(d * d, axis=-1, keepdims=True)
    wi = d / np.sqrt(r2)
    expected = light.radiance * 0.08 * np.mean(brdf.evaluate(wi, wo) * wi[..., 2:] ** 2 / r2, axis=(0, 1))
    image = cycles.render(build.lit_plane([light], brdf), camera, CyclesSettings(samples=16, max_bounces=0))
    assert image.pixels.mean(axis=(0, 1)) == pytest.approx(expected, rel=5e-3)
    assert image.pixels.std() < 0.25 * image.pixels.mean()  # drawn from the lobe and the lamp: little noise


def test_interreflection_between_two_matte_planes(cycles, build):
    """A closed matte cube around one lamp: reflected light brings Φ ρ / (A (1 - ρ)) to the walls, by energy balance."""
    rho = 0.5
    half = build.plane(0.5)
    turns = [np.eye(3), np.diag([1.0, -1, -1]), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])]
    turns += [np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])]
    turns += [np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])]
    walls = tuple(
        Body(f"/w{k}", half, Material("m", Lambert(rho)), build.at(*(-0.5 * R[:, 2]), R))
        for k, R in enumerate(turns)
    )
    light = Light("/l", LightKind.SPHERE, (1.0, 1, 1), build.at(0, 0, 0))
    total = np.zeros(3)
    for k, R in enumerate(
        turns
    ):  # six views from the middle; the view's own solid angle weights cancel per wall
        n = R[:, 2]
        camera = build.camera(tuple(0.45 * n), tuple(-n), 1.0, (24, 24), projection=Projection.ORTHOGRAPHIC)
        image = cycles.render(
            Scene(walls, (light,)), camera, CyclesSettings(samples=32, max_bounces=24, seed=k), ["indirect"]
        )
        total += image.passes["indirect"].mean(axis=(0, 1)) * np.pi / rho
    # irradiance by reflected light, mean over the walls: ρ/(1-ρ) of the lamp's own mean, Φ/A = 4π I / 6
    assert total / 6 == pytest.approx([rho / (1 - rho) * 4 * np.pi / 6] * 3, rel=5e-3)

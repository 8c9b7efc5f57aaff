"""Devices and measured lamps in both renderers, against closed forms."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.formats import gprims, photometry
from interchange.frames import look_at
from interchange.lamps import composite
from interchange.lamps.reflector import ReflectorDevice
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from realtime.renderers.rasterizer import Rasterizer

ASSETS = Path(__file__).parents[2] / "assets" / "photometry"
RHO = 0.5


@pytest.fixture(scope="module")
def cycles():
    with Cycles(timeout=120) as renderer:
        yield renderer


@pytest.fixture(scope="module")
def rasterizer():
    with Rasterizer() as renderer:
        yield renderer


def at(x: float, y: float, z: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def above(width: float, pixels: int = 32, height: float = 2.0) -> Camera:
    """Telecentric, straight down at a square of ``width`` m."""
    pitch = width / pixels
    return Camera(
        "above",
        look_at(np.array([0, 0, height]), np.zeros(3), up=(0, 1, 0)),
        Lens(projection=Projection.ORTHOGRAPHIC),
        Sensor((pixels, pixels), (pitch, pitch)),
    )


def plane(lights, size: float = 4.0) -> Scene:
    return Scene((Body("/plane", gprims.plane(size, size), Material("matte", Lambert(RHO))),), tuple(lights))


def both(cycles, rasterizer, scene: Scene, camera: Camera, samples: int = 32) -> list[np.ndarray]:
    """Irradiance (H, W) in the middle channel by the rasteriser and by the path tracer."""
    live = rasterizer.render(scene, camera, samples=samples)
    true = cycles.render(scene, camera, CyclesSettings(samples=16, max_bounces=0))
    return [image.pixels[..., 1] * np.pi / RHO for image in (live, true)]


def plane_points(camera: Camera) -> np.ndarray:
    """(H, W, 3): where the pixels' centres meet z = 0."""
    width, height = camera.sensor.resolution
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).astype(float)
    origin, direction = camera.rays(pixels)
    return origin - direction * (origin[..., 2:] / direction[..., 2:])


@pytest.mark.parametrize(
    "file", ["luxpy_test_lid_file.ies", "luxpy_test_lid_file.ldt", "luxpy_test_lid_file2t.ies"]
)
def test_photometric_files_light_a_plane(cycles, rasterizer, file: str) -> None:
    """E = I(θ, φ) cos³ θ / h² of a point with the file's candela, in LM-63 and in EULUMDAT."""
    profile = photometry.read(ASSETS / file)
    lamp = Light("/lamp", LightKind.SPHERE, (1e-3,) * 3, at(0, 0, 1.0), profile=profile)
    camera = above(3.0)
    p = plane_points(camera)
    d2 = np.sum(p * p, axis=-1) - p[..., 2] ** 2 + 1
    candela = profile.evaluate(np.arccos(1 / np.sqrt(d2)), np.arctan2(p[..., 1], p[..., 0]))
    expected = 1e-3 * candela / d2**1.5
    for E in both(cycles, rasterizer, plane([lamp]), camera):
        # a pixel is a mean over 94 mm of a curve with edges between the file's angles
        assert np.abs(E / expected - 1).mean() < 5e-3
        assert E.mean() == pytest.approx(expected.mean(), rel=1e-3)


@pytest.mark.parametrize("kind", [2, 3])
def test_other_goniometers_light_a_plane(cycles, rasterizer, kind: int, tmp_path) -> None:
    """A beam of type B (2) or A (3), wide in one direction: written as a file, seen on a plane."""
    angle = np.arange(-60, 61, 2.0)
    h, v = np.radians(angle)[:, None], np.radians(angle)
    candela = 1000 * np.exp(-((h / 0.5) ** 2) - (v / 0.2) ** 2)
    rows = [angle, angle, *candela]
    body = "\n".join(" ".join(f"{x:.9g}" for x in row) for row in rows)
    (tmp_path / "b.ies").write_text(
        f"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {len(angle)} {len(angle)} {kind} 2 0 0 0\n1 1 0\n{body}\n"
    )
    profile = photometry.read(tmp_path / "b.ies")
    lamp = Light("/lamp", LightKind.SPHERE, (1e-3,) * 3, at(0, 0, 1.0), profile=profile)
    camera = above(1.0)
    p = plane_points(camera)
    x, y = p[..., 0], p[..., 1]
    d = np.sqrt(x * x + y * y + 1)
    if kind == 2:
        h, v = np.arcsin(x / d), np.arctan2(y, 1)
    else:
        h, v = np.arctan2(x, 1), np.arcsin(y / d)
    expected = np.exp(-((h / 0.5) ** 2) - (v / 0.2) ** 2) / d**3
    for E in both(cycles, rasterizer, plane([lamp]), camera):
        # two bilinear tables, of 2 and of 1 degree: 2 / 0.2² (0.035)² / 8 of the peak, once and again
        assert np.abs(E - expected).max() < 0.02
        assert E.sum() == pytest.approx(expected.sum(), rel=5e-3)


@pytest.mark.parametrize("step", [(0.0, 0), (2.2, 3), (4.0, 5)])
def test_the_reflectors_field_in_both_renderers(cycles, rasterizer, step) -> None:
    """Irradiance E(0) cos θ at the focus, from L(φ, θ), and the fall-off over the field; shadows point away."""
    device = ReflectorDevice()
    low, high = device.polar_range
    phi, theta = step[0], low + (0.7 * high - low) * step[1] / 5
    camera = above(0.030, 24)
    (scene,) = device.series(plane([], 0.2), np.array([[phi, theta]]))
    p = plane_points(camera)
    L = device.direction(phi, theta)
    place = L * device.distance(theta)
    to = place - p
    d = np.linalg.norm(to, axis=-1)
    alpha = np.arccos(np.clip(to @ L / d, -1, 1))
    peak = device.reflectance * device.spot_power(theta) / device.lobe_integral
    # one lobe from the middle of the spot: sub-spots aim at the focus each for itself, which moves this by (s / d)²
    tilt = np.arccos(np.clip(np.sum(-to / d[..., None] * -L, axis=-1), -1, 1))
    expected = peak * np.exp(-((tilt / device.dulling) ** 2) / 2) * to[..., 2] / d**3
    assert alpha.max() < 0.2
    for E in both(cycles, rasterizer, scene, camera, 64):
        assert E[12, 12] == pytest.approx(float(device.irradiance(theta)) * np.cos(theta), rel=0.02)
        assert np.abs(E / expected - 1).max() < 0.03
        assert E.mean() == pytest.approx(expected.mean(), rel=0.01)


def test_a_rod_at_the_focus_throws_its_shadow_away_from_the_light(cycles, rasterizer) -> None:
    device = ReflectorDevice()
    phi, theta = 0.5, np.radians(45)
    height = 0.004
    scene = plane(device.lights(phi, theta), 0.2)
    pose = at(0, 0, height / 2) @ np.diag([0.125, 0.125, 1, 1])
    rod = Body("/rod", gprims.box(height), Material("black", Lambert(0.0)), pose)
    scene = replace(scene, bodies=(*scene.bodies, rod))
    camera = above(0.016, 64)
    p = plane_points(camera)
    for E in both(cycles, rasterizer, scene, camera, 64):
        dark = (0.6 * np.median(E) > E) & (np.hypot(p[..., 0], p[..., 1]) > 0.001)
        tip = p[dark].mean(axis=0)
        assert np.arctan2(-tip[1], -tip[0]) == pytest.approx(phi, abs=0.1)
        assert np.hypot(*tip[:2]) == pytest.approx((0.001 + height * np.tan(theta)) / 2, rel=0.15)


@pytest.mark.parametrize("hole", [0.0, 0.06])
def test_a_dome_lights_its_centre(cycles, rasterizer, hole: float) -> None:
    """E = π L cos² θ_h: what leaves the base, over its area."""
    lights = composite.dome(2.0, 0.1, hole)
    for E in both(cycles, rasterizer, plane(lights), above(0.01, 16), 256):
        # 1024 directions over a sphere, of which the horizon and the edge of the hole cut some
        assert E.mean() == pytest.approx(2.0 / (np.pi * 0.1**2), rel=0.015)


def test_a_ring_lights_its_axis(cycles, rasterizer) -> None:
    """Σ I cos α cos θ / d² of small Lambertian disks, tilted by 30° towards the axis."""
    tilt, radius, height = np.radians(30), 0.05, 0.06
    lights = composite.ring(1.2, radius, 8, tilt, led_radius=1e-3, world_from_lamp=at(0, 0, height))
    d = np.hypot(radius, height)
    cos_theta = height / d
    cos_alpha = np.cos(np.arctan2(radius, height) - tilt)
    expected = 1.2 / np.pi * cos_alpha * cos_theta / d**2
    for E in both(cycles, rasterizer, plane(lights), above(1e-4, 8), 16):
        assert E.mean() == pytest.approx(expected, rel=3e-3)


def test_a_backlight_shows_what_stands_before_it(cycles, rasterizer) -> None:
    """The camera sees the face's own radiance beside a black disk, and black where it stands."""
    up = at(0, 0, -0.01) @ np.diag([1.0, -1.0, -1.0, 1.0])
    lights = composite.backlight(0.5, 0.1, 0.1, world_from_lamp=up)
    part = Body("/part", gprims.plane(0.02, 0.02), Material("black", Lambert(0.0)))
    scene = Scene((part,), lights)
    camera = above(0.04, 32)
    L = 0.5 / (np.pi * 0.1**2)
    inside = np.abs(plane_points(camera)[..., :2]).max(axis=-1)
    for E in both(cycles, rasterizer, scene, camera, 16):
        seen = E * RHO / np.pi
        assert seen[inside > 0.011] == pytest.approx(L, rel=1e-4)
        assert seen[inside < 0.009] == pytest.approx(0, abs=1e-6)

"""Radiance of a Lambertian plane under every kind of lamp, against closed forms of its irradiance."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.brdf.lambert import Lambert
from interchange.light import Light, LightKind, Profile, latlong_direction
from interchange.material import Material, Texture, Wrap, evaluate_texture
from interchange.scene import Body, Scene

RHO = np.array([0.2, 0.5, 0.8])
POWER = np.array([1.0, 2.0, 3.0])
EXACT = 2e-5  # float32 through a dozen operations
SPREAD = 3e-3  # 256 low-discrepancy points of a lamp near by


def irradiance(rasterizer, make, light, samples):
    """Seen by a camera that looks obliquely at the origin of a plane. Shadows, where there are none to see, are
    drawn with few samples only, for the sake of time."""
    light = replace(light, casts_shadows=samples <= 64)
    scene = Scene((Body("/plane", make.plane(), Material("matte", Lambert(tuple(RHO)))),), (light,))
    image = rasterizer.render(scene, make.telecentric((0.3, -0.7, 0.5), (0, 0, 0)), samples=samples)
    assert np.ptp(image.pixels, axis=(0, 1)).max() <= 1e-3 * image.pixels.max()
    return image.pixels.mean(axis=(0, 1)) * np.pi / RHO


def polygon_irradiance(corners, radiance):
    """Lambert's formula at the origin, normal z, corners above the horizon: E = L / 2 sum of gamma_i (n . g_i)."""
    a = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    b = np.roll(a, -1, axis=0)
    normal = np.cross(a, b)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return radiance * abs(np.sum(np.arccos(np.sum(a * b, axis=1)) * normal[:, 2])) / 2


@pytest.mark.parametrize("place", [(0, 0, 0.3), (0.2, 0.1, 0.4), (3.0, -2.0, 2.5)])
def test_point(rasterizer, make, place):
    light = Light("lamp", LightKind.SPHERE, tuple(POWER), make.at(*place))
    d2 = np.dot(place, place)
    expected = POWER * place[2] / d2**1.5
    assert np.allclose(irradiance(rasterizer, make, light, 1), expected, rtol=EXACT)


@pytest.mark.parametrize(
    ("place", "radius"), [((0, 0, 0.3), 0.1), ((0.25, 0, 0.3), 0.15), ((0, 0, 0.02), 0.019)]
)
def test_sphere_above_the_horizon_is_as_bright_as_its_centre(rasterizer, make, place, radius):
    light = Light("lamp", LightKind.SPHERE, tuple(POWER), make.at(*place), radius=radius)
    expected = POWER * place[2] / np.dot(place, place) ** 1.5
    assert np.allclose(irradiance(rasterizer, make, light, 256), expected, rtol=SPREAD)


@pytest.mark.parametrize(("distance", "radius"), [(0.3, 0.05), (0.1, 0.2), (1.0, 1.5)])
def test_disk_on_the_axis(rasterizer, make, distance, radius):
    light = Light("lamp", LightKind.DISK, tuple(POWER), make.at(0, 0, distance), radius=radius)
    expected = np.pi * light.radiance * radius**2 / (radius**2 + distance**2)
    assert np.allclose(irradiance(rasterizer, make, light, 256), expected, rtol=SPREAD)


@pytest.mark.parametrize("target", [(0, 0, 0), (0.4, 0, 0.31), (0.2, 0.3, 0.05)])
@pytest.mark.parametrize("size", [(0.3, 0.2), (0.02, 0.5)])
def test_rect_near_by(rasterizer, make, target, size):
    pose = make.facing((-0.1, 0.05, 0.3), target)
    corners = [
        pose @ [x * size[0], y * size[1], 0, 1]
        for x, y in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    ]
    light = Light("lamp", LightKind.RECT, tuple(POWER), pose, width=size[0], height=size[1])
    corners = np.array(corners)[:, :3]
    faces_the_origin = (-pose[:3, 3]) @ -pose[:3, 2] > 0
    assert (corners[:, 2] > 0).all()
    assert faces_the_origin
    expected = polygon_irradiance(corners, light.radiance)
    assert np.allclose(irradiance(rasterizer, make, light, 256), expected, rtol=2 * SPREAD)


def test_rect_shines_to_one_side(rasterizer, make):
    light = Light(
        "lamp", LightKind.RECT, tuple(POWER), make.facing((0, 0, 0.3), (0, 0, 1)), width=0.1, height=0.1
    )
    assert (irradiance(rasterizer, make, light, 16) == 0).all()


def test_line(rasterizer, make):
    length, d = 0.6, 0.2
    light = Light("lamp", LightKind.CYLINDER, tuple(POWER), make.at(0, 0, d), length=length)
    a = length / 2
    expected = POWER / length * d**2 * 2 * (a / (2 * d**2 * (d**2 + a**2)) + np.arctan(a / d) / (2 * d**3))
    assert np.allclose(irradiance(rasterizer, make, light, 256), expected, rtol=SPREAD)


def test_thick_cylinder(rasterizer, make):
    """Against its surface summed up piece by piece."""
    length, radius, d = 0.5, 0.08, 0.2
    light = Light("lamp", LightKind.CYLINDER, tuple(POWER), make.at(0.1, 0, d), radius=radius, length=length)
    x = 0.1 + (np.arange(2000) + 0.5) / 2000 * length - length / 2
    phi = (np.arange(4000) + 0.5) / 4000 * 2 * np.pi
    outward = np.stack([0 * phi, np.cos(phi), np.sin(phi)], axis=-1)
    total = 0.0
    for xi in x:
        y = np.array([xi, 0, d]) + radius * outward
        r2 = np.sum(y * y, axis=1)
        total += np.sum(np.maximum(-np.sum(outward * y, axis=1), 0) * y[:, 2] / r2**2)
    expected = light.radiance * total * (length / 2000) * (radius * 2 * np.pi / 4000)
    assert np.allclose(irradiance(rasterizer, make, light, 256), expected, rtol=SPREAD)


@pytest.mark.parametrize("angle", [0.0, 0.01, 0.8])
@pytest.mark.parametrize("tilt", [0.0, 0.9])
def test_distant(rasterizer, make, angle, tilt):
    pose = make.facing((np.sin(tilt), 0, np.cos(tilt)), (0, 0, 0))
    light = Light("sun", LightKind.DISTANT, tuple(POWER), pose, angle=angle)
    rtol = SPREAD if angle > 0.1 else 1e-4
    assert np.allclose(
        irradiance(rasterizer, make, light, 1 if angle == 0 else 256), POWER * np.cos(tilt), rtol=rtol
    )


def test_dome(rasterizer, make):
    light = Light("sky", LightKind.DOME, tuple(POWER), make.facing((1, 2, 3), (0, 0, 0)))
    assert np.allclose(irradiance(rasterizer, make, light, 64), np.pi * POWER, rtol=SPREAD)


def test_dome_with_a_texture(rasterizer, make):
    """One bright patch on a smooth sky, turned: against a sum over the map."""
    rng = np.random.default_rng(3)
    pixels = rng.uniform(0.5, 1.0, (16, 32, 3)).astype(np.float32)
    pixels[3:5, 20:23] = 30.0
    texture = Texture(pixels, (Wrap.REPEAT, Wrap.CLAMP))
    pose = make.facing((1, 2, 3), (0, 0, 0))
    light = Light("sky", LightKind.DOME, tuple(POWER), pose, texture=texture)
    n = 800
    u, v = np.meshgrid((np.arange(2 * n) + 0.5) / (2 * n), (np.arange(n) + 0.5) / n)
    uv = np.stack([u, v], -1)
    cosine = np.maximum((latlong_direction(uv) @ pose[:3, :3].T)[..., 2], 0) * np.sin(np.pi * v)
    expected = (
        POWER * np.sum(evaluate_texture(texture, uv) * cosine[..., None], axis=(0, 1)) * np.pi**2 / n**2
    )
    assert np.allclose(
        irradiance(rasterizer, make, light, 256), expected, rtol=0.01
    )  # 1024 directions, some through the bright patch


def test_rect_with_a_texture_stands_upright(rasterizer, make):
    """Half of the face is dark: the light comes from the half at +x, the texture's left, and +y, its top."""
    pixels = np.zeros((2, 2, 1), np.float32)
    pixels[0, 0] = 1.0
    texture = Texture(pixels, (Wrap.CLAMP, Wrap.CLAMP))
    pose = make.at(0, 0, 0.4)
    light = Light("lamp", LightKind.RECT, tuple(POWER), pose, width=0.4, height=0.4, texture=texture)
    x, y = np.meshgrid((np.arange(400) + 0.5) / 1000 - 0.2, (np.arange(400) + 0.5) / 1000 - 0.2)
    value = evaluate_texture(texture, np.stack([0.5 - x / 0.4, 0.5 + y / 0.4], -1))[..., 0]
    expected = light.radiance * np.sum(value * 0.4**2 / (x**2 + y**2 + 0.4**2) ** 2) * 1e-6
    assert np.allclose(irradiance(rasterizer, make, light, 256), expected, rtol=SPREAD)
    hidden = Body("/screen", make.plane(0.1, 0.1), Material("m", Lambert()), make.at(0.05, 0.05, 0.2))
    scene = Scene((Body("/plane", make.plane(), Material("m", Lambert(0.5))), hidden), (light,))
    under = rasterizer.render(scene, make.telecentric((0.3, -0.7, 0.5), (0, 0, 0)), samples=64)
    assert under.pixels.max() < 0.5 * (expected * 0.5 / np.pi).max()


@pytest.mark.parametrize(
    "shape",
    [
        {"cone_angle": 0.7, "cone_softness": 0.5},
        {"cone_angle": 0.6},
        {"cone_angle": 0.3},
        {"focus": 6.0, "focus_tint": (0.5, 0.0, 0.2)},
        {"profile": "asymmetric"},
        {"profile": "round", "profile_angle_scale": 0.8},
        {"profile": "asymmetric", "profile_angle_scale": -0.9, "cone_angle": 1.2, "cone_softness": 1.0},
    ],
)
def test_shaping(rasterizer, make, shape):
    rng = np.random.default_rng(5)
    vertical = np.sort(rng.uniform(0, 1.6, 12))
    vertical[0] = 0.0
    profiles = {
        "asymmetric": Profile(np.linspace(0, 2 * np.pi, 9), vertical, rng.uniform(1, 2, (9, 12))),
        "round": Profile(np.zeros(1), vertical, rng.uniform(1, 2, (1, 12))),
    }
    shape = dict(shape)
    if "profile" in shape:
        shape["profile"] = profiles[shape["profile"]]
    place = np.array([0.2, 0.1, 0.4])
    pose = make.facing(place, (-0.1, 0.05, 0))
    light = Light("lamp", LightKind.SPHERE, tuple(POWER), pose, **shape)
    away = -place / np.linalg.norm(place)
    expected = POWER * light.shaping(away @ pose[:3, :3]) * place[2] / np.dot(place, place) ** 1.5
    assert np.allclose(
        irradiance(rasterizer, make, light, 1), expected, rtol=3e-4, atol=1e-9
    )  # atan in float32

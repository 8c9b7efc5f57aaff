"""Normals from series come back exactly where their model holds, and nearly where it does not."""

import numpy as np
import pytest

from analysis.series.integration import heights
from analysis.series.lightings import hemisphere, unit
from analysis.series.mirror_sphere import (
    Sphere,
    highlights,
    lamp_positions,
    lights_of_sphere,
    outline_of,
    sphere_of_outline,
)
from analysis.series.near_lamps import at_heights, seen_from
from analysis.series.near_stereo import near_photometric_stereo
from analysis.series.photometric_stereo import Method, angular_error, photometric_stereo
from analysis.series.specimens import camera_above
from analysis.series.specular_direction import specular_normals
from interchange.camera import Camera, Lens, Sensor
from interchange.frames import look_at
from interchange.problems import BrightfieldError
from interchange.series import Series

WI = unit(hemisphere(np.radians([20, 35, 50, 65]), 12))
SIZE = 20
UP = np.array([0.0, 0, 1])
rng = np.random.default_rng(3)


def cap(size=SIZE, steep=0.25):
    """Normals (size, size, 3) of a dome so shallow that no lamp is behind it; y up in the image."""
    x, y = np.meshgrid(np.linspace(-steep, steep, size), -np.linspace(-steep, steep, size))
    n = np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1)
    return n


N = cap()
RHO = rng.uniform(0.2, 0.9, N.shape[:2])


def lambert(wi=WI, n=N, noise=0.0):
    y = RHO / np.pi * np.maximum(np.einsum("lk,hwk->lhw", wi, n), 0)
    return 3.0 * (y + noise * rng.normal(size=y.shape) * RHO / np.pi)


def series(images, **more):
    return Series(images[..., None], WI, np.full(len(WI), 3.0), **more)


def degrees(n, truth=N):
    return np.degrees(angular_error(n, truth))


@pytest.mark.parametrize("method", list(Method))
def test_matte_normals_and_albedo_come_back(method):
    found = photometric_stereo(series(lambert()), method)
    assert degrees(found.n).max() < 0.01  # images are single precision
    np.testing.assert_allclose(found.rho, RHO, rtol=1e-4)


def test_the_error_is_that_of_the_normal_equations():
    """cov(g) = σ² (WᵀW)⁻¹: the spread of 400 pixels against it, within 4 standard deviations of a variance (2/400)."""
    flat = np.broadcast_to([0.0, 0, 1], N.shape)
    y = 0.5 / np.pi * WI[:, 2, None, None] + 1e-3 * rng.normal(size=(len(WI), SIZE, SIZE))
    found = photometric_stereo(Series(y[..., None], WI))
    g = found.n * found.rho[..., None] / np.pi
    expected = 1e-6 * np.diag(np.linalg.inv(WI.T @ WI))
    np.testing.assert_allclose(
        (g - 0.5 / np.pi * flat).reshape(-1, 3).var(axis=0), expected, rtol=4 * np.sqrt(2 / 400)
    )


def corrupted():
    """Highlights of a narrow lobe, and every fifth lamp in cast shadow over half of the pixels."""
    images = lambert()
    h = WI + UP
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    images = images + 1.5 * np.maximum(np.einsum("lk,hwk->lhw", h, N), 0) ** 120
    images[::5, :, : SIZE // 2] *= 0.02
    return images


@pytest.mark.parametrize(("method", "limit"), [(Method.RANKS, 4.0), (Method.L1, 2.0), (Method.RANSAC, 0.6)])
def test_robust_methods_stand_highlights_and_shadows(method, limit):
    plain = degrees(photometric_stereo(series(corrupted())).n).mean()
    robust = degrees(photometric_stereo(series(corrupted()), method).n).mean()
    assert plain > 3
    assert robust < limit, plain


def test_saturated_samples_are_left_out():
    images = lambert()
    valid = images < np.quantile(images, 0.8)
    images = np.where(valid, images, 9.0)
    assert degrees(photometric_stereo(series(images, valid=valid)).n).max() < 0.01
    assert degrees(photometric_stereo(series(images)).n).mean() > 2


def test_a_pixel_with_two_lamps_has_no_normal():
    valid = np.ones((len(WI), SIZE, SIZE), bool)
    valid[2:, 4, 5] = False
    found = photometric_stereo(series(lambert(), valid=valid))
    assert np.isnan(found.n[4, 5]).all()
    assert np.isfinite(found.n).all(axis=-1).sum() == SIZE**2 - 1
    with pytest.raises(BrightfieldError, match="three lamps or more"):
        photometric_stereo(series(lambert()).choose([0, 1]))
    ring = unit(np.stack([np.zeros(4), np.linspace(0.1, 1, 4)], axis=-1))
    with pytest.raises(BrightfieldError, match="three lamps or more"):
        photometric_stereo(Series(lambert()[:4, ..., None], ring))


def test_heights_of_a_plane_and_a_paraboloid_are_exact():
    x, y = np.meshgrid(np.arange(12.0), -np.arange(15.0))
    for z in (0.3 * x - 0.2 * y, 0.01 * x**2 - 0.02 * y**2 + 0.005 * x * y):
        down, right = np.gradient(z, edge_order=2)
        n = np.stack([-right, down, np.ones_like(z)], axis=-1)
        n /= np.linalg.norm(n, axis=-1, keepdims=True)
        np.testing.assert_allclose(heights(n, 1.0), z - z.mean(), atol=1e-9)


def test_near_lamps_are_solved_with_the_surface():
    """A dome of 1.3 mm under lamps 60 mm away: with directions for the plane it tilts, by iteration it does not."""
    camera = camera_above(48, 15e-3)
    origin, _ = camera.rays(np.stack(np.meshgrid(np.arange(48.0), np.arange(48.0)), axis=-1))
    x, y = origin[..., 0], origin[..., 1]
    z = 1.3e-3 * np.exp(-(x**2 + y**2) / (2 * 3e-3**2))
    n = np.stack([z * x / 3e-3**2, z * y / 3e-3**2, np.ones_like(z)], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    places = 0.06 * WI
    wi, E = seen_from(at_heights(camera, z), places, np.ones(len(WI)))
    images = 0.5 / np.pi * E * np.maximum(np.einsum("lhwk,hwk->lhw", wi, n), 0)
    assumed_wi, assumed_E = seen_from(at_heights(camera, np.zeros_like(z)), places, np.ones(len(WI)))
    s = Series(images[..., None], assumed_wi, assumed_E, positions=places, camera=camera)
    plain = degrees(photometric_stereo(s).n, n).mean()
    found = near_photometric_stereo(s, plane=float(z.mean()), shadow=0.02)
    distant = Series(images[..., None], WI, np.full(len(WI), 1 / 0.06**2))
    assert degrees(photometric_stereo(distant).n, n).mean() > 1.5
    assert degrees(found.normals.n, n).mean() < 0.25 * plain
    assert np.abs(found.heights - z).max() < 0.03e-3
    assert found.change < 1e-6


def test_the_highlight_tells_the_normal():
    """exp(m (n . h - 1)) is the model itself; Phong-like cos^m of the half angle nearly so."""
    h = WI + UP
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    cos = np.einsum("lk,hwk->lhw", h, N)
    found = specular_normals(series(np.exp(40 * (cos - 1))), matte=0.0, least=1e-4)
    assert degrees(found, N).max() < 0.05
    found = specular_normals(series(0.05 + np.maximum(cos, 0) ** 25))
    assert degrees(found, N).mean() < 1.5


TELECENTRIC = camera_above(200, 20e-3)
PERSPECTIVE = Camera(
    "c",
    look_at(np.array([0.02, -0.05, 0.3]), np.array([0.0, 0, 5e-3])),
    Lens(25e-3),
    Sensor((400, 300), (5e-6, 5e-6)),
)


def mirror(camera, sphere, wi):
    """The pixel where a distant lamp is mirrored: the point whose normal halves the angle, by iteration."""
    n = wi + UP
    for _ in range(60):
        n = n / np.linalg.norm(n)
        v = UP
        if camera is PERSPECTIVE:
            v = camera.world_from_camera[:3, 3] - sphere.center - sphere.radius * n
            v = v / np.linalg.norm(v)
        n = wi + v
    return camera.project((sphere.center + sphere.radius * n / np.linalg.norm(n))[None])[0]


@pytest.mark.parametrize("camera", [TELECENTRIC, PERSPECTIVE], ids=["telecentric", "perspective"])
def test_a_mirror_sphere_tells_the_directions(camera):
    """Outline and highlights of a sphere of 5 mm that lies on z = 0, projected; then back."""
    sphere = Sphere(np.array([1e-3, 0.5e-3, 5e-3]), 5e-3)
    eye = np.array([0, 0, 1.0]) if camera is TELECENTRIC else camera.world_from_camera[:3, 3] - sphere.center
    d = float(np.linalg.norm(eye))
    axis = eye / d
    t = np.cross(axis, [1.0, 0, 0])
    t /= np.linalg.norm(t)
    around = np.linspace(0, 2 * np.pi, 60)[:, None]
    # the outline lies where tangents from the eye touch
    lift = 0.0 if camera is TELECENTRIC else sphere.radius / d
    ring = np.cos(around) * t + np.sin(around) * np.cross(axis, t)
    edge = sphere.center + sphere.radius * (lift * axis + np.sqrt(1 - lift**2) * ring)
    found = sphere_of_outline(camera, camera.project(edge), 5e-3)
    np.testing.assert_allclose(found.center, sphere.center, atol=1e-8)
    pixels = np.stack([mirror(camera, sphere, w) for w in WI[::7]])
    seen = lights_of_sphere(camera, found, pixels)
    assert np.degrees(angular_error(seen.wi, WI[::7])).max() < 0.01


def test_two_spheres_place_a_lamp():
    place = np.array([0.03, -0.02, 0.08])
    seen = []
    for center in ([6e-3, 0, 3e-3], [-6e-3, 2e-3, 3e-3]):
        sphere = Sphere(np.array(center), 3e-3)
        w, point = place - sphere.center, sphere.center
        for _ in range(50):  # the lamp is near: its direction is that from the point of reflection
            w = place - point
            w /= np.linalg.norm(w)
            n = w + UP
            point = sphere.center + 3e-3 * n / np.linalg.norm(n)
        seen.append(lights_of_sphere(TELECENTRIC, sphere, TELECENTRIC.project(point[None])))
    np.testing.assert_allclose(lamp_positions(seen)[0], place, atol=1e-7)
    with pytest.raises(BrightfieldError, match="two spheres"):
        lamp_positions(seen[:1])


def test_outline_and_highlight_are_found_between_pixels():
    y, x = np.indices((80, 90))
    disc = np.clip(20.3 - np.hypot(x - 41.7, y - 38.2) + 0.5, 0, 1)
    outline = outline_of(disc)
    np.testing.assert_allclose(np.hypot(outline[:, 0] - 41.7, outline[:, 1] - 38.2), 20.3, atol=0.1)
    spot = np.exp(-((x - 45.35) ** 2 + (y - 30.8) ** 2) / 18) + 0.3 * np.exp(
        -((x - 10) ** 2 + (y - 70) ** 2) / 50
    )
    np.testing.assert_allclose(highlights(spot[None])[0], (45.35, 30.8), atol=0.02)
    with pytest.raises(BrightfieldError, match="shows no highlight"):
        highlights(np.zeros((1, 5, 5)))

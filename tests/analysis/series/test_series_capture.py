"""A series is captured, resumed, and means what its lamps say."""

import numpy as np
import pytest

from analysis.series.capture import capture
from analysis.series.lightings import distant, dome, hemisphere, reflector
from analysis.series.registration import check_registered, registration
from analysis.series.specimens import circuit_board, coin, textured_plastic
from interchange.brdf.lambert import Lambert
from interchange.lamps.reflector import ReflectorDevice
from interchange.material import Material
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene
from interchange.series import Series
from realtime.renderers.rasterizer import Rasterizer

SPECIMEN = textured_plastic(24, defects=False)
ANGLES = hemisphere(np.radians([15, 45]), 6)


@pytest.fixture(scope="module")
def rasterizer():
    with Rasterizer() as r:
        yield r


def flat(albedo):
    """A matte plane below the specimen's camera."""
    from analysis.series.specimens import relief

    mesh, _ = relief(np.zeros((3, 3)), 20e-3)
    return Scene((Body("/plane", mesh, Material("/matte", Lambert(diffuse=(albedo,) * 3))),))


@pytest.mark.parametrize("kind", ["distant", "dome", "reflector"])
def test_a_matte_plane_reflects_albedo_over_pi(rasterizer, tmp_path, kind):
    """L = rho / pi E cos θ, whichever lamp. Four samples of a lamp's disk give E within 0.5 %; the reflector
    is 0.15 to 0.3 m away, and a corner is 10 mm nearer to it: E on a plane goes with d⁻³, and is 16 % off at most."""
    lamps = {
        "distant": distant(ANGLES),
        "dome": dome(ANGLES, 0.1),
        "reflector": reflector(ReflectorDevice(), 6, 2),
    }[kind]
    series = capture(
        flat(0.4), SPECIMEN.camera, lamps, tmp_path, lambda s, c: rasterizer.render(s, c, samples=4), {}
    )
    cos = series.wi[..., 2] if series.wi.ndim == 4 else series.wi[:, 2, None, None]
    albedo = np.pi * series.per_irradiance / cos
    assert abs(albedo[:, 8:16, 8:16].mean() / 0.4 - 1) < 1e-2
    np.testing.assert_allclose(albedo, 0.4, rtol=0.2 if kind == "reflector" else 6e-3)


def test_a_capture_goes_on_where_it_stopped(rasterizer, tmp_path):
    calls = []

    def render(scene, camera):
        calls.append(1)
        return rasterizer.render(scene, camera, samples=1)

    lamps = distant(ANGLES)
    args = (SPECIMEN.scene, SPECIMEN.camera, lamps, tmp_path, render, {"samples": 1})
    first = capture(*args, digital=True, exposure=1e-3)
    assert len(calls) == len(lamps)
    (tmp_path / "images" / "003.png").unlink()
    again = capture(*args, digital=True, exposure=1e-3)
    assert len(calls) == len(lamps) + 1
    assert np.array_equal(first.images, again.images)  # the same noise as well
    with pytest.raises(BrightfieldError, match="must be empty or hold a part of this very series"):
        capture(*args, digital=True, exposure=2e-3)


def test_the_exposure_nearly_fills_the_sensor(rasterizer, tmp_path):
    calls = []

    def render(scene, camera):
        calls.append(1)
        return rasterizer.render(scene, camera, samples=1)

    series = capture(SPECIMEN.scene, SPECIMEN.camera, distant(ANGLES), tmp_path, render, {}, digital=True)
    radiance = capture(SPECIMEN.scene, SPECIMEN.camera, distant(ANGLES), tmp_path / "true", render, {})
    exposure, sensor = series.made_by["exposure"], SPECIMEN.camera.sensor
    count = len(calls)
    again = capture(SPECIMEN.scene, SPECIMEN.camera, distant(ANGLES), tmp_path, render, {}, digital=True)
    assert len(calls) == count  # nothing is rendered twice, nor is the exposure looked for again
    assert np.array_equal(again.images, series.images)
    electrons = np.quantile(radiance.images, 0.999) * sensor.responsivity * exposure
    assert 0.6 < electrons / sensor.full_well < 1.0
    assert series.usable.mean() > 0.995
    np.testing.assert_allclose(series.grey.mean(axis=(1, 2)), radiance.grey.mean(axis=(1, 2)), rtol=0.01)


def test_a_moved_frame_is_found_and_named(rasterizer, tmp_path):
    plate = textured_plastic(64, defects=False)
    series = capture(
        plate.scene, plate.camera, distant(hemisphere(np.radians([30, 50]), 8)), tmp_path,
        lambda s, c: rasterizer.render(s, c, samples=1), {},
    )  # fmt: skip
    check_registered(series)
    images = series.images.copy()
    images[5] = np.roll(images[5], (3, -2), (0, 1))
    moved = Series(images, series.wi, names=series.names)
    np.testing.assert_allclose(registration(moved).shift[5], (3, -2), atol=0.5)
    with pytest.raises(BrightfieldError, match=r"1 of 16 moved .*images/005\.exr \(-"):
        check_registered(moved)


def test_noise_alone_has_not_moved():
    rng = np.random.default_rng(0)
    wi = np.repeat([[0.0, 0.0, 1.0]], 8, axis=0)
    found = registration(Series(rng.random((8, 64, 64, 1)), wi))
    assert np.isnan(found.shift).all()


@pytest.mark.parametrize("make", [textured_plastic, circuit_board, coin])
def test_a_specimen_shows_all_its_classes(make):
    specimen = make(64)
    assert np.array_equal(np.unique(specimen.truth), np.arange(len(specimen.classes)))
    np.testing.assert_allclose(np.linalg.norm(specimen.normals, axis=-1), 1)
    assert np.argmax(np.bincount(specimen.truth.ravel())) == (1 if make is coin else 0)

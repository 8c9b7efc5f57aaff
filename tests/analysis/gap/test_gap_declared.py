"""What the scene file says that a colour camera does to its pixels is taken back, and weighed where that cannot be."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.judgement import verify
from analysis.gap.light.radiance import Rendered
from analysis.gap.processed.binned import binning_of, times_binned
from analysis.gap.processed.compressed import processings, with_errors
from analysis.gap.processed.declared import Plain, without_declared
from analysis.gap.processed.matrices import Matrix, mixed_further
from analysis.gap.processed.processing import notes
from interchange.camera import Camera
from interchange.captures import Capture, Captures
from interchange.exposure import expose
from interchange.image import Image, Quantity
from interchange.sensor import IDENTITY, Demosaic, Mosaic, Response, Sensor
from tests.analysis.gap.colour_camera import CAMERA, LAMP, MIXED, SCENE, SENSOR


def tiles() -> np.ndarray:
    """(120, 160, 3) radiance, tiles of some colour, 13 px wide, so that the matrix cuts few off."""
    rng = np.random.default_rng(7)
    whole = rng.uniform(0.05, 0.3, (10, 13, 1)) * rng.uniform(0.7, 1.0, (10, 13, 3))
    return np.kron(whole, np.ones((13, 13, 1)))[:120, :160].astype(np.float32)


def given(pixels: np.ndarray, sensor: Sensor) -> tuple[Captures, Any]:
    camera = replace(CAMERA, sensor=sensor)
    document = SimpleNamespace(
        scene=lambda time=None: replace(SCENE, cameras=(camera,)), stage=None, path=None, problems=[]
    )
    capture = Capture("a.png", CAMERA.name, 0.0, 1.0, pixels, bits=8)
    return Captures(Path("c.json"), Path("s.usda"), (capture,)), document


def plain_of(pixels: np.ndarray, sensor: Sensor) -> Plain:
    return without_declared(*given(pixels, sensor))


@pytest.mark.parametrize("way", [Demosaic.BILINEAR, Demosaic.EDGE_AWARE])
@pytest.mark.parametrize("matrix", [MIXED, IDENTITY])
def test_a_jpeg_of_a_camera_that_is_as_the_file_says_is_as_expected(
    way: Demosaic, matrix: tuple[float, ...]
) -> None:
    """As the camera itself takes it: interpolated, mixed, encoded, compressed. What that does to a simulation without
    it is gone from the captures or weighed."""
    radiance = tiles()
    sensor = replace(SENSOR, demosaic=way, color_correction=matrix)
    camera = replace(CAMERA, sensor=sensor)
    taken = expose(Image(radiance, Quantity.RADIANCE, camera), camera, rng=np.random.default_rng(3)).pixels
    plain = plain_of(taken, sensor)
    told = plain.document.scene().cameras[0]
    assert (told.sensor.mosaic, told.sensor.color_correction) == (Mosaic.NONE, IDENTITY)
    assert (told.sensor.jpeg_quality, told.sensor.response) == (95, Response.SRGB)

    (back,) = plain.captures.captures
    nothing = np.zeros_like(radiance)
    shown = Rendered(SCENE, told, {LAMP: radiance}, {LAMP: np.ones(3)}, nothing, nothing, {}, {})
    mask = np.ones(radiance.shape[:2], bool) if back.mask is None else back.mask
    bare = Condition((back,), SCENE, told, back.pixels, None, mask, rendered=shown)
    before = processings([bare], said=plain.processed)
    assert (before[CAMERA.name].mosaic, before[CAMERA.name].demosaic) == (Mosaic.GRBG, way)
    assert notes(list(before.values())) == []  # the file says it
    (c,) = with_errors([bare], before)
    simulated, ok = c.simulated(), bare.compared
    assert ok.mean() > 0.5
    off, off_before = (np.square(x.mean - simulated.dn)[ok] for x in (c, bare))
    assert off.mean() < 0.15 * off_before.mean()
    assert (off / simulated.variance[ok]).mean() < 1.15


def test_the_corrected_scene_is_rendered_as_it_was_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says what the file said, and captures have had that taken back."""
    pixels = np.full((120, 160, 3), 90, np.float32)
    plain = plain_of(pixels, SENSOR)
    told = plain.document.scene().cameras[0]
    mask = np.ones(pixels.shape[:2], bool)
    own = Condition(plain.captures.captures, SCENE, told, pixels, None, mask)
    seen: list[Camera] = []

    def render_all(views: Any, *_: object) -> list[Rendered]:
        seen.extend(camera for _, camera in views)
        nothing = np.zeros_like(pixels)
        return [Rendered(SCENE, camera, {}, {}, nothing, nothing, {}, {}) for _, camera in views]

    monkeypatch.setattr(verify, "open_scene", lambda file: SimpleNamespace(scene=lambda time: SCENE))
    monkeypatch.setattr(verify, "render_all", render_all)
    registration: Any = SimpleNamespace(simulated=lambda c: c.simulated().dn)
    by: Any = SimpleNamespace(chi2=lambda dn: 1.0)
    found = verify.verified(
        Path("new.usda"),
        [own],
        registration,
        by,
        1.0,
        (),
        lambda *_: None,
        {},
        Path("cache"),
    )
    assert found.holds
    assert [(c.sensor.mosaic, c.sensor.color_correction) for c in seen] == [(Mosaic.NONE, IDENTITY)]
    assert seen[0].sensor.jpeg_quality == 95


def test_what_captures_show_besides_comes_before_what_is_said() -> None:
    """A matrix that is left where the said one was taken back, and a mosaic where none is said."""
    left = np.array([[1.1, -0.1, 0.0], [0.0, 1.2, -0.2], [-0.3, 0.0, 1.3]])
    by = Matrix(CAMERA.name, left, (0.0,) * 6)
    said = np.array(MIXED).reshape(3, 3)
    (camera,) = mixed_further(SCENE, [by]).cameras
    assert np.reshape(camera.sensor.color_correction, (3, 3)) == pytest.approx(said @ left)
    bare = replace(CAMERA, sensor=replace(SENSOR, color_correction=IDENTITY))
    (camera,) = mixed_further(replace(SCENE, cameras=(bare,)), [by]).cameras
    assert np.reshape(camera.sensor.color_correction, (3, 3)) == pytest.approx(left)

    radiance = tiles()
    sensor = replace(SENSOR, mosaic=Mosaic.NONE)
    taken = expose(Image(radiance, Quantity.RADIANCE, CAMERA), CAMERA, rng=np.random.default_rng(3)).pixels
    plain = plain_of(taken, sensor)
    (back,) = plain.captures.captures
    told = plain.document.scene().cameras[0]
    nothing = np.zeros_like(radiance)
    shown = Rendered(SCENE, told, {LAMP: radiance}, {LAMP: np.ones(3)}, nothing, nothing, {}, {})
    assert back.mask is not None
    c = Condition((back,), SCENE, told, back.pixels, None, back.mask, rendered=shown)
    found = processings([c], [by], plain.processed)[CAMERA.name]
    assert found.mosaic is Mosaic.GRBG
    assert len(notes([found])) == 1  # the file says none
    assert found.matrix is not None
    assert found.matrix.rows == pytest.approx(said @ left)


def test_large_jpegs_of_a_mosaic_are_binned() -> None:
    large = replace(SENSOR, resolution=(1200, 1000))
    pixels = np.full((1000, 1200, 3), 90, np.float32)
    captures, document = given(pixels, large)
    assert times_binned(captures, document) == 2
    plain = without_declared(captures, document)
    by = binning_of(plain.captures, plain.document, 2)
    assert (by.n, by.colours) == (2, False)


def test_what_is_not_said_or_not_to_be_taken_back_stays() -> None:
    pixels = np.full((120, 160, 3), 90, np.float32)
    flat = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0)  # every channel is red
    for sensor in (
        replace(SENSOR, mosaic=Mosaic.NONE, color_correction=IDENTITY),
        replace(SENSOR, color_correction=flat),
    ):
        plain = plain_of(pixels, sensor)
        assert not plain.processed
        assert plain.document.scene().cameras[0].sensor == sensor
        assert np.array_equal(plain.captures.captures[0].pixels, pixels)
    raw = plain_of(pixels[..., :1], SENSOR)
    assert not raw.processed
    assert raw.document.scene().cameras[0].sensor == SENSOR

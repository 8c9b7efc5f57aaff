"""Means over pixels of JPEGs of a colour camera, taken by the camera itself: as expected where what it does to its
pixels is simulated on them."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.radiance import Rendered, means
from analysis.gap.measures.ledger import temporal_scale
from analysis.gap.processed.binned import Binning, binned_camera, binned_captures
from analysis.gap.processed.compressed import Compressed
from analysis.gap.processed.declared import without_declared
from analysis.gap.processed.means import compressed_files, own_pixels, with_errors_of_means
from analysis.gap.processed.processing import Processing
from interchange.captures import Capture, Captures
from interchange.exposure import expose
from interchange.image import Image, Quantity
from interchange.scene import Scene
from interchange.sensor import IDENTITY, Mosaic, Sensor
from tests.analysis.gap import colour_camera
from tests.analysis.gap.colour_camera import LAMP, MIXED, SCENE

SENSOR = replace(colour_camera.SENSOR, resolution=(320, 240))
CAMERA = replace(colour_camera.CAMERA, sensor=SENSOR)
N = 2


def tiles() -> np.ndarray:
    """(240, 320, 3) radiance, tiles of some colour, 27 px wide, so that edges lie within means and between them, and
    the matrix cuts few off."""
    rng = np.random.default_rng(7)
    whole = rng.uniform(0.05, 0.3, (9, 12, 1)) * rng.uniform(0.7, 1.0, (9, 12, 3))
    return np.kron(whole, np.ones((27, 27, 1)))[:240, :320].astype(np.float32)


def taken(behind: Sensor, said: Sensor, finely: bool, repeats: int = 1) -> tuple[Condition, list[Processing]]:
    """A condition by a camera with one sensor where the scene file says another, with its errors; and what of it is
    simulated."""
    radiance, nothing = tiles(), np.zeros((240 // N, 320 // N, 3), np.float32)
    real, camera = (replace(CAMERA, sensor=s) for s in (behind, said))
    scene = replace(SCENE, cameras=(camera,))
    document: Any = SimpleNamespace(scene=lambda time=None: scene, stage=None, path=None, problems=[])
    captures = tuple(
        Capture(
            f"{k}.png",
            CAMERA.name,
            0.0,
            1.0,
            expose(Image(radiance, Quantity.RADIANCE, real), real, rng=np.random.default_rng(k)).pixels,
            bits=8,
            jpeg=(behind.jpeg_quality, True) if behind.jpeg_quality else None,
        )
        for k in range(repeats)
    )
    plain = without_declared(Captures(Path("c.json"), Path("s.usda"), captures), document)
    by = Binning(N, cameras=frozenset({CAMERA.name}))
    few = binned_captures(plain.captures, plain.document, by).captures
    own = own_pixels(plain.captures, plain.document.scene(), N)
    packed = compressed_files(plain.captures, own)
    told = binned_camera(own.told(packed).cameras[CAMERA.name], N)
    fine = {LAMP: radiance.astype(np.float16)} if finely else {}
    shown = Rendered(
        scene, told, {LAMP: means(radiance, N)}, {LAMP: np.ones(3)}, nothing, nothing, {}, {}, fine=fine
    )
    stack = np.stack([c.pixels for c in few])
    mask = np.all([c.mask for c in few], axis=0)
    spread = stack.var(axis=0, ddof=1) if repeats > 1 else None
    bare = Condition(few, scene, told, stack.mean(axis=0), spread, mask, rendered=shown)
    (c,), processed = with_errors_of_means([bare], own.told(packed), plain.processed)
    return c, processed


def off(c: Condition) -> float:
    """Mean χ²."""
    simulated, ok = c.simulated(), c.compared
    assert ok.mean() > 0.5
    return float((np.square(c.mean - simulated.dn)[ok] / simulated.variance[ok]).mean())


@pytest.mark.parametrize("finely", [True, False])
@pytest.mark.parametrize("matrix", [MIXED, IDENTITY])
def test_means_of_what_the_file_says_are_as_expected(matrix: tuple[float, ...], finely: bool) -> None:
    """With light that was rendered as finely as pixels are, edges too: what is weighed has what is taken off in it, so
    that less is left than that, all over tiles that are smaller than what it is told over. Without, edges weigh less,
    by a guess of how sharp they are."""
    sensor = replace(SENSOR, color_correction=matrix)
    c, (processed,) = taken(sensor, sensor, finely)
    assert (processed.mosaic, processed.mosaic_is_said) == (Mosaic.GRBG, True)
    assert 0.1 < off(c) < (1.1 if finely else 1.6)
    assert off(replace(c, packed=None)) > 1.5  # by the model of a sensor whose pixels measure every channel


@pytest.mark.parametrize("mosaic", [Mosaic.BGGR, Mosaic.NONE])
def test_a_mosaic_that_the_file_does_not_say_is_told_by_noise(mosaic: Mosaic) -> None:
    sensor = replace(SENSOR, mosaic=mosaic, color_correction=IDENTITY)
    c, (processed,) = taken(sensor, replace(sensor, mosaic=Mosaic.NONE), True)
    assert processed.mosaic is mosaic
    assert not processed.mosaic_is_said
    assert 0.1 < off(c) < 1.1


def test_files_say_that_they_are_jpegs() -> None:
    """Of a camera of which the scene says neither that nor how many bits its files have."""
    sensor = replace(SENSOR, mosaic=Mosaic.NONE, color_correction=IDENTITY)
    said = replace(sensor, jpeg_quality=0, output_bit_depth=0)
    c, (processed,) = taken(sensor, said, True, repeats=2)
    assert processed.camera.sensor.jpeg_quality == 95
    assert processed.camera.sensor.jpeg_subsampling
    assert c.camera.sensor.jpeg_quality == 0  # whose blocks are of the own pixels
    assert 0.1 < off(c) < 1.1
    assert temporal_scale([c]) is None  # repeats of a JPEG tell no noise


def test_what_is_no_jpeg_stays_as_it_is() -> None:
    sensor = replace(SENSOR, mosaic=Mosaic.NONE, color_correction=IDENTITY, jpeg_quality=0)
    c, processed = taken(sensor, sensor, True)
    assert processed == []
    assert c.packed is None
    assert off(c) == pytest.approx(1, abs=0.12)


def test_pixels_that_are_no_jpeg_by_name_are_looked_at() -> None:
    sensor = replace(SENSOR, mosaic=Mosaic.NONE, color_correction=IDENTITY, jpeg_quality=0)
    pixels = expose(
        Image(tiles(), Quantity.RADIANCE, CAMERA),
        replace(CAMERA, sensor=replace(sensor, jpeg_quality=80)),
        rng=np.random.default_rng(1),
    ).pixels
    capture = Capture("a.png", CAMERA.name, 0.0, 1.0, pixels, bits=8)
    captures = Captures(Path("c.json"), Path("s.usda"), (capture,))
    own = own_pixels(captures, Scene(cameras=(replace(CAMERA, sensor=sensor),)), N)
    assert compressed_files(captures, own) == [Compressed(CAMERA.name, 80, True)]

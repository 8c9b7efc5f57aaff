"""Captures of a colour camera whose scene file says of no mosaic are taken for what they are."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from analysis.gap.processed.mosaics import mosaic_of, must_say_its_mosaic
from interchange.camera import Camera, Lens, Sensor
from interchange.captures import Capture, Captures
from interchange.effects.demosaic import Demosaic as Interpolation
from interchange.effects.mosaic import phases
from interchange.image import Image
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.sensor import Demosaic, Mosaic

W, H = 128, 96
SENSOR = Sensor((W, H), (5e-6, 5e-6), 80.0, 9000.0, 12, 64.0, 8.0)
CAMERA = Camera("/World/Camera", lens=Lens(12e-3), sensor=SENSOR, t_exp=0.02)
SAID = replace(SENSOR, mosaic=Mosaic.RGGB)
ROOT = Path(__file__).parents[3]
PATTERNS = [m for m in Mosaic if m.is_bayer]


def _seen(seed: int = 1) -> np.ndarray:
    """(H, W, 3) DN of coloured discs with shading, edges and noise."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:H, :W].astype(np.float32)
    dn = np.stack([400 + 4 * x, 900 + 3 * y, 700 + x + y], axis=2)
    for _ in range(12):
        cx, cy, r = rng.uniform(0, W), rng.uniform(0, H), rng.uniform(6, 20)
        dn[np.hypot(x - cx, y - cy) < r] = rng.uniform(100, 3000, 3)
    return np.rint(dn + np.sqrt(0.4 * dn) * rng.standard_normal(dn.shape)).astype(np.float32)


def _raw(pattern: Mosaic, dn: np.ndarray) -> np.ndarray:
    out = np.empty((H, W, 1), np.float32)
    for i, j, channel in phases(pattern):
        out[i::2, j::2, 0] = dn[i::2, j::2, channel]
    return out


def _taken(pixels: np.ndarray) -> Capture:
    return Capture("a.png", CAMERA.name, 0.0, CAMERA.t_exp, pixels.astype(np.float32))


@pytest.mark.parametrize("method", [Demosaic.BILINEAR, Demosaic.EDGE_AWARE])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_pattern_and_way_are_told(pattern: Mosaic, method: Demosaic) -> None:
    made = Interpolation(method, pattern).apply(Image(_raw(pattern, _seen())), CAMERA, None).pixels
    assert mosaic_of([_taken(made)], CAMERA) == (pattern, method)


def _gradients(pattern: Mosaic, dn: np.ndarray) -> np.ndarray:
    """By the variable number of gradients, of 8 bits."""
    raw = np.clip(_raw(pattern, dn) / 16, 0, 255).astype(np.uint8)
    return np.asarray(cv2.demosaicing(raw, getattr(cv2, f"COLOR_Bayer{pattern.value}2RGB_VNG")))


def _malvar(pattern: Mosaic, dn: np.ndarray) -> np.ndarray:
    """Malvar, He, Cutler: High-quality linear interpolation for demosaicing of Bayer-patterned color images. ICASSP
    2004, fig. 2; then sRGB's curve, or near it, of 8 bits. Interpolated values have as much noise as those measured."""
    raw = _raw(pattern, dn)[..., 0]
    cross = np.zeros((5, 5))
    cross[2], cross[:, 2] = [-1, 2, 4, 2, -1], [-1, 2, 4, 2, -1]
    beside = np.array(
        [[0, 0, 0.5, 0, 0], [0, -1, 0, -1, 0], [-1, 4, 5, 4, -1], [0, -1, 0, -1, 0], [0, 0, 0.5, 0, 0]]
    )
    corner = np.zeros((5, 5))
    corner[1::2, 1::2], corner[2, [0, 2, 4]], corner[[0, 4], 2] = 2, [-1.5, 6, -1.5], -1.5
    by = {name: cv2.filter2D(raw, -1, k.astype(np.float32) / 8)
          for name, k in (("cross", cross), ("row", beside), ("column", beside.T), ("corner", corner))}  # fmt: skip
    out = np.empty((H, W, 3), np.float32)
    red_row = next(i for i, _, channel in phases(pattern) if channel == 0)
    for i, j, channel in phases(pattern):
        own = (slice(i, None, 2), slice(j, None, 2))
        out[(*own, channel)] = raw[own]
        if channel == 1:
            for c in (0, 2):
                out[(*own, c)] = by["row" if (c == 0) == (i == red_row) else "column"][own]
        else:
            out[(*own, 1)], out[(*own, 2 - channel)] = by["cross"][own], by["corner"][own]
    return np.asarray(np.rint(255 * (np.clip(out, 0, 4095) / 4095) ** (1 / 2.2)))


@pytest.mark.parametrize("made", [_gradients, _malvar])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_way_that_is_none_of_ours_is_told_by_its_pattern(
    pattern: Mosaic, made: Callable[[Mosaic, np.ndarray], np.ndarray]
) -> None:
    found = mosaic_of([_taken(made(pattern, _seen()))], CAMERA)
    assert found is not None
    assert found[0] is pattern


def test_what_every_pixel_measured_is_left_alone() -> None:
    """Noise, edges, few pixels, one channel, a mosaic that the scene says, and columns that differ by their gains."""
    dn = _seen()
    assert mosaic_of([_taken(dn)], CAMERA) is None
    assert mosaic_of([_taken(dn * np.where(np.arange(W) % 2, 1.02, 1.0)[:, None])], CAMERA) is None
    made = (
        Interpolation(Demosaic.BILINEAR, Mosaic.RGGB).apply(Image(_raw(Mosaic.RGGB, dn)), CAMERA, None).pixels
    )
    assert mosaic_of([_taken(made[:40, :40])], CAMERA) is None
    assert mosaic_of([_taken(made), _taken(_raw(Mosaic.RGGB, dn))], CAMERA) is None
    mosaics = Camera("/World/Camera", sensor=Sensor((W, H), (5e-6, 5e-6), mosaic=Mosaic.RGGB))
    assert mosaic_of([_taken(made)], mosaics) is None


@pytest.mark.parametrize("pattern", PATTERNS)
def test_raw_captures_ask_for_their_mosaic(pattern: Mosaic) -> None:
    """Red and blue may be the other way round; even light and grey paint would show no more than noise."""
    scene = Scene(cameras=(CAMERA,))
    given = Captures(Path("captures.json"), Path("scene.usda"), (_taken(_raw(pattern, _seen())),))
    with pytest.raises(BrightfieldError, match=f"sensor:mosaic = .*{pattern.value}"):
        must_say_its_mosaic(given, scene)
    must_say_its_mosaic(given, replace(scene, cameras=(replace(CAMERA, sensor=SAID),)))


@pytest.mark.parametrize("columns", [1.0, 1.02])
def test_what_a_sensor_without_colours_takes_asks_for_none(columns: float) -> None:
    """Edges, gradients and noise; columns that differ by their gains."""
    grey = _seen().mean(axis=2, keepdims=True) * np.where(np.arange(W) % 2, columns, 1.0)[:, None]
    must_say_its_mosaic(
        Captures(Path("captures.json"), Path("scene.usda"), (_taken(grey),)), Scene(cameras=(CAMERA,))
    )


def test_a_camera_whose_mosaic_is_known_asks_for_it() -> None:
    """The Flea3 of assets/flea3: its pixels under one wavelength. Its pattern is GBRG, whose greens are GRBG's too."""
    file = next((ROOT / "assets/flea3").glob("colorChecker_550nm*.png"))
    pixels = np.asarray(cv2.imread(str(file), cv2.IMREAD_UNCHANGED))[..., None]
    given = Captures(Path("captures.json"), Path("scene.usda"), (_taken(pixels),))
    with pytest.raises(BrightfieldError, match="GRBG or GBRG"):
        must_say_its_mosaic(given, Scene(cameras=(CAMERA,)))

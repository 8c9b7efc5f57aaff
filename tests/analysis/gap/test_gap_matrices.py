"""Captures that went through a camera's colour matrix, of which the scene file does not say, are taken for what they
are."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.gap.finding import Estimate
from analysis.gap.processed.matrices import Matrix, as_mixed, matrices, numbers, unmixed, with_matrices
from interchange.camera import Camera, Sensor
from interchange.captures import Capture, Captures
from interchange.effects.color_crosstalk import ColorCrosstalk
from interchange.effects.response_curve import ResponseCurve
from interchange.exposure import expose
from interchange.image import Image, Quantity
from interchange.scene import Scene
from interchange.sensor import Response

ROWS = np.array([[1.5, -0.4, -0.1], [-0.25, 1.45, -0.2], [-0.05, -0.5, 1.55]])
BLACK = 64.0
SENSOR = Sensor((160, 120), (5e-6, 5e-6), 80.0, 9000.0, 12, BLACK, 8.0)
CAMERA = Camera("/World/Camera0", sensor=SENSOR, t_exp=0.02)
FOUND = Matrix(CAMERA.name, ROWS, (0.01,) * 6)


def _patches(seed: int, colours: int = 16) -> np.ndarray:
    """(120, 160, 3) DN of a chart, lit by a lamp that falls off."""
    rng = np.random.default_rng(seed)
    chart = np.random.default_rng(0).uniform(500, 1800, (4, 4, 3))
    chart.reshape(-1, 3)[colours:] = 900.0
    dn = np.kron(chart, np.ones((30, 40, 1)))
    y, x = np.mgrid[:120, :160]
    return np.asarray(
        dn * (1 - rng.uniform(0.1, 0.5) * ((x - 80) ** 2 + (y - 60) ** 2)[..., None] / 1e4) + BLACK
    )


def _condition(dn: np.ndarray, by: np.ndarray, camera: Camera = CAMERA) -> Any:
    """``dn`` is simulated; captured is that with a lens that darkens, a white balance, ``by`` and noise."""
    rng = np.random.default_rng(1)
    x = np.linspace(-1, 1, 160)[None, :, None]
    seen = (dn - BLACK) * [1.05, 1.0, 0.93] * (1 - 0.2 * x * x)
    noisy = seen + np.sqrt(0.4 * seen) * rng.standard_normal(seen.shape)
    there = np.ones(dn.shape[:2], bool)
    curve = ResponseCurve.of(camera)
    simulated, mean = (curve.output(x, 12, BLACK) for x in (dn, noisy @ by.T + BLACK))
    return SimpleNamespace(
        camera=camera,
        mean=mean,
        compared=there,
        simulated=lambda: SimpleNamespace(dn=simulated),
    )


def test_a_matrix_is_told_by_camera_whatever_the_lens_and_the_gains() -> None:
    other = replace(CAMERA, name="/World/Camera1")
    own: Sequence[Any] = [_condition(_patches(k), ROWS) for k in range(4)]
    (found,) = matrices([*own, *(_condition(_patches(k), np.eye(3), other) for k in range(4))])
    assert found.camera == CAMERA.name
    # gains before the matrix are within its rows, whose sums are 1
    want = ROWS * [1.05, 1.0, 0.93]
    want /= want.sum(axis=1, keepdims=True)
    assert found.rows == pytest.approx(want, abs=0.01)  # 1000 px a colour of 3 % noise
    told = numbers([found], {})
    assert (told["rg"].value, told["bg"].value) == pytest.approx(
        (found.rows[0, 1], found.rows[2, 1]), rel=1e-14
    )
    assert all(0 < x.sigma < 0.01 for x in told.values())
    more = numbers([found], {"rg": Estimate(0.02, 0.003, "1")})["rg"]
    assert more.sigma == 0.003
    assert more.value == pytest.approx(0.98 * found.rows[0, 1] + 0.02 * (found.rows[0, 0] + found.rows[0, 1]))
    two = numbers([found, replace(found, camera=other.name)], {})
    assert {"Camera0 rg", "Camera1 bg"} < set(two)


def test_a_matrix_is_told_before_a_curve_that_is_known() -> None:
    camera = replace(CAMERA, sensor=replace(SENSOR, response=Response.SRGB, output_bit_depth=8))
    own: Sequence[Any] = [_condition(_patches(k), ROWS, camera) for k in range(4)]
    (found,) = matrices(own)
    assert found.rows[0, 1] == pytest.approx(-0.4 / (1.5 * 1.05 - 0.4 - 0.1 * 0.93), abs=0.01)


@pytest.mark.parametrize("gamma", [0.7, 1.1, 1.15, 1.3, 1.6])
def test_a_curve_that_is_not_known_is_no_matrix(gamma: float) -> None:
    """One that makes colours stronger, as a matrix does, among them."""
    plain: Sequence[Any] = [_condition(_patches(k), np.eye(3)) for k in range(4)]
    curve = ResponseCurve(gamma=gamma)
    for c in plain:
        c.mean = curve.output(c.mean, 12, BLACK)
    assert matrices(plain) == []


@pytest.mark.parametrize("colours", [3, 5, 16])
def test_one_paint_that_is_off_is_no_matrix(colours: int) -> None:
    """Of few colours a matrix would explain it."""
    conditions: Sequence[Any] = [_condition(_patches(k, colours), np.eye(3)) for k in range(4)]
    for c in conditions:
        c.mean[30:60, 40:80] = (c.mean[30:60, 40:80] - BLACK) * [1.4, 0.7, 0.9] + BLACK
    for c in conditions if colours < 16 else []:
        c.mean[:30, 40:80] = (c.mean[:30, 40:80] - BLACK) * [1.4, 0.7, 0.9] + BLACK
    assert matrices(conditions) == []


def test_a_matrix_is_told_of_few_paints_whose_channels_it_cuts_off() -> None:
    """Five paints as a bench has them, of which five of fifteen channels are below 0: they leave the matrix open. What
    is told makes its colours, and no larger shares than they need."""
    paints = np.array([[1, 1, 1], [2.4, 0.35, 0.26], [0.47, 1.97, 0.56], [0.26, 0.53, 2.2], [2.0, 0.8, 0.2]])
    camera = replace(CAMERA, sensor=replace(SENSOR, black_level=0.0))
    chart = 600 * np.kron(paints[[0, 1, 2, 3, 4, 0, 3, 2]].reshape(2, 4, 3), np.ones((60, 40, 1)))
    own: Sequence[Any] = [_condition(k * chart + BLACK, ROWS, camera) for k in (0.5, 1.0, 1.5)]
    for c in own:
        simulated = c.simulated().dn - BLACK
        c.mean, c.simulated = np.maximum(c.mean - BLACK, 0), lambda dn=simulated: SimpleNamespace(dn=dn)
    (found,) = matrices(own)
    gains = np.array([1.05, 1.0, 0.93])
    white = ROWS @ gains
    for paint in paints:
        made, want = (np.maximum(x, 0) for x in (found.rows @ paint, ROWS @ (gains * paint) / white))
        assert made / made.sum() == pytest.approx(want / want.sum(), abs=0.01)  # as a paint may be off
    assert np.abs(found.rows[~np.eye(3, dtype=bool)]).max() < 0.5  # the matrix's own largest


def test_what_sensors_do_is_no_matrix() -> None:
    """Gains, light that leaks into other channels, and what no three colours tell."""
    leaks = ColorCrosstalk(rg=0.1, gr=0.08, gb=0.05, bg=0.1).matrix
    for by, colours in ((np.eye(3), 16), (leaks, 16), (ROWS, 2)):
        conditions: Sequence[Any] = [_condition(_patches(k, colours), by) for k in range(4)]
        assert matrices(conditions) == []


@pytest.mark.parametrize("bits", [8, 12])
def test_captures_are_as_they_were_before(bits: int) -> None:
    """What the camera with that matrix takes, against the one without; what was cut off is masked."""
    light = np.broadcast_to(np.linspace(1, 6500, 160)[None, :, None], (120, 160, 3)) * [1.0, 0.5, 0.4]
    image = Image(light.astype(np.float32), Quantity.RADIANCE, CAMERA)
    response = Response.SRGB if bits == 8 else Response.LINEAR
    camera = replace(CAMERA, sensor=replace(SENSOR, output_bit_depth=bits, read_noise=0.0, response=response))
    mixing = with_matrices(Scene(cameras=(camera,)), [FOUND]).cameras[0]
    assert mixing.sensor.color_correction == tuple(ROWS.ravel())
    pixels = [
        np.mean([expose(image, c, rng=np.random.default_rng(k)).pixels for k in range(100)], axis=0)
        for c in (camera, mixing)
    ]
    plain, mixed = (np.rint(x) if bits == 8 else x for x in pixels)
    capture = Capture("a.png", CAMERA.name, 0.0, CAMERA.t_exp, mixed.astype(np.float32), bits=bits)
    given = Captures(Path("c.json"), Path("s.usda"), (capture,))
    (back,) = unmixed(given, {CAMERA.name: camera}, [FOUND]).captures
    assert back.mask is not None
    assert 0.3 < back.mask.mean() < 1
    assert not back.mask[mixed.max(axis=2) >= 0.95 * (2**bits - 1)].any()
    assert back.has_codes is (bits == 8)
    off = (back.pixels - plain)[back.mask]
    assert abs(off.mean()) < 0.5
    assert np.abs(off).max() < (
        2 if bits == 8 else 10
    )  # roundings; noise of 100 frames is 1 DN and its sums are 2


def test_a_simulation_without_it_is_told_beside_captures_without_it() -> None:
    c = _condition(_patches(0), np.eye(3))
    dn = c.simulated().dn
    assert (as_mixed(c, dn, [FOUND]) - BLACK) @ ROWS.T + BLACK == pytest.approx(dn, abs=0.01)
    assert as_mixed(c, dn, [replace(FOUND, camera="/another")]) is dn

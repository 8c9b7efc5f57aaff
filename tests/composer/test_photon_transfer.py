"""Rendered frames have the statistics that a bench would find: a photon-transfer line, and a flat field's shape."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.exposure import expose
from interchange.formats import gprims
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from realtime.renderers.rasterizer import Rasterizer

SENSOR = Sensor(
    (160, 120), (3e-5, 3e-5), responsivity=4e5, full_well=12000, bit_depth=12, black_level=64, read_noise=7,
    prnu=0.005, dsnu=2, dsnu_row=1, serial_number="7", mosaic="mono",
)  # fmt: skip
CAMERA = Camera("Top", look_at(np.array([0, 0, 0.4]), np.zeros(3)), Lens(16e-3), SENSOR, t_exp=0.1)
LAMP = np.eye(4)
LAMP[:3, 3] = 0.15, 0.1, 0.3


@pytest.fixture(scope="module")
def rendered():
    plate = Body("plate", gprims.plane(0.4, 0.4), Material("matte", Lambert((0.5, 0.5, 0.5))))
    scene = Scene((plate,), (Light("Lamp", LightKind.SPHERE, (1, 1, 1), LAMP),), (CAMERA,))
    return Rasterizer().render(scene, CAMERA, samples=4)


def test_the_transfer_curve_of_rendered_frames_has_slope_k(rendered):
    """Temporal variance of pixels over their mean at several exposures: K within three of its standard errors.

    A pixel's half squared difference of two frames has the variance 2 σ⁴; K is the weighted slope through the dark.
    """
    peak = rendered.pixels.max() * SENSOR.responsivity
    rng = np.random.default_rng(3)

    def pair(t):
        return (
            expose(rendered, t_exp=t, rng=rng).pixels[..., 0].astype(np.float64).ravel() for _ in range(2)
        )

    a, b = pair(0.0)
    offset, dark = (a + b) / 2, ((a - b) ** 2 / 2).mean()
    x, y, w = [], [], []
    for share in (0.1, 0.3, 0.5, 0.7, 0.85):
        a, b = pair(share * SENSOR.full_well / peak)
        level = rendered.pixels.mean(axis=2).ravel() * SENSOR.responsivity * share * SENSOR.full_well / peak
        x.append(level * SENSOR.K)  # the mean that is declared: noise in it would pull the slope down
        assert (a + b).mean() / 2 - offset.mean() == pytest.approx(x[-1].mean(), rel=2e-3)
        y.append((a - b) ** 2 / 2 - dark)
        w.append(1 / (2 * (x[-1] * SENSOR.K + dark) ** 2))
    x, y, w = (np.concatenate(v) for v in (x, y, w))
    K = (w * x * y).sum() / (w * x * x).sum()
    dark_error = dark * np.sqrt(2 / len(a)) * (w * x).sum() / (w * x * x).sum()
    error = np.hypot(1 / np.sqrt((w * x * x).sum()), dark_error)
    assert error < 0.01 * SENSOR.K
    assert abs(K - SENSOR.K) < 3 * error
    assert np.sqrt(dark - 1 / 12) / SENSOR.K == pytest.approx(7, rel=0.03)


def test_a_rendered_flat_field_has_the_lens_and_sensors_shape():
    """A glowing plate that fills the view: falls off as declared, with glare of its mean, by PRNU about it."""
    glow = Material("glow", Lambert((0, 0, 0)), emission=(0.2, 0.2, 0.2))
    scene = Scene((Body("plate", gprims.plane(2, 2), glow),), (), (CAMERA,))
    lens = replace(CAMERA.lens, vignetting=(-0.35, 0.05), veiling_glare=(0.03,))
    camera = replace(CAMERA, lens=lens, sensor=replace(SENSOR, prnu=0.01, dsnu=0, dsnu_row=0))
    image = Rasterizer().render(scene, camera, samples=4)
    rng = np.random.default_rng(5)
    mean = np.mean([expose(image, camera, rng=rng).pixels[..., 0] for _ in range(64)], axis=0)
    x, y = np.meshgrid(np.arange(160) - 79.5, np.arange(120) - 59.5)
    r2 = (x**2 + y**2) / ((160**2 + 120**2) / 4)
    fall = 1 - 0.35 * r2 + 0.05 * r2**2
    want = 64 + SENSOR.K * 4e5 * 0.2 * 0.1 * (0.97 * fall + 0.03 * fall.mean())
    ratio = (mean - 64) / (want - 64)
    assert ratio.mean() == pytest.approx(1, abs=5e-4)  # 1 % of PRNU over 19 200 pixels: 7e-5; noise less
    assert ratio.std() == pytest.approx(0.01, rel=0.05)
    coarse = ratio.reshape(6, 20, 8, 20).mean(axis=(1, 3))  # 400 pixels: 5e-4 of PRNU
    assert np.abs(coarse - 1).max() < 4 * 5.2e-4

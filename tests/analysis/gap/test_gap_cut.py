"""What is cut off at DN 0, against the sensor's own model: 120000 values of each light."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from analysis.gap.compared.conditions import Condition
from analysis.gap.sensor import cut
from analysis.gap.sensor.expected import expected, noise_variance
from interchange.camera import Camera, Sensor
from interchange.captures import Capture
from interchange.effects.response_curve import ResponseCurve
from interchange.exposure import expose
from interchange.image import Image, Quantity
from interchange.scene import Scene
from interchange.sensor import Response

SHAPE = (200, 200, 3)


def _camera(black: float, response: Response, bits: int, gamma: float = 1.0) -> Camera:
    return Camera(
        "/Top",
        sensor=Sensor(SHAPE[1::-1], (5e-6, 5e-6), responsivity=8000.0, full_well=10500, black_level=black, read_noise=7,
                      prnu=0.004, dsnu=2.0, bit_depth=12, output_bit_depth=bits, response=response,
                      gamma=gamma),
    )  # fmt: skip


@pytest.mark.parametrize("light", [0.0, 5e-4, 2e-3, 1e-2, 0.3])
@pytest.mark.parametrize(
    ("black", "response", "bits", "gamma"),
    [
        (0, Response.LINEAR, 0, 1.0),
        (5, Response.LINEAR, 0, 1.0),
        (64, Response.LINEAR, 0, 1.0),
        (0, Response.SRGB, 0, 1.0),
        (64, Response.SRGB, 0, 1.0),
        (0, Response.SRGB, 8, 1.0),
        (0, Response.REC709, 8, 1.0),
        (0, Response.LINEAR, 8, 0.45),
        (64, Response.LINEAR, 8, 0.45),
        (0, Response.LINEAR, 0, 0.7),
    ],
)
def test_mean_and_variance_are_those_of_the_sensors_model(
    black: float, response: Response, bits: int, gamma: float, light: float
) -> None:
    """Means to 4 standard errors; variances to 4 %. Curves are of whole DN: where one is steep in the dark, DN 0 and 1
    of 12 bits lie 6 of 8 bits apart by γ 0.45. Of 8 bits, which whole DN are rounded to once more, means are told to a
    tenth of a step more and variances to 15 %, as what rounding adds is not 1/12 where noise is of few DN."""
    camera = _camera(black, response, bits, gamma)
    image = Image(np.full(SHAPE, light, np.float32), Quantity.RADIANCE, camera)
    e = expected(image.pixels, camera)
    rng = np.random.default_rng(0)
    y = expose(image, camera, rng=rng).pixels.astype(float)
    twice = 0.1 if bits == 8 else 0.0
    assert e.dn.mean() == pytest.approx(y.mean(), abs=4 * y.std() / np.sqrt(y.size) + twice)
    assert e.variance.mean() == pytest.approx(y.var(), rel=0.15 if bits == 8 else 0.04)


@pytest.mark.parametrize("light", [0.012, 0.02, 0.3])
def test_a_level_below_nothing_cuts_off_what_little_light_brings(light: float) -> None:
    """Black at DN -40, which 0.0128 of light lifts to 0; a rounded tail is no mean of its own: 0.05 DN."""
    camera = _camera(-40, Response.LINEAR, 0)
    image = Image(np.full(SHAPE, light, np.float32), Quantity.RADIANCE, camera)
    e, y = (
        expected(image.pixels, camera),
        expose(image, camera, rng=np.random.default_rng(0)).pixels.astype(float),
    )
    assert e.dn.mean() == pytest.approx(y.mean(), abs=4 * y.std() / np.sqrt(y.size) + 0.05)
    assert e.variance.mean() == pytest.approx(y.var(), rel=0.04)


@pytest.mark.parametrize("u", [-3.0, -0.5, 0.0, 1.0, 5.0])
def test_moments_are_those_of_a_censored_normal(u: float) -> None:
    def moment(n: int) -> float:
        return float(quad(lambda x: x**n * norm.pdf(x, u), 0, u + 12)[0])

    assert float(cut.cut(np.array(2 * u), np.array(2.0))) == pytest.approx(2 * moment(1))
    assert float(cut.kept(np.array(u))) == pytest.approx(moment(2) - moment(1) ** 2, rel=1e-6)


def test_a_sensor_without_noise_cuts_nothing() -> None:
    """A dark of DN 0 that is 0 in every frame."""
    sensor = Sensor((4, 4), full_well=1e4, bit_depth=8)
    assert cut.mean(np.array([0.0, 0.2, 1.0]), sensor, None) == pytest.approx([0, 0.2, 1], abs=1e-3)


def test_levels_are_told_from_means() -> None:
    sensor = _camera(3, Response.LINEAR, 0).sensor
    linear = np.array([3.0, 4.0, 10.0, 100.0, 3000.0])
    assert cut.level(cut.mean(linear, sensor, None), sensor) == pytest.approx(linear, abs=0.01)


def test_a_camera_with_a_black_level_is_told_as_ever() -> None:
    sensor = _camera(64, Response.LINEAR, 0).sensor
    assert not cut.is_cut(sensor)
    linear = np.linspace(0, 4095, 50)
    assert cut.mean(linear, sensor, None) is linear
    temporal, _ = noise_variance(linear, _camera(64, Response.LINEAR, 0))
    light = np.maximum(linear - 64, 0)
    assert temporal == pytest.approx(sensor.K * light + (sensor.K * 7) ** 2 + 1 / 12, rel=1e-6)


def test_what_is_cut_off_below_a_black_level_is_not_compared() -> None:
    """A patch of 20 x 12 px at DN 0 under a black level of 64, and single zeros; under one of 1 DN all of it is."""
    rng = np.random.default_rng(0)
    dn = rng.normal(300, 5, (60, 80, 3))
    dn[20:32, 30:50] = 0
    dn[5, 5] = dn[50, 70, 1] = 0
    patch = np.zeros((60, 80), bool)
    patch[20:32, 30:50] = True
    for black, there in ((64, patch), (1, np.zeros_like(patch))):
        camera = replace(_camera(black, Response.LINEAR, 0), t_exp=1.0)
        condition = Condition(
            (Capture("a.png", "/Top", 0, 1.0, dn, bits=16),),
            Scene(),
            camera,
            dn,
            None,
            np.ones((60, 80), bool),
        )
        assert (condition.cut_off == there).all()
        e = expected(np.full(dn.shape, 0.1, np.float32), camera)
        assert (condition.usable(e) == ~there).all()


@pytest.mark.parametrize(("black", "noise"), [(0, 7.0), (5, 7.0), (64, 0.2), (-40, 7.0)])
def test_what_is_looked_up_evenly_is_the_table(black: float, noise: float) -> None:
    """sRGB's curve is steepest where noise rounds it off; a hundredth of a step is what no capture shows."""
    sensor = replace(_camera(black, Response.SRGB, 0).sensor, read_noise=noise)
    curve = ResponseCurve(response=Response.SRGB)
    x, y, slope = cut.table(sensor, curve)
    among = np.random.default_rng(4).uniform(x[0], x[-1], 100000)
    assert cut.even(sensor, curve)(among) == pytest.approx(np.interp(among, x, y), abs=0.01)
    assert cut.slopes(sensor, curve)(among) == pytest.approx(np.interp(among, x, slope), abs=0.01)


def test_beyond_its_ends_a_table_is_what_they_are() -> None:
    even = cut.Even.of(np.array([1.0, 2.0, 4.0]), np.array([3.0, 5.0, 6.0]))
    assert even(np.array([0.0, 1.0, 1.5, 3.0, 4.0, 9.0])) == pytest.approx([3, 3, 4, 5.5, 6, 6])

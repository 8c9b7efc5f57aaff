"""Reflectance samples: bands against integrals, masks that keep and count, reciprocity as data."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from interchange.formats import measurements
from interchange.problems import BrightfieldError
from interchange.reflectance import ReflectanceSamples

ASSETS = Path(__file__).parents[2] / "assets" / "measurements"


def directions(theta: object, phi: object) -> np.ndarray:
    t, p = np.broadcast_arrays(np.radians(theta), np.radians(phi))
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)


@pytest.fixture
def samples() -> ReflectanceSamples:
    wi = directions([10.0, 40.0, 85.0, 30.0, 60.0], 0.0)
    wo = directions([20.0, 43.0, 20.0, 30.0, 60.0], [180.0, 0.0, 180.0, 90.0, 180.0])
    f = np.array([[0.1, 0.2], [0.3, 0.1], [5.0, 5.0], [-0.01, 0.02], [np.nan, 0.1]])
    return ReflectanceSamples(wi, wo, f, sigma=0.01 * np.ones((5, 2)), wavelength_nm=np.array([450.0, 550.0]))


def test_nothing_is_dropped_in_silence(samples: ReflectanceSamples) -> None:
    assert len(samples) == 5
    assert samples.usable.tolist() == [True, True, True, True, False]  # a NaN cannot be used
    assert samples.negatives.tolist() == [1, 0]
    trusted = samples.trusted()
    assert trusted.use.tolist() == [True, False, False, True, True]  # 3° from retro; 85° off the normal
    assert [str(n) for n in trusted.notes] == [
        "1 samples beyond 80° from the normal are left out.",
        "1 samples within 5° of retro-reflection are left out.",
    ]
    assert len(trusted) == 5
    assert trusted.masked().f.min() == -0.01
    below = replace(samples, wo=samples.wo * [1, 1, -1])
    assert not below.usable.any()


def test_bands_are_means_of_the_spectrum() -> None:
    """A straight spectrum a + b λ has the mean a + b (low + high) / 2 whatever the grid, edges between its points."""
    nm = np.array([400.0, 430, 440, 505, 590, 655, 700])
    up = directions([0.0, 10.0], 0.0)
    s = ReflectanceSamples(up, up, (0.2 + 0.001 * nm) * np.array([[1.0], [2.0]]), wavelength_nm=nm)
    assert s.bands().f[0] == pytest.approx(0.2 + 0.001 * np.array([650.0, 550, 450]), rel=1e-12)
    assert s.bands().f[1] == pytest.approx(2 * s.bands().f[0])
    assert s.bands().channels == ("R", "G", "B")
    one = s.bands(edges=((495.0, 515.0),), names=("green",))
    assert one.f[0, 0] == pytest.approx(0.705)
    broken = replace(s, f=np.where(nm == 700, np.nan, s.f))
    assert np.isfinite(broken.bands().f).tolist() == [[False, True, True]] * 2
    with pytest.raises(BrightfieldError, match="900 to 950 nm must overlap the measured 400 to 700 nm"):
        s.bands(edges=((900.0, 950.0),), names=("x",))


def test_bands_propagate_noise(samples: ReflectanceSamples) -> None:
    """The mean of two wavelengths with equal weight has 1/sqrt(2) of their noise."""
    one = samples.bands(edges=((450.0, 550.0),), names=("Y",))
    assert one.sigma is not None
    assert one.sigma[0, 0] == pytest.approx(0.01 / np.sqrt(2))


def test_bands_of_plain_channels() -> None:
    up = directions([0.0, 10.0], 0.0)
    grey = ReflectanceSamples(up, up, np.array([0.1, 0.2]))
    assert grey.bands().f.tolist() == [[0.1] * 3, [0.2] * 3]
    rgb = ReflectanceSamples(up, up, np.array([[1.0, 2, 3], [4, 5, 6]]))
    assert np.array_equal(rgb.bands().f, rgb.f)
    with pytest.raises(BrightfieldError, match="must be 1 or 3"):
        ReflectanceSamples(up, up, np.ones((2, 5))).bands()


def test_mirrored_exchanges_light_and_camera(samples: ReflectanceSamples) -> None:
    both = samples.mirrored()
    assert len(both) == 10
    assert np.array_equal(both.wi[5:], samples.wo)
    assert np.array_equal(both.f[5:], samples.f, equal_nan=True)


def test_subsample_takes_each_once_and_the_usable_only(samples: ReflectanceSamples) -> None:
    taken = samples.subsample(np.random.default_rng(1), 3)
    assert len(taken) == 3
    assert len(np.unique(taken.wo, axis=0)) == 3
    assert np.isfinite(taken.f).all()
    assert len(samples.subsample(np.random.default_rng(1), 99)) == 4


def test_a_goniometer_file() -> None:
    s = ReflectanceSamples.from_measurement(measurements.read(ASSETS / "garnet_red_60.brdf"))
    assert s.f.shape == (60, 31)
    assert s.channels[0] == "400 nm"
    red, green, _ = s.bands().f.mean(axis=0)
    assert red > 2 * green
    assert s.theta[0].max() == pytest.approx(np.radians(80), abs=1e-5)
    with pytest.raises(BrightfieldError, match="A BRDF was expected; this is a spectrum"):
        ReflectanceSamples.from_measurement(measurements.read(ASSETS / "cie.stdillum.A.spd"))


def test_shapes_must_agree() -> None:
    up = directions([0.0, 10.0], 0.0)
    with pytest.raises(BrightfieldError, match=r"wo \(1, 3\) instead of \(2, 3\)"):
        ReflectanceSamples(up, up[:1], np.ones((2, 3)))

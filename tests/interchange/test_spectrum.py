"""Spectra against published chromaticities and the laws of Planck, Wien and Stefan and Boltzmann."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interchange.camera import Camera, Lens, Sensor
from interchange.colorimetry import (
    chromaticity,
    linear_srgb,
    luminous_efficacy,
    srgb_color,
    watts_of,
    xyz,
)
from interchange.exposure import LIGHT, PLANCK, expose
from interchange.formats import measurements
from interchange.illuminants import STEFAN_BOLTZMANN, black_body, daylight, illuminant, led, planck
from interchange.image import Image, Quantity
from interchange.problems import BrightfieldError
from interchange.spectral_channels import channels, sensor_with
from interchange.spectrum import Spectrum, from_measurement

SPD = Path(__file__).parents[2] / "assets" / "measurements" / "cie.stdillum.A.spd"

# CIE 15:2004, table T.3 and T.9 (x, y; 2 degree observer); LED-B: CIE 15:2018. Rounded to four digits there, and
# summed over 5 nm; ours are integrated by 1 nm, which moves spectra with lines by 2e-4.
PUBLISHED = {
    "A": (0.44758, 0.40745, 2e-5),
    "D50": (0.34567, 0.35851, 3e-5),
    "D65": (0.31272, 0.32903, 3e-5),
    "FL1": (0.3131, 0.3371, 3e-4),
    "FL2": (0.3721, 0.3751, 3e-4),
    "FL7": (0.3129, 0.3292, 3e-4),
    "FL11": (0.3805, 0.3769, 3e-4),
    "LED-B1": (0.4560, 0.4078, 2e-4),
    "LED-B5": (0.3118, 0.3236, 3e-4),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_chromaticity_is_the_published_one(name: str) -> None:
    x, y, tolerance = PUBLISHED[name]
    assert chromaticity(illuminant(name)) == pytest.approx([x, y], abs=tolerance)


def test_illuminants_have_their_published_values() -> None:
    """CIE 15:2004, table T.1: 300, 400, 560, 700 and 780 nm."""
    at = np.array([300.0, 400, 560, 700, 780])
    assert illuminant("A")(at) == pytest.approx([0.930483, 14.7080, 100, 198.261, 241.675], rel=5e-6)
    assert illuminant("D65")(at) == pytest.approx([0.0341, 82.7549, 100, 71.6091, 63.3828], rel=1e-5)
    assert illuminant("F2").values.max() == illuminant("FL2").values.max()


def test_a_spectrum_from_a_file_is_the_formula() -> None:
    found = from_measurement(measurements.read(SPD))
    assert found.values == pytest.approx(illuminant("A")(found.wavelength_nm), rel=6e-6)  # six digits there


def test_one_watt_at_555_nm_is_683_lumens() -> None:
    assert luminous_efficacy(led(555, 0.2)) == pytest.approx(683, rel=2e-5)
    assert watts_of(683, led(555, 0.2)) == pytest.approx(1, rel=2e-5)  # chords of V over 1 nm
    assert luminous_efficacy(led(510, 0.2)) == pytest.approx(683 * 0.503, rel=1e-3)  # V(510 nm) of CIE 1924
    with pytest.raises(BrightfieldError, match="Lumens need a visible spectrum"):
        watts_of(100, illuminant("850 nm"))


def test_equal_energy_is_white_at_a_third() -> None:
    # the table's own sums: 106.8654, 106.8569, 106.8922
    assert chromaticity(illuminant("E")) == pytest.approx([1 / 3, 1 / 3], abs=5e-5)


@settings(deadline=None)
@given(temperature=st.floats(300, 20000))
def test_stefan_boltzmann_and_wien(temperature: float) -> None:
    wavelength = np.geomspace(1e5 / temperature, 1e10 / temperature, 20001)
    spectrum = black_body(temperature, wavelength)
    # beyond 3.5e9 / T nm and below 1e5 / T nm there is less than 1e-8 of the power
    assert spectrum.integral() == pytest.approx(STEFAN_BOLTZMANN * temperature**4, rel=2e-6)
    peak = spectrum.wavelength_nm[int(np.argmax(spectrum.values))]
    assert peak * temperature == pytest.approx(2.897771955e6, rel=6e-4)  # nm K; the grid's step


def test_constants_and_planck_at_a_point() -> None:
    assert pytest.approx(5.670374419e-8, rel=1e-9) == STEFAN_BOLTZMANN  # CODATA 2018
    # M = c1 / λ⁵ / (exp(c2 / λT) - 1) with CODATA's c1, c2
    c1, c2 = 3.741771852e-16, 1.438776877e-2
    expected = c1 / 555e-9**5 / (np.exp(c2 / (555e-9 * 5778)) - 1) * 1e-9
    assert planck(np.array(555.0), 5778) == pytest.approx(expected, rel=3e-9)  # ten digits of c1 and c2


def test_melting_platinum_has_60_candela_a_square_centimetre() -> None:
    """The candela's definition of 1948: a black body at 2042 K (IPTS-48: 2042.15 K) has 60 cd/cm²."""
    luminance = 683 * xyz(black_body(2041.4))[1] / np.pi
    assert luminance == pytest.approx(
        60e4, rel=0.01
    )  # temperature scales moved by 0.5 K, 1 % of luminance each K


def test_daylight_has_its_correlated_colour_temperature() -> None:
    """McCamy 1992: CCT from x and y, to some 2 K by day."""
    for temperature in (5000, 6500, 7500):
        x, y = chromaticity(daylight(temperature))
        n = (x - 0.3320) / (0.1858 - y)
        assert 449 * n**3 + 3525 * n**2 + 6823.3 * n + 5520.33 == pytest.approx(temperature, rel=2e-3)
    with pytest.raises(BrightfieldError, match="4000 to 25000 K"):
        daylight(3000)


def test_d65_is_white_in_srgb_and_red_is_red() -> None:
    white = linear_srgb(illuminant("D65"))
    assert white / white.mean() == pytest.approx(
        [1, 1, 1], abs=4e-4
    )  # the matrix of IEC 61966-2-1 has four digits
    r, g, b = srgb_color(illuminant("630 nm / 15 nm"))
    assert r == pytest.approx(3, abs=0.01)
    assert g == b == 0
    assert sum(srgb_color(illuminant("A"))) == pytest.approx(3)


@settings(deadline=None)
@given(peak=st.floats(380, 1000), width=st.floats(1, 60))
def test_an_led_has_its_width_and_unit_power(peak: float, width: float) -> None:
    line = led(peak, width)
    assert line.integral() == pytest.approx(1)
    assert line(peak + width / 2) / line(peak) == pytest.approx(0.5, abs=1e-3)  # chords of the curve
    assert line.mean_wavelength() == pytest.approx(peak)


QE = [led(peak, 80) * 50 for peak in (600, 540, 460)]


@pytest.mark.parametrize("name", ["A", "D65", "625 nm", "LED-B3"])
def test_channels_give_the_electrons_of_the_spectrum(name: str) -> None:
    """A pixel under a spectral radiance: photons counted wavelength by wavelength, against ``expose``."""
    sensor = sensor_with(Sensor((4, 3), responsivity=0.0, full_well=1e9), QE)
    lens = Lens(f_stop=4.0, transmission=0.9)
    radiance = illuminant(name).normalized(20.0)  # W/(m² sr)
    L = channels(radiance, QE, sensor)
    camera = Camera(lens=lens, sensor=sensor, t_exp=0.01)
    image = Image(np.broadcast_to(np.float32(L), (3, 4, 3)))
    got = expose(image, camera, until=Quantity.ELECTRONS).pixels[1, 1]
    step = 0.25
    grid = np.arange(200, 1100, step)
    for c in range(3):
        photons = radiance(grid) * grid * 1e-9 / (PLANCK * LIGHT) * np.pi / 64 * 0.9 * 3.45e-6**2 * 0.01
        # two integrations of piecewise linear curves by different steps
        assert got[c] == pytest.approx(np.sum(photons * QE[c](grid)) * step, rel=3e-3, abs=1)


def test_light_at_the_channels_wavelength_keeps_its_watts() -> None:
    sensor = sensor_with(Sensor(), QE[:1])
    line = led(sensor.wavelength_nm[0], 0.5) * 7.0
    assert channels(line, QE[:1], sensor) == pytest.approx((7, 7, 7), rel=1e-3)


def test_products_overlap_and_mistakes_are_told() -> None:
    a = Spectrum(np.array([400, 500]), np.array([0.0, 1]), "W/nm")
    b = Spectrum(np.array([450, 600]), np.array([2.0, 2]))
    assert (a * b).integral() == pytest.approx(2 * (0.5 + 1) / 2 * 50)
    assert (a * b).unit == "W/nm"
    with pytest.raises(BrightfieldError, match="must overlap"):
        a * Spectrum(np.array([700, 800]), np.ones(2))
    with pytest.raises(BrightfieldError, match="increase"):
        Spectrum(np.array([500, 400]), np.ones(2))
    with pytest.raises(BrightfieldError, match=r'No illuminant is called "D66".*"D65"'):
        illuminant("D66")

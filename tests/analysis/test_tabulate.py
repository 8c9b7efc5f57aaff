"""Measurements as tables that renderers draw: a formula comes back, a real paint is met."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.tabulate import to_model
from interchange.brdf.lafortune import Lafortune
from interchange.brdf.tabulated_goniometer import TabulatedGoniometer
from interchange.brdf.tabulated_isotropic import TabulatedIsotropic
from interchange.formats import measurements
from interchange.measurement import Measurement, unit_vectors
from interchange.problems import BrightfieldError
from interchange.reflectance import ReflectanceSamples

ASSETS = Path(__file__).parents[2] / "assets" / "measurements"
PAINT = Lafortune((0.3, 0.2, 0.1), weight=[(2.0, 2.0, 2.0)], C=[(-1, -1, 1)], n=[20])


def goniometer(brdf, phi_i=(0.0,), theta=(5, 20, 35, 50, 65)) -> ReflectanceSamples:
    """A scan: camera on rings of 15° azimuth, denser about the mirror direction."""
    wi, wo = [], []
    for t in np.radians(theta):
        for p in np.radians(phi_i):
            i = unit_vectors(np.array(t), np.array(p))
            rings = unit_vectors(
                *(
                    a.ravel()
                    for a in np.meshgrid(np.radians(np.arange(2, 75, 9)), np.radians(np.arange(0, 360, 15)))
                )
            )
            d, a = (
                x.ravel()
                for x in np.meshgrid(np.radians(np.arange(0, 22, 4)), np.radians(np.arange(0, 360, 30)))
            )
            near = unit_vectors(d, a) + (i * [-1, -1, 1] - [0, 0, 1]) * 1.0
            near = near / np.linalg.norm(near, axis=1, keepdims=True)
            o = np.concatenate([rings, near[near[:, 2] > 0.2]])
            wo.append(o)
            wi.append(np.broadcast_to(i, o.shape))
    wi, wo = np.concatenate(wi), np.concatenate(wo)
    return ReflectanceSamples(wi, wo, brdf.evaluate(wi, wo))


def test_an_isotropic_paint_comes_back_from_a_scan() -> None:
    """Between the scanned angles, too: at 27° and 57° of incidence the error stays within 4 % of the highlight."""
    made = to_model(goniometer(PAINT))
    assert isinstance(made.brdf, TabulatedIsotropic)
    assert made.residual.max() < 0.02
    others = goniometer(PAINT, theta=(27, 57))
    error = made.brdf.evaluate(others.wi, others.wo) - others.f
    assert np.sqrt(np.mean(error**2)) < 0.04 * others.f.max()
    swapped = made.brdf.evaluate(others.wo, others.wi)
    assert swapped == pytest.approx(made.brdf.evaluate(others.wi, others.wo), rel=1e-6)


def test_several_azimuths_of_the_light_make_an_anisotropic_table() -> None:
    brushed = Lafortune(0.2, weight=[(0.5, 0.5, 0.5)], C=[(-1, -0.5, 0.9)], n=[3])
    samples = goniometer(brushed, phi_i=(0, 45, 90, 135, 180, 225, 270, 315), theta=(10, 30, 50))
    made = to_model(samples, shape=(4, 8, 5, 24))
    assert isinstance(made.brdf, TabulatedGoniometer)
    assert made.residual.max() < 0.03
    assert isinstance(
        to_model(samples.take(np.arange(0, len(samples), 9)), shape=(3, 4, 3, 6)).brdf, TabulatedGoniometer
    )


def test_reciprocity_fills_what_the_instrument_did_not_reach() -> None:
    """The camera never went beyond 40°, the light did: exchanged samples tell the rest."""
    scan = goniometer(PAINT, phi_i=(0, 90, 180, 270), theta=(5, 25, 45, 65))
    low = scan.take(scan.theta[1] < np.radians(40))
    beyond = scan.take((scan.theta[1] > np.radians(50)) & (scan.theta[0] < np.radians(40)))
    shape = (5, 4, 5, 8)
    errors = []
    for reciprocal in (False, True):
        model = replace(to_model(low, shape, reciprocal=reciprocal).brdf)
        errors.append(np.sqrt(np.mean((model.evaluate(beyond.wi, beyond.wo) - beyond.f) ** 2)))
    assert errors[1] < 0.75 * errors[0]


def test_readings_of_a_measured_paint() -> None:
    """60 of the 1439 readings: the table meets what it was made of, and says what it made up."""
    made = to_model(measurements.read(ASSETS / "garnet_red_60.brdf"))
    assert made.residual.max() < 0.04  # 128 rows for 60 readings, held smooth
    assert made.filled > 0.3
    said = "\n".join(map(str, made.notes))
    assert "Nothing was measured beyond 80° of the light" in said
    assert "leaves" in said


def test_negative_samples_are_counted_and_the_table_is_not_negative() -> None:
    scan = goniometer(PAINT)
    f = scan.f - 0.05
    made = to_model(replace(scan, f=f))
    assert made.brdf.values.values.min() >= 0
    said = "\n".join(map(str, made.notes))
    assert f"{(f[:, 2] < 0).sum()} values of B are negative" in said
    assert "rows of the table came out negative; they are 0" in said


def test_what_a_file_tabulates_itself_is_taken_as_it_is() -> None:
    model = TabulatedIsotropic()
    made = to_model(Measurement(measurements.Kind.BRDF, (), (), model=model))
    assert made.brdf is model


def test_what_cannot_become_a_table() -> None:
    with pytest.raises(BrightfieldError, match="A BRDF was expected; this is a spectrum"):
        to_model(measurements.read(ASSETS / "cie.stdillum.A.spd"))
    none = replace(goniometer(PAINT), use=np.zeros(len(goniometer(PAINT)), bool))
    with pytest.raises(BrightfieldError, match="At least one sample must be usable"):
        to_model(none)
    with pytest.raises(BrightfieldError, match=r"3 numbers .* or 4"):
        to_model(goniometer(PAINT), shape=(3, 3))

"""Tabulated BRDFs: their coordinates against the definition by rotations, their nodes, and smooth functions."""

import numpy as np
import pytest

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.tabulated_goniometer import TabulatedGoniometer
from interchange.brdf.tabulated_isotropic import TabulatedIsotropic, half_difference
from interchange.parameter import ParameterError


def hemisphere(rng, n):
    w = rng.normal(size=(n, 3))
    w[:, 2] = np.abs(w[:, 2]) + 0.05
    return w / np.linalg.norm(w, axis=1, keepdims=True)


def turned(v, axis, angle):
    """Rodrigues' rotation, row by row."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return v * c + np.cross(axis, v) * s + axis * (v @ axis)[:, None] * (1 - c)


def by_rotations(wi, wo):
    """Rusinkiewicz 1998: turn wi about the normal by -phi_h, then about the bitangent by -theta_h."""
    h = wi + wo
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    theta_h, phi_h = np.arccos(h[:, 2]), np.arctan2(h[:, 1], h[:, 0])
    d = turned(turned(wi, np.array([0, 0, 1.0]), -phi_h), np.array([0, 1.0, 0]), -theta_h)
    return theta_h, np.arccos(d[:, 2]), np.arctan2(d[:, 1], d[:, 0])


def from_half_difference(theta_h, theta_d, phi_d):
    d = np.stack([np.sin(theta_d) * np.cos(phi_d), np.sin(theta_d) * np.sin(phi_d), np.cos(theta_d)], -1)
    wi = turned(d, np.array([0, 1.0, 0]), theta_h)
    h = np.stack([np.sin(theta_h), 0 * theta_h, np.cos(theta_h)], -1)
    return wi, 2 * np.sum(wi * h, -1, keepdims=True) * h - wi


def test_half_and_difference_angles_are_those_of_rusinkiewicz():
    rng = np.random.default_rng(0)
    wi, wo = hemisphere(rng, 2000), hemisphere(rng, 2000)
    got = half_difference(tuple(wi.T), tuple(wo.T))
    for angle, expected in zip(got, by_rotations(wi, wo), strict=True):
        assert angle == pytest.approx(expected, abs=1e-6)


def test_every_bin_is_read_at_its_middle():
    """... which MERL's lookup, floor(sqrt(theta_h / 90°) N) and so on, gives too."""
    rng = np.random.default_rng(1)
    n = (6, 5, 8)
    model = TabulatedIsotropic(1, *n, rng.uniform(0, 1, (240, 3)))
    i, j, k = (a.ravel() for a in np.indices(n))
    angles = ((i + 0.5) / 6) ** 2 * np.pi / 2, (j + 0.5) / 5 * np.pi / 2, (k + 0.5) / 8 * np.pi
    wi, wo = from_half_difference(*angles)
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    assert above.sum() > 100
    assert model.evaluate(wi[above], wo[above]) == pytest.approx(model.values.values[above], rel=1e-6)


def test_the_azimuth_of_the_difference_goes_round_without_a_step():
    model = TabulatedIsotropic.drawn(np.random.default_rng(2))
    at = np.array([1e-6, -1e-6]), np.full(2, 0.7)
    wi, wo = from_half_difference(np.full(2, 0.3), at[1], at[0])
    f = model.evaluate(wi, wo)
    assert f[0] == pytest.approx(f[1], abs=1e-4)


def test_a_fine_table_is_the_function_that_it_was_made_of():
    """A lobe with n = 10, sampled at the middles of 40 x 20 x 20 bins: the error of straight pieces is below 2 % of
    the lobe's height (second difference / 8 along each axis), and four times smaller with twice the bins."""
    lobe = Lafortune(0.3, weight=[(1.0, 0.5, 0.2)], C=[(-1, -1, 1)], n=[10])
    rng = np.random.default_rng(3)
    wi, wo = hemisphere(rng, 3000), hemisphere(rng, 3000)
    middle = (np.arccos(wi[:, 2]) < 1.2) & (np.arccos(wo[:, 2]) < 1.2)  # inside the outermost middles
    worst = []
    for n in ((20, 20, 20), (40, 40, 40)):
        model = sampled(lobe, n)
        worst.append(np.abs(model.evaluate(wi, wo) - lobe.evaluate(wi, wo))[middle].max())
    assert worst[0] < 0.04
    assert worst[1] < 0.35 * worst[0]


def sampled(brdf, n):
    i, j, k = (a.ravel() for a in np.indices(n))
    angles = ((i + 0.5) / n[0]) ** 2 * np.pi / 2, (j + 0.5) / n[1] * np.pi / 2, (k + 0.5) / n[2] * np.pi
    wi, wo = from_half_difference(*angles)
    f = np.stack(
        [np.broadcast_to(brdf.bind(brdf.flat(), c).f(tuple(wi.T), tuple(wo.T)), len(wi)) for c in range(3)],
        -1,
    )
    return TabulatedIsotropic(1, *n, f)


def unit(theta, phi):
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], -1)


@pytest.mark.parametrize("n", [(4, 6, 3, 8), (4, 1, 3, 8)])
def test_a_goniometer_table_is_read_at_its_nodes(n):
    rng = np.random.default_rng(4)
    values = rng.uniform(0, 1, (int(np.prod(n)), 3))
    model = TabulatedGoniometer(2.0, 1.2, 1.4, *n, values=values)
    i, j, k, m = (a.ravel() for a in np.indices(n))
    phi_i = (
        j * 2 * np.pi / n[1] if n[1] > 1 else rng.uniform(-3, 3, len(j))
    )  # isotropic: any azimuth of the light
    phi_o = m * 2 * np.pi / n[3] + (phi_i if n[1] == 1 else 0)
    wi, wo = unit(i * 1.2 / (n[0] - 1), phi_i), unit(k * 1.4 / (n[2] - 1), phi_o)
    away = (i > 0) & (k > 0) if n[1] == 1 else i >= 0  # at the pole no azimuth is left of the vector ...
    away &= (i > 0) & (k > 0)  # ... in either case
    assert model.evaluate(wi, wo)[away] == pytest.approx(2 * values[away], rel=1e-5)


def test_a_mirrored_table_is_the_full_one():
    rng = np.random.default_rng(5)
    half = rng.uniform(0, 1, (3, 3, 5, 3))
    full = np.concatenate([half, half[:, :, 3:0:-1]], axis=2)  # 0..180°, then back: 8 azimuths
    a = TabulatedGoniometer(1, 1.3, 1.3, 3, 1, 3, 5, mirrored=1, values=half.reshape(-1, 3))
    b = TabulatedGoniometer(1, 1.3, 1.3, 3, 1, 3, 8, values=full.reshape(-1, 3))
    wi, wo = hemisphere(rng, 500), hemisphere(rng, 500)
    assert a.evaluate(wi, wo) == pytest.approx(b.evaluate(wi, wo), rel=1e-6)


def test_beyond_the_last_angle_its_value_is_held():
    model = TabulatedGoniometer(1, 1.0, 1.0, 2, 1, 2, 1, values=[0.1, 0.2, 0.3, 0.4])
    wo = unit(np.array(0.5), np.array(1.0))
    at, beyond = (model.evaluate(unit(np.array(t), np.array(0.0)), wo) for t in (1.0, 1.4))
    assert at == pytest.approx(beyond)
    assert at == pytest.approx([0.35] * 3)  # between 0.3 and 0.4 half-way along theta_o


def test_a_table_of_the_wrong_length_is_refused():
    with pytest.raises(ParameterError, match="3 x 3 x 4 = 36 bins; got 35"):
        TabulatedIsotropic(values=np.zeros(35))
    with pytest.raises(ParameterError, match="2 x 1 x 2 x 4 = 16 pairs of directions; got 3"):
        TabulatedGoniometer(values=np.zeros(3))
    with pytest.raises(ParameterError, match="one azimuth of the light"):
        TabulatedGoniometer(1, 1.0, 1.0, 2, 2, 2, 4, 1, values=np.zeros(32))

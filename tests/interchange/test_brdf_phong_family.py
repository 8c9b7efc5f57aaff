"""Lobes that grew out of Phong's and of half vectors: closed forms and the papers' formulas in angles."""

from itertools import pairwise

import numpy as np
import pytest

from interchange.brdf.ashikhmin_premoze import AshikhminPremoze
from interchange.brdf.ashikhmin_shirley import AshikhminShirley
from interchange.brdf.kurt import Kurt
from interchange.brdf.neumann import Neumann


def spherical(theta, phi):
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


WI, WO = spherical(0.6, 0.4), spherical(0.8, 2.9)


def hemisphere(n=600):
    """Midpoints of a grid (n, n, 3) and their solid angles times cosine (n, 1)."""
    t = (np.arange(n) + 0.5) / n * np.pi / 2
    p = (np.arange(n) + 0.5) / n * 2 * np.pi
    w = np.stack(
        np.broadcast_arrays(
            np.sin(t)[:, None] * np.cos(p), np.sin(t)[:, None] * np.sin(p), np.cos(t)[:, None]
        ),
        -1,
    )
    return w, np.broadcast_to((np.sin(t) * np.cos(t) * np.pi**2 / n**2)[:, None], (n, n))


def albedo(brdf, wo):
    w, weight = hemisphere()
    return np.einsum("tpc,tp->c", brdf.evaluate(w, wo), weight)


def half_angles(wi, wo):
    """Elevation and azimuth of h, and its angle to wo, by arc functions."""
    h = (wi + wo) / np.linalg.norm(wi + wo)
    return np.arccos(h[2]), np.arctan2(h[1], h[0]), np.arccos(h @ wo)


@pytest.mark.parametrize("n", [1, 7, 60])
def test_neumanns_lobe_reflects_its_albedo_head_on_and_half_at_grazing(n):
    metal = Neumann(0, 0.7, n)
    assert albedo(metal, spherical(0, 0)) == pytest.approx([0.7] * 3, rel=1e-4)
    # half of ∫ (n + 2) / 2π cos^n over the sphere around the axis; 89.9° is still 1 % off the limit for n = 60
    grazing = 0.7 * (n + 2) / (n + 1) / 2
    assert albedo(metal, spherical(np.radians(89.9), 0.3)) == pytest.approx([grazing] * 3, rel=0.03)
    steps = [albedo(metal, spherical(np.radians(t), 0))[0] for t in (0, 20, 40, 60, 80)]
    assert all(b <= a * (1 + 1e-4) for a, b in pairwise(steps))


def test_neumanns_lobe_towards_a_mirror_is_stretched_by_the_larger_cosine():
    theta, off = np.radians(60), np.radians(12)
    f = Neumann(0, 1, 30).evaluate(spherical(theta, 0), spherical(theta - off, np.pi))[0]
    assert f == pytest.approx(32 / (2 * np.pi) * np.cos(off) ** 30 / np.cos(theta - off), rel=1e-12)


def test_ashikhmin_shirley_is_the_formula_in_angles():
    r_d, r_s, n_u, n_v = 0.3, 0.2, 30.0, 90.0
    theta, phi, turn = half_angles(WI, WO)
    exponent = n_u * np.cos(phi) ** 2 + n_v * np.sin(phi) ** 2
    lobe = np.sqrt((n_u + 1) * (n_v + 1)) / (8 * np.pi) * np.cos(theta) ** exponent
    fresnel = r_s + (1 - r_s) * (1 - np.cos(turn)) ** 5
    matte = 28 * r_d / (23 * np.pi) * (1 - r_s)
    for w in (WI, WO):
        matte *= 1 - (1 - w[2] / 2) ** 5
    expected = lobe * fresnel / (np.cos(turn) * max(WI[2], WO[2])) + matte
    assert AshikhminShirley(r_d, r_s, n_u, n_v).evaluate(WI, WO)[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("tan", [1e-6, 0.1, 0.1732, 0.1733, 3.0])
def test_ashikhmin_shirleys_power_of_the_cosine_holds_from_the_normal_outwards(tan):
    """h at every tilt, across the change from series to logarithm at tan² = 0.03."""
    w = np.array([0.0, tan, 1.0]) / np.hypot(tan, 1)
    lobe = AshikhminShirley(0, 1, 9, 40).evaluate(w, w)[0] * 8 * np.pi * w[2] / np.sqrt(10 * 41)
    assert lobe == pytest.approx(w[2] ** 40, rel=1e-7)


def test_ashikhmin_shirleys_matte_part_has_its_albedo():
    """R_d (1 - R_s) (1 - (1 - cos / 2)^5), as ∫ (1 - (1 - c / 2)^5) c dω = 23 π / 28."""
    wo = spherical(0.5, 0.2)
    brdf = AshikhminShirley(0.8, 0.0, 200, 200)
    lobe = AshikhminShirley(0.0, 0.0, 200, 200)
    expected = 0.8 * (1 - (1 - wo[2] / 2) ** 5)
    assert albedo(brdf, wo) - albedo(lobe, wo) == pytest.approx([expected] * 3, rel=1e-4)


@pytest.mark.parametrize("n_u", [0, 5, 1000])
@pytest.mark.parametrize("r_s", [0.0, 0.5, 1.0])
def test_ashikhmin_shirley_keeps_energy_at_the_edges_of_its_bounds(n_u, r_s):
    for degrees in (0, 50, 75, 88):
        assert albedo(AshikhminShirley(1, r_s, n_u, 40), spherical(np.radians(degrees), 0.7))[0] <= 1 + 1e-3


def test_ashikhmin_premozes_distribution_is_read_back_from_retro_reflection():
    """p(h) = 4 (2 c - c²) f(h, h) / f_0, the way the source measures p; p is a density."""
    brdf = AshikhminPremoze(0, 0.3, 0.25, (0.5, 0.25), (0.4, 0.1), (0.2, 0.1))
    w, weight = hemisphere()
    c = w[..., 2]
    p = brdf.evaluate(w, w)[..., 0] * 4 * (2 * c - c * c) / 0.3
    assert np.sum(p * weight / c) == pytest.approx(1.0, rel=1e-4)


def test_ashikhmin_premoze_is_the_formula_in_angles():
    theta, phi, turn = half_angles(WI, WO)
    tan2 = np.tan(theta) ** 2 * (np.cos(phi) ** 2 / 0.4**2 + np.sin(phi) ** 2 / 0.7**2)
    p = 0.6 * np.exp(-tan2) / (np.pi * 0.4 * 0.7 * np.cos(theta) ** 3) + 0.2 / (2 * np.pi)
    fresnel = 0.1 + 0.9 * (1 - np.cos(turn)) ** 5
    expected = 0.5 / np.pi + p * fresnel / 4 / (WI[2] + WO[2] - WI[2] * WO[2])
    brdf = AshikhminPremoze(0.5, 0.1, 0.2, (0.6,), (0.4,), (0.7,))
    assert brdf.evaluate(WI, WO)[0] == pytest.approx(expected, rel=1e-9)


def test_ashikhmin_premozes_lobe_reflects_no_more_than_its_weights():
    brdf = AshikhminPremoze(0, 1, 0.5, (0.5,), (0.3,), (0.1,))
    assert all(albedo(brdf, spherical(np.radians(t), 0.9))[0] <= 1 for t in (0, 40, 70, 85, 89))


def test_kurt_is_the_formula_in_angles_and_adds_its_lobes():
    theta, phi, turn = half_angles(WI, WO)

    def lobe(k, f_0, m_x, m_y, alpha):
        tan2 = np.tan(theta) ** 2 * (np.cos(phi) ** 2 / m_x**2 + np.sin(phi) ** 2 / m_y**2)
        d = np.exp(-tan2) / (np.pi * m_x * m_y * np.cos(theta) ** 4)
        return (
            k
            * (f_0 + (1 - f_0) * (1 - np.cos(turn)) ** 5)
            * d
            / (4 * np.cos(turn) * (WI[2] * WO[2]) ** alpha)
        )

    one, two = (0.4, 0.1, 0.3, 0.5, 0.2), (0.7, 0.6, 0.8, 0.6, 0.9)
    k, f_0, m_x, m_y, alpha = zip(one, two, strict=True)
    value = Kurt(0.3, k, f_0, m_x, m_y, alpha).evaluate(WI, WO)[0]
    assert value == pytest.approx(0.3 / np.pi + lobe(*one) + lobe(*two), rel=1e-9)


def test_kurts_lobe_head_on_reflects_its_weight_where_it_is_narrow():
    """For m to 0 every alpha gives k f_0 at the normal: the albedo is 1 - O(m²)."""
    for alpha in (0, 0.5, 1):
        brdf = Kurt(0, ((0.8, 0.8, 0.8),), (0.5,), (0.05,), (0.04,), (alpha,))
        assert albedo(brdf, spherical(0, 0))[0] == pytest.approx(0.4, rel=2e-2)

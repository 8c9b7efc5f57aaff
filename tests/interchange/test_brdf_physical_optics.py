"""Rough surfaces by physical optics: the series against exact sums, limits to other models, energy head-on."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import erfc, gammaln, lambertw
from scipy.special import j0 as bessel

from interchange.brdf.he import He
from interchange.brdf.microfacet import beckmann, fresnel_conductor, half_vector
from interchange.brdf.physical_optics import lambert_w, mirror_lobe, series
from interchange.brdf.stam import Stam

NORMAL = np.array([0, 0, 1.0])
METAL = {"eta": 0.01, "k": 20.0}  # reflects 99.99 %


def spherical(theta, phi):
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def exact(g, b):
    m = np.arange(1, int(3 * g + 40 * np.sqrt(g) + 400))
    return np.exp(-g + m * np.log(g) - gammaln(m + 1) - np.log(m) - b / m).sum()


@pytest.mark.parametrize("g", [1e-3, 0.5, 5, 11.9, 12.1, 16, 60, 1e4])
@pytest.mark.parametrize("far", [0.0, 0.3, 2.0, 8.0])
def test_series_is_its_exact_sum(g, far):
    b = far * g
    rough = 1e-4 * exact(g, 0)  # below this light its own size no longer matters
    assert series(np.float64(g), np.float64(b)) == pytest.approx(exact(g, b), rel=6e-5, abs=rough * 1e-2)
    assert series(np.float32(g), np.float32(b)) == pytest.approx(exact(g, b), rel=1e-4, abs=rough * 1e-2)


def test_lambert_w_is_scipys():
    c = np.logspace(-8, 6, 50)
    assert lambert_w(c) == pytest.approx(lambertw(c).real, rel=1e-6)


@pytest.mark.parametrize(("sigma", "theta"), [(20.0, 0.3), (60.0, 0.5), (150.0, 0.2)])
def test_stam_is_the_transform_of_the_correlation_of_phases(sigma, theta):
    """The series comes from the integral it expands, S = ∫ (e^(-g (1 - C(r))) - e^-g) J0(k u r) 2 π r dr, here by
    quadrature; ``spread`` keeps the mirror's lobe away."""
    length, wavelength = 900.0, 550.0
    wi, wo = spherical(theta, 0.4), NORMAL
    u = np.hypot(wi[0], wi[1]) * 2 * np.pi / wavelength
    vz = wi[2] + wo[2]
    g = (2 * np.pi * sigma * vz / wavelength) ** 2

    def integrand(r):
        return (np.exp(-g * (1 - np.exp(-((r / length) ** 2)))) - np.exp(-g)) * bessel(u * r) * 2 * np.pi * r

    density = quad(integrand, 0, 6 * length, limit=400)[0]
    expected = (1 + wi @ wo) ** 2 / (wavelength**2 * vz**2 * wi[2] * wo[2]) * density
    brdf = Stam(0, sigma, length, length, wavelength, spread=0.005, **METAL)
    fresnel = fresnel_conductor(np.sqrt((1 + wi @ wo) / 2), 0.01, 20.0)
    assert brdf.evaluate(wi, wo)[0] == pytest.approx(fresnel * expected, rel=1e-4)


def test_stam_spreads_light_across_its_short_correlation():
    """Turning the surface by a right angle swaps T_x and T_y."""
    along, across = Stam(T_x=800, T_y=3000), Stam(T_x=3000, T_y=800)
    off_x, off_y = spherical(0.4, 0.0), spherical(0.4, np.pi / 2)
    assert along.evaluate(off_x, NORMAL) == pytest.approx(across.evaluate(off_y, NORMAL), rel=1e-9)
    assert (along.evaluate(off_x, NORMAL) > 10 * along.evaluate(off_y, NORMAL)).all()


def papers_directional_diffuse(wi, wo, sigma_0, tau, wavelength):
    """ρ_dd / |F|² of He et al. 1991 as printed (equations 23-25, 76-84, errata applied): G by polarisation vectors,
    z_0 by bisection, the sum over all its terms."""
    k_i, k_r, n = -wi, wo, NORMAL
    v = 2 * np.pi / wavelength * (k_r - k_i)
    s_i, s_r = (np.cross(k, n) / np.linalg.norm(np.cross(k, n)) for k in (k_i, k_r))
    p_i, p_r = np.cross(s_i, k_i), np.cross(s_r, k_r)
    quotient = ((s_r @ k_i) ** 2 + (p_r @ k_i) ** 2) * ((s_i @ k_r) ** 2 + (p_i @ k_r) ** 2)
    shape = (
        (v @ v / v[2]) ** 2
        / (2 * np.pi / wavelength) ** 2
        * quotient
        / np.linalg.norm(np.cross(k_r, k_i)) ** 4
    )
    cot = [w[2] / np.hypot(w[0], w[1]) for w in (wi, wo)]
    x = [tau * c / (2 * sigma_0) for c in cot]
    lit = 1.0
    for a in x:
        hidden = (2 / np.sqrt(np.pi) / (2 * a) * np.exp(-(a**2)) - erfc(a)) / 2
        lit *= (1 - erfc(a) / 2) / (hidden + 1)
    k = sum(erfc(a) / c for a, c in zip(x, cot, strict=True))
    z_0 = brentq(
        lambda z: np.sqrt(np.pi / 2) * z - sigma_0 / 4 * k * np.exp(-(z**2) / (2 * sigma_0**2)), 0, 1e5
    )
    sigma = sigma_0 / np.sqrt(1 + (z_0 / sigma_0) ** 2)
    g = (2 * np.pi * sigma / wavelength * (wi[2] + wo[2])) ** 2
    d = np.pi**2 * tau**2 / (4 * wavelength**2) * exact(g, (v[0] ** 2 + v[1] ** 2) * tau**2 / 4)
    return shape * lit * d / (np.pi * wi[2] * wo[2])


@pytest.mark.parametrize(("sigma_0", "tau"), [(30, 1500), (120, 900), (180, 3000), (500, 1200)])
def test_he_is_the_formula_of_the_paper(sigma_0, tau):
    for wi, wo in [(0.3, 0.7), (1.2, 0.5), (1.4, 1.3)]:
        wi, wo = spherical(wi, 0.3), spherical(wo, 2.6)  # away from the mirror direction: no mirror term
        value = He(0, sigma_0, tau, 550, spread=0.005, **METAL).evaluate(wi, wo)[0]
        fresnel = fresnel_conductor(np.sqrt((1 + wi @ wo) / 2), 0.01, 20.0)
        paper = fresnel * papers_directional_diffuse(wi, wo, sigma_0, tau, 550)
        assert value == pytest.approx(paper, rel=2e-4, abs=1e-5)  # the lobe of the series is at most some 1e1


def test_he_of_a_very_rough_surface_is_cook_torrance_with_beckmann():
    """g = 1600 and more: geometrical optics, slopes of width 2 σ / τ; S is Smith's, near 1 at these slopes."""
    brdf = He(0, 2000, 2e4, 550, **METAL)
    for wi, wo in [(0.1, 0.3), (0.5, 0.4), (0.7, 0.75)]:
        wi, wo = spherical(wi, 0.0), spherical(wo, 3.0)
        h, cos = half_vector(tuple(wi), tuple(wo))
        expected = fresnel_conductor(cos, 0.01, 20.0) * beckmann(h, 0.2, 0.2) / (4 * wi[2] * wo[2])
        assert brdf.evaluate(wi, wo)[0] == pytest.approx(expected, rel=3e-3)


def albedo(brdf, wo):
    """By quadrature over the hemisphere, whose nodes crowd at the normal."""
    x, p = (np.arange(500) + 0.5) / 500, (np.arange(64) + 0.5) / 64 * 2 * np.pi
    sin, cos = np.sin(np.pi / 2 * x * x), np.cos(np.pi / 2 * x * x)
    wi = np.stack(np.broadcast_arrays(sin[:, None] * np.cos(p), sin[:, None] * np.sin(p), cos[:, None]), -1)
    return np.einsum("tpc,t->c", brdf.evaluate(wi, wo), sin * cos * np.pi * x / 500 * 2 * np.pi / 64)


@pytest.mark.parametrize("model", [He, Stam])
@pytest.mark.parametrize("sigma", [5, 40, 80, 180, 400])
def test_what_the_mirror_loses_is_scattered(model, sigma):
    """Head-on, with gentle slopes, e^-g of the light leaves as from a mirror and the rest diffusely, whatever g is:
    together all of it, within the slopes' squares."""
    lengths = {"tau": 8000} if model is He else {"T_x": 8000, "T_y": 8000}
    brdf = model(0, sigma, **lengths, **METAL)
    assert albedo(brdf, NORMAL) == pytest.approx([1.0] * 3, abs=1e-2)


def test_mirror_term_falls_with_roughness_by_the_phase():
    """Peak head-on: F e^-g D_s / 4 with g = (4 π σ / λ)², D_s = 1 / (π α²); the scattered part is 1e-3 of it here."""
    for sigma in (5.0, 10.0, 20.0):
        value = He(0, sigma, 1000, 550, spread=0.005, **METAL).evaluate(NORMAL, NORMAL)[0]
        g = (4 * np.pi * sigma / 550) ** 2
        assert value == pytest.approx(np.exp(-g) / (4 * np.pi * 0.005**2), rel=5e-3)


def test_mirror_lobe_keeps_energy_at_every_angle_and_width():
    t, p = (np.arange(1500) + 0.5) / 1500 * np.pi / 2, (np.arange(600) + 0.5) / 600 * 2 * np.pi
    wi = np.sin(t)[:, None] * np.cos(p), np.sin(t)[:, None] * np.sin(p), np.cos(t)[:, None] + 0 * p
    weight = np.sin(t) * np.cos(t) * np.pi**2 / 1500 / 600
    for theta in (0.0, 0.7, 1.4, 1.55):
        wo = tuple(spherical(theta, 0.2))
        h, cos = half_vector(wi, wo)
        for alpha in (0.03, 0.2, 1.0):
            total = (mirror_lobe(wi, wo, h, cos, alpha) * weight[:, None]).sum()
            assert total <= 1 + 1e-3
            assert total > 0.97 or alpha > 0.03 or theta > 1


@pytest.mark.parametrize(("sigma_0", "tau"), [(1, 50), (50, 100), (80, 550), (150, 2000)])
def test_he_keeps_energy_up_to_grazing_angles(sigma_0, tau):
    """Where Kirchhoff's theory and shadowing could break it: small and steep heights, light at 60 to 88 degrees."""
    t, p = (np.arange(700) + 0.5) / 700 * np.pi / 2, (np.arange(180) + 0.5) / 180 * 2 * np.pi
    wi = np.stack(
        np.broadcast_arrays(
            np.sin(t)[:, None] * np.cos(p), np.sin(t)[:, None] * np.sin(p), np.cos(t)[:, None]
        ),
        -1,
    )
    weight = np.sin(t) * np.cos(t) * np.pi**2 / 700 / 180
    brdf = He(0, sigma_0, tau, 550, spread=0.1, **METAL)
    for degrees in (60, 75, 88):
        total = np.einsum("tpc,t->c", brdf.evaluate(wi, spherical(np.radians(degrees), 0.0)), weight)
        assert (total <= 1 + 2e-3).all()

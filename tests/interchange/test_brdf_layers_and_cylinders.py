"""A turbid layer against photons followed one by one, brushed metal against traced cylinders, and their limits."""

import numpy as np
import pytest

from interchange.brdf.hanrahan_krueger import HanrahanKrueger
from interchange.brdf.lambert import Lambert
from interchange.brdf.poulin_fournier import PoulinFournier


def spherical(theta, phi):
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


WI, WO = spherical(0.6, 0.4), spherical(0.8, 2.9)


def hemisphere(n, m):
    """Midpoints (n, m, 3), elevation first, and solid angle times cosine (n,)."""
    t, p = (np.arange(n) + 0.5) / n * np.pi / 2, (np.arange(m) + 0.5) / m * 2 * np.pi
    w = np.sin(t)[:, None] * np.cos(p), np.sin(t)[:, None] * np.sin(p), np.cos(t)[:, None] + 0 * p
    return np.stack(w, -1), np.sin(t) * np.cos(t) * np.pi**2 / n / m


def albedo(brdf, wo):
    w, weight = hemisphere(300, 100)
    return np.einsum("tpc,t->c", brdf.evaluate(w, wo), weight)


def test_a_layer_of_no_depth_and_no_boundary_is_its_base():
    assert HanrahanKrueger(1, 0, 0.4, 0.5, 1.0).evaluate(WI, WO) == pytest.approx(
        Lambert(0.4).evaluate(WI, WO)
    )


def test_a_deep_isotropic_layer_without_boundary_is_lommel_seeligers_law():
    f = HanrahanKrueger(0.8, 50, 1, 0, 1.0).evaluate(WI, WO)[0]
    assert f == pytest.approx(0.8 / (4 * np.pi) / (WI[2] + WO[2]), rel=1e-9)


def fresnel(cos, n):
    """By the two polarisations' amplitudes, from air into index n."""
    inside = np.sqrt(1 - (1 - cos**2) / n**2)
    return 0.5 * (
        ((cos - n * inside) / (cos + n * inside)) ** 2 + ((inside - n * cos) / (inside + n * cos)) ** 2
    )


@pytest.mark.parametrize(("tau", "g", "base"), [(0.3, 0.4, 0.0), (1.0, -0.4, 0.0), (0.5, 0.0, 0.7)])
def test_a_layer_is_what_photons_do_in_it(tau, g, base):
    """Photons refract, fly an exponential path, scatter once by Henyey and Greenstein's inverse or reach the base, fly
    out and refract. Their light in cones of elevation against the integral of f cos, within four standard
    deviations (of 0.2 % to 3 %)."""
    eta, count = 1.4, 1_000_000
    wi = spherical(0.7, 0.0)
    brdf = HanrahanKrueger(0.9, tau, base, g, eta, 0.01)
    mirror = HanrahanKrueger(0.0, 50, 0, g, eta, 0.01)  # black: only the boundary, to be taken off
    rng = np.random.default_rng(1)
    inside = wi / [eta, eta, 1]
    inside = -np.array([*inside[:2], np.sqrt(1 - inside[0] ** 2 - inside[1] ** 2)])
    scatters = np.arange(count) % 2 == 0  # half of the photons are made to scatter within the layer
    chance = 1 - np.exp(-tau / -inside[2])
    depth = np.log(1 - chance * rng.random(count)) * inside[2]
    u = rng.random(count)
    cos = (1 + g * g - ((1 - g * g) / (1 - g + 2 * g * u)) ** 2) / (2 * g) if g else 1 - 2 * u
    turn, sin = rng.random(count) * 2 * np.pi, np.sqrt(1 - cos**2)
    side = np.array([-inside[2], 0, inside[0]])
    out = cos[:, None] * inside + sin[:, None] * (
        np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * np.array([0.0, 1, 0])
    )
    z = np.where(scatters, out[:, 2], np.sqrt(rng.random(count)))  # the base is Lambertian inside
    light = 2 * np.where(scatters, 0.9 * chance, base * (1 - chance)) * (1 - fresnel(wi[2], eta))
    with np.errstate(all="ignore"):
        light = light * np.exp(-np.where(scatters, depth, tau) / z)
        outside = np.sqrt(1 - (1 - z**2) * eta**2)  # NaN where reflected totally
        light = np.where((z > 0) & (outside > 0), light * (1 - fresnel(outside, eta)), 0.0)
    cones = np.linspace(0, 1, 5)
    outside, light = np.nan_to_num(outside), np.nan_to_num(light) / count
    got, square = (np.histogram(outside, cones, weights=x)[0] for x in (light, light**2))
    sigma = np.sqrt(square)
    w, weight = hemisphere(600, 120)
    f = (brdf.evaluate(w, wi) - mirror.evaluate(w, wi))[..., 0]
    expected, _ = np.histogram(w[:, 0, 2], cones, weights=f.sum(axis=1) * weight)
    assert (sigma < 0.03 * expected).all()
    assert (np.abs(got - expected) < 4 * sigma + 1e-3 * expected).all()


@pytest.mark.parametrize("eta", [1.0, 1.1, 1.6, 3.0])
@pytest.mark.parametrize("alpha", [0.1, 1.0])
def test_a_layer_keeps_energy_at_the_edges_of_its_bounds(eta, alpha):
    for degrees in (0, 45, 75, 87):
        wo = spherical(np.radians(degrees), 0)
        for tau, g in ((0, 0), (0.5, -0.9), (50, -0.95), (1, 0.9)):
            assert albedo(HanrahanKrueger(1, tau, 1, g, eta, alpha), wo)[0] <= 1 + 1e-3


def first_hit(origin, u, h, period):
    """Of rays (N, 2) in the plane across the cylinders: the distance to what they hit first, and its normal."""
    distance, normal = np.full(len(origin), np.inf), np.zeros((len(origin), 2))
    with np.errstate(all="ignore"):
        t = (h - origin[:, 1]) / u[1]
        y = origin[:, 0] + t * u[0]
    floor = (t > 1e-7) & (np.abs(y - np.round(y / period) * period) >= np.sqrt(1 - h * h))
    distance[floor], normal[floor] = t[floor], (0, 1)
    for k in range(-8, 9):
        from_axis = origin - np.stack([(np.round(origin[:, 0] / period) + k) * period, 0 * origin[:, 0]], -1)
        b = from_axis @ u
        inside = b * b - np.sum(from_axis**2, axis=1) + 1
        t = -b - np.sqrt(np.maximum(inside, 0))
        at = from_axis + t[:, None] * u
        hit = (inside > 0) & (t > 1e-7) & (at[:, 1] > h) & (t < distance)
        distance[hit], normal[hit] = t[hit], at[hit]
    return distance, normal


def traced(brdf, wi, wo, count=20_000):
    """Radiance towards wo by rays spread over one period, with shadow rays to wi."""
    u_i, u_o = (w[1:] / np.hypot(w[1], w[2]) for w in (wi, wo))
    period = 2 * np.sqrt(1 - brdf.h**2) + brdf.d
    origin = np.stack([(np.arange(count) + 0.5) / count * period, np.full(count, 1.0001)], -1)
    distance, normal = first_hit(origin, -u_o, brdf.h, period)
    lit = np.isinf(first_hit(origin - distance[:, None] * u_o + 1e-6 * normal, u_i, brdf.h, period)[0])
    half = (wi + wo) / np.linalg.norm(wi + wo)
    height = (brdf.n + 2) * (brdf.n + 4) / (8 * np.pi * (2 ** (-brdf.n / 2) + brdf.n))
    f = brdf.k_d[0] / np.pi + brdf.k_s[0] * height * np.maximum(normal @ half[1:], 0) ** brdf.n
    return np.mean(f * np.maximum(normal @ wi[1:], 0) * lit) / wi[2]


@pytest.mark.parametrize("h", [0.0, 0.3, 0.8])
@pytest.mark.parametrize("d", [0.0, 0.4, 3.0])
@pytest.mark.parametrize("n", [5, 300])
def test_brushed_metal_is_what_rays_see_of_its_cylinders(h, d, n):
    """Lit and seen parts, floor and shadows of neighbours by brute force, to elevations of 6 degrees; 20,000 rays in
    a regular grid leave 1e-3 where edges of shadows fall between them."""
    rng = np.random.default_rng(7)
    brdf = PoulinFournier(0.6, 0.4, n, h, d)
    pairs = [
        (spherical(t_i, p_i), spherical(t_o, p_o))
        for t_i, p_i, t_o, p_o in rng.uniform(0, [1.46, 6.28] * 2, (6, 4))
    ]
    pairs.append((spherical(1.2, 0.3), spherical(1.19, 0.3 + np.pi)))
    for wi, wo in pairs:
        assert brdf.evaluate(wi, wo)[0] == pytest.approx(traced(brdf, wi, wo), rel=3e-3, abs=1e-5)


def test_highlight_of_brushed_metal_is_a_streak_across_the_cylinders():
    brdf = PoulinFournier(0, 1, 500, 0.0, 0.0)
    normal = np.array([0, 0, 1.0])
    across, along = (
        brdf.evaluate(spherical(0.5, np.pi / 2), normal),
        brdf.evaluate(spherical(0.5, 0.0), normal),
    )
    assert (across > 100 * along).all()
    assert (across > 0.3 * brdf.evaluate(normal, normal)).all()


@pytest.mark.parametrize(("k_d", "k_s"), [(1, 0), (0, 1)])
def test_brushed_metal_keeps_energy_of_each_part(k_d, k_s):
    for degrees in (0, 60, 85):
        for phi in (0, np.pi / 2):
            for n, h in ((1, 0.0), (20, 0.9)):
                wo = spherical(np.radians(degrees), phi)
                assert albedo(PoulinFournier(k_d, k_s, n, h, 0.2), wo)[0] <= 1 + 1e-3

"""Spherical harmonics and Zernike polynomials: the functions themselves, and the laws of their products."""

import numpy as np
import pytest
from scipy.special import eval_legendre

from interchange.brdf.modes import pairs
from interchange.brdf.spherical_harmonics import SphericalHarmonics, harmonics
from interchange.brdf.zernike import Zernike, disk_modes
from interchange.parameter import ParameterError
from interchange.table import Table

RNG = np.random.default_rng(5)


def directions(count, lowest=0.02):
    z, phi = RNG.uniform(lowest, 1, count), RNG.uniform(0, 2 * np.pi, count)
    s = np.sqrt(1 - z * z)
    return np.stack([s * np.cos(phi), s * np.sin(phi), z], axis=-1)


def signed(modes):
    """All real modes at one set of directions, from radial parts and the plane."""
    p = modes.plane[0] + 1j * modes.plane[1]
    found = {}
    for (n, m), radial in modes.radial.items():
        if m == 0:
            found[n, 0] = radial + 0 * p.real
        else:
            found[n, m], found[n, -m] = np.sqrt(2) * radial * (p**m).real, np.sqrt(2) * radial * (p**m).imag
    return found


def gram(make, low, order):
    """Products of all modes integrated over z in [low, 1] and all azimuths, exactly for polynomials in x, y, z."""
    node, weight = np.polynomial.legendre.leggauss(2 * order + 2)
    z, phi = (node + 1) / 2 * (1 - low) + low, 2 * np.pi * np.arange(2 * order + 2) / (2 * order + 2)
    s = np.sqrt(1 - z * z)[:, None]
    w = (s * np.cos(phi), s * np.sin(phi), z[:, None] + 0 * phi)
    modes = np.stack(list(signed(make(w, order)).values()))
    area = weight * (1 - low) / 2 * (2 * np.pi / len(phi))
    return np.einsum("atp,btp,t->ab", modes, modes, area)


def test_harmonics_are_the_published_ones():
    """The nine of Ramamoorthi and Hanrahan, An efficient representation for irradiance environment maps, 2001."""
    x, y, z = directions(50).T
    got = signed(harmonics((x, y, z), 2))
    published = {
        (0, 0): 0.282095 + 0 * x,
        (1, 1): 0.488603 * x, (1, 0): 0.488603 * z, (1, -1): 0.488603 * y,
        (2, 1): 1.092548 * x * z, (2, -1): 1.092548 * y * z, (2, -2): 1.092548 * x * y,
        (2, 0): 0.315392 * (3 * z * z - 1), (2, 2): 0.546274 * (x * x - y * y),
    }  # fmt: skip
    assert set(got) == set(published)
    for name, value in published.items():
        assert got[name] == pytest.approx(value, abs=2e-6), name  # six digits are printed


def test_harmonics_are_orthonormal_over_the_sphere():
    assert np.abs(gram(harmonics, -1.0, 12) - np.eye(13**2)).max() < 1e-11


def test_zernike_modes_are_orthonormal_over_the_hemisphere():
    assert np.abs(gram(disk_modes, 0.0, 16) - np.eye(17 * 18 // 2)).max() < 1e-11


@pytest.mark.parametrize(
    ("n", "m", "radial"),
    [
        (1, 1, lambda r: r),
        (2, 0, lambda r: 2 * r**2 - 1),
        (3, 1, lambda r: 3 * r**3 - 2 * r),
        (4, 0, lambda r: 6 * r**4 - 6 * r**2 + 1),
        (4, 2, lambda r: 4 * r**4 - 3 * r**2),
        (5, 1, lambda r: 10 * r**5 - 12 * r**3 + 3 * r),
        (6, 0, lambda r: 20 * r**6 - 30 * r**4 + 12 * r**2 - 1),
        (8, 2, lambda r: 56 * r**8 - 105 * r**6 + 60 * r**4 - 10 * r**2),
    ],
)
def test_zernike_polynomials_are_the_published_ones(n, m, radial):
    """Born and Wolf, Principles of Optics, table of R_n^m; r = sqrt2 sin(theta / 2), area for area."""
    theta = np.linspace(0, np.pi / 2, 20)
    r = np.sqrt(2) * np.sin(theta / 2)
    modes = disk_modes((np.sin(theta), 0 * theta, np.cos(theta)), n)
    got = modes.radial[n, m] * modes.plane[0] ** m / np.sqrt((n + 1) / (2 * np.pi))
    assert got == pytest.approx(radial(r), abs=1e-12)


def test_counts_of_coefficients_are_the_published_ones():
    """Isotropic: 5 for order 2 and 55 for order 8 (Dana et al. 1999, who use Koenderink's basis for CUReT)."""
    assert [Zernike.count(n) for n in (0, 2, 4, 8)] == [1, 5, 14, 55]
    assert [SphericalHarmonics.count(n) for n in (0, 4, 12)] == [1, 35, 455]
    assert SphericalHarmonics.count(2, True) == 45


def test_a_lambertian_is_one_coefficient():
    rho, wi, wo = 0.4, directions(40), directions(40)
    zernike = Zernike(0, 0, Table([2 * rho]))
    harmonic = SphericalHarmonics(0, 0, Table([4 * rho]))
    for model in (zernike, harmonic):
        assert model.evaluate(wi, wo) == pytest.approx(rho / np.pi, rel=1e-6)


def test_mirrored_cosine_has_the_published_expansion():
    """max(cos, 0) of the angle to the mirror direction: A_l = pi, 2 pi / 3, pi / 4, 0, -pi / 24, 0, pi / 64
    (Ramamoorthi and Hanrahan 2001). The addition theorem makes of the diagonal matrix (-1)^m A_l the sum
    of (2l + 1) / 4 pi A_l P_l; degree 6 of it misses the cosine most at its
    kink, by 1/4 - 5/32 - 9/256 - 65/4096 = 0.0427."""
    a = np.pi * np.array([1, 2 / 3, 1 / 4, 0, -1 / 24, 0, 1 / 64])
    index = pairs([(n, m) for n in range(7) for m in range(n + 1)], False)
    model = SphericalHarmonics(6, 0, Table([(-1) ** p[1] * a[p[0]] if p == q else 0.0 for p, q in index]))
    wi, wo = directions(500), directions(500)
    cos = np.sum(wi * wo * [-1, -1, 1], axis=-1)
    zonal = sum((2 * n + 1) / (4 * np.pi) * a[n] * eval_legendre(n, cos) for n in range(7))
    got = model.evaluate(wi, wo)[:, 0]
    assert got == pytest.approx(np.maximum(zonal, 0), abs=1e-6)
    assert np.abs(got - np.maximum(cos, 0)).max() < 0.0428


def test_product_of_cosines_is_three_zernike_coefficients():
    """z = 1 - rho² = (1 - R_2^0) / 2, so that z_i z_o = (1 - R(i)) (1 - R(o)) / 4, K_2^0 = sqrt(3 / 2 pi) R_2^0."""
    index = Zernike(2, 0, Table(np.zeros(5))).pairs
    row = {pair: k for k, pair in enumerate(index)}
    a = np.zeros(5)
    a[row[(0, 0), (0, 0)]] = np.pi / 2
    a[row[(0, 0), (2, 0)]] = -np.pi / 2 / np.sqrt(3)
    a[row[(2, 0), (2, 0)]] = np.pi / 6
    wi, wo = directions(50), directions(50)
    assert Zernike(2, 0, Table(a)).evaluate(wi, wo)[:, 1] == pytest.approx(wi[:, 2] * wo[:, 2], rel=1e-5)


@pytest.mark.parametrize("model", [Zernike, SphericalHarmonics])
@pytest.mark.parametrize("anisotropic", [0, 1])
def test_exchange_changes_nothing_and_a_turn_only_the_anisotropic(model, anisotropic):
    rows = model.count(4, bool(anisotropic))
    values = np.append(5.0, RNG.normal(0, 0.1, rows - 1))
    brdf = model(4, anisotropic, Table(values))
    wi, wo = directions(100), directions(100)
    value = brdf.evaluate(wi, wo)
    assert value == pytest.approx(brdf.evaluate(wo, wi), rel=1e-13)
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turned = brdf.evaluate(wi @ turn.T, wo @ turn.T)
    moved = np.abs(turned - value).max()
    assert moved > 1e-2 if anisotropic else moved < 1e-12


@pytest.mark.parametrize("model", [Zernike, SphericalHarmonics])
def test_what_falls_below_zero_is_cut_off(model):
    wi, wo = directions(10), directions(10)
    assert (model(0, 0, Table([-1.0])).evaluate(wi, wo) == 0).all()


def test_tables_of_the_wrong_size_are_refused():
    with pytest.raises(
        ParameterError, match=r"Zernike.a \(coefficients\) must have 14 rows for order 4; got 5"
    ):
        Zernike(4)
    with pytest.raises(ParameterError, match="must have 35 rows for degree 4; got 10"):
        SphericalHarmonics(4)
    with pytest.raises(ParameterError, match=r"must lie in \[0, 6\] where anisotropic; got 7"):
        SphericalHarmonics(7, 1)
    with pytest.raises(ParameterError, match=r"must lie in \[0, 8\] where anisotropic; got 9"):
        Zernike(9, 1)

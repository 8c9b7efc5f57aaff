"""Reflectance onto representations: what they hold exactly comes back, what they do not falls with their size."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls

from analysis.projection.expansions import spherical_harmonics, zernike
from analysis.projection.linear_basis import least_squares, mixed_material, mixture, weight_maps
from analysis.projection.log_basis import log_basis
from analysis.projection.residual import prepared, quadrature, residual
from analysis.projection.separable import _svd, separable
from analysis.projection.wavelets import assemble, backward, forward, grid, wavelets
from interchange.brdf.blinn_phong import BlinnPhong
from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.brdf.separable_svd import SeparableSvd
from interchange.brdf.spherical_harmonics import SphericalHarmonics
from interchange.brdf.zernike import Zernike
from interchange.formats.measurements import read
from interchange.material import evaluate_texture
from interchange.problems import BrightfieldError
from interchange.reflectance import ReflectanceSamples
from interchange.table import Table

RNG = np.random.default_rng(3)
LOBE = Lafortune(0.2, weight=[(0.3, 0.4, 0.5)], C=[(-1, -1, 1)], n=[12])


@pytest.mark.parametrize(
    "project",
    [
        lambda d: spherical_harmonics(d, 3),
        lambda d: zernike(d, 4),
        lambda d: separable(d, 1, 8, 1, 6, 2),
        lambda d: separable(d, 1, 8, 1, 6, 2, normalised=True),
        lambda d: wavelets(d, 8, 2, 2),
    ],
    ids=["harmonics", "zernike", "svd", "normalised", "wavelets"],
)
def test_a_lambertian_comes_back(project):
    """Single precision of the tables is left: 1e-7."""
    assert (project(Lambert((0.2, 0.5, 0.9))).residual < 1e-6).all()


def test_a_lambertian_needs_one_coefficient():
    harmonic, disk = (p(Lambert(0.5), 4).brdf for p in (spherical_harmonics, zernike))
    assert harmonic.M.values[0] == pytest.approx(2.0)
    assert disk.a.values[0] == pytest.approx(1.0)
    assert np.abs(harmonic.M.values[1:]).max() < 1e-6
    assert np.abs(disk.a.values[1:]).max() < 1e-6


@pytest.mark.parametrize("anisotropic", [False, True])
@pytest.mark.parametrize(
    ("model", "project"), [(Zernike, zernike), (SphericalHarmonics, spherical_harmonics)]
)
def test_coefficients_are_recovered(model, project, anisotropic):
    """Far below the constant, so that nothing is cut off. Harmonics are not orthogonal over half a sphere: the 3e-6 of
    smoothing and of single precision reach their coefficients enlarged."""
    rows = model.count(2, anisotropic)
    true = np.concatenate([np.full((1, 3), 4.0), RNG.normal(0, 0.02, (rows - 1, 3))])
    found = project(model(2, int(anisotropic), Table(true)), 2, anisotropic)
    assert (found.residual < 1e-5).all()
    values = found.brdf.a.values if model is Zernike else found.brdf.M.values
    assert np.abs(values - true).max() < (1e-4 if model is Zernike else 5e-3)


def test_least_squares_onto_zernike_is_the_closed_form():
    """cos_i cos_o, which three coefficients hold: pi / 2, -pi / 2 sqrt3, pi / 6."""
    data = quadrature(Lambert(0.5))
    data = replace(data, f=np.repeat((data.wi[:, 2] * data.wo[:, 2])[:, None], 3, axis=1))
    a = zernike(data, 2).brdf.a.values
    assert a[:3, 0] == pytest.approx([np.pi / 2, -np.pi / 2 / np.sqrt(3), np.pi / 6], abs=1e-4)
    assert np.abs(a[3:]).max() < 1e-4


@pytest.mark.parametrize(
    ("project", "sizes", "last"),
    [
        (spherical_harmonics, (0, 2, 4, 8), 0.1),
        (zernike, (0, 2, 4, 8), 0.1),
        (lambda d, k: separable(d, k, 24, 1, 12, 6, refine=2), (1, 2, 4, 8), 0.05),
        (lambda d, k: wavelets(d, k, 4, 16), (50, 150, 500, 4000), 0.05),
    ],
    ids=["harmonics", "zernike", "svd", "wavelets"],
)
def test_residual_of_a_lobe_falls_with_the_size(project, sizes, last):
    """n = 12 has a half-width of 19°: degree 8 (22° a half-wave) and a grid of 6° leave some per cent."""
    found = [project(LOBE, k) for k in sizes]
    left = np.array([p.residual.max() for p in found])
    assert (np.diff(left) < 0).all()
    assert left[-1] < last
    assert all(np.diff([p.numbers for p in found]) > 0)


def test_residual_is_what_the_model_leaves():
    """Half of a Lambertian leaves half; a black one has no relative residual."""
    assert residual(Lambert(0.2), quadrature(Lambert(0.4))) == pytest.approx([0.5] * 3)
    with pytest.raises(BrightfieldError, match="data other than 0"):
        residual(Lambert(0.2), quadrature(Lambert(0.0)))


def test_a_product_has_one_singular_value():
    u, v = RNG.uniform(0.5, 2, (12, 3)), RNG.uniform(0.1, 1, (7, 3))
    left, right = _svd(u[:, None] * v[None], 3)
    assert np.einsum("kic,kjc->kijc", left, right)[0] == pytest.approx(u[:, None] * v[None], rel=1e-12)
    assert np.abs(left[1:]).max() < 1e-7


def test_a_product_over_half_and_difference_needs_one_term():
    """Nodes below the horizon are not seen, and are filled by what the product makes of them: exactly when refined
    (single precision is left), to 0.3 per cent where the weight of the first filling stays."""
    theta_h = np.pi / 2 * np.linspace(0, 1, 12) ** 2
    theta_d = np.linspace(0, np.pi / 2, 8)
    true = SeparableSvd(
        1, 12, 1, 8, 2, Table(0.2 + np.exp(-theta_h / 0.3)), Table(np.tile(0.1 + 0.3 * theta_d**4 / 6, 2))
    )
    for limit, how in ((1e-6, {}), (3e-3, {"refine": 0}), (3e-3, {"normalised": True})):
        assert (separable(true, 1, 12, 1, 8, 2, smoothness=1e-8, **how).residual < limit).all()


def test_an_anisotropic_product_is_found_with_azimuths():
    brushed = Lafortune(0.05, weight=[0.5], C=[(-1, -0.6, 0.95)], n=[8])
    round_, turned = (separable(brushed, 4, 12, m, 8, 4, refine=0) for m in (1, 12))
    assert (turned.residual < 0.5 * round_.residual).all()


def test_separable_refuses_what_it_cannot_hold():
    with pytest.raises(BrightfieldError, match="rank must be at most 4"):
        separable(LOBE, 5, 4, 1, 4, 2)
    with pytest.raises(BrightfieldError, match="has one product; got rank 2"):
        separable(LOBE, 2, normalised=True)


@pytest.mark.parametrize("lifted", [False, True])
@pytest.mark.parametrize("levels", [0, 1, 4])
def test_wavelet_transform_and_its_inverse_cancel(levels, lifted):
    values = RNG.normal(size=(len(grid(levels).points), 2))
    back = backward(forward(values, levels, lifted), levels, lifted)
    assert back == pytest.approx(values, abs=1e-13)


def test_lifted_wavelets_leave_the_integral_alone():
    """The hats' integrals add up to a quarter of the sphere; what the coarse values hold is all of the integral."""
    own = grid(4)
    assert [a.sum() for a in own.area] == pytest.approx([np.pi] * 5)
    values = RNG.normal(size=len(own.points))
    coarse = forward(values, 4)[:4]
    assert own.area[0][:4] @ coarse == pytest.approx(own.area[4] @ values, rel=1e-11)


def test_assembled_wavelets_run_through_their_values():
    own = grid(3)
    values = RNG.uniform(0.1, 1, (4, len(own.points), 3))
    model = assemble(values, 3)
    up = own.directions[:, 2] > 0
    theta = np.pi / 2 / 3
    wi = np.array([np.sin(theta), 0, np.cos(theta)])
    assert model.evaluate(wi, own.directions[up]) == pytest.approx(values[1][up], rel=1e-5)
    mirrored = own.directions[up] * [1, -1, 1]
    assert model.evaluate(wi, mirrored) == pytest.approx(values[1][up], rel=1e-5)


def test_largest_wavelets_are_better_than_any_of_their_number():
    """Ten times fewer coefficients than vertices lose little of a lobe, and are those that the model stores."""
    many, few = wavelets(LOBE, 10_000, 4, 8), wavelets(LOBE, 230, 4, 8)
    assert many.numbers > 1800
    assert few.numbers == 230
    assert few.residual.max() < many.residual.max() + 0.05
    assert len(few.brdf.child) < len(many.brdf.child) / 4


def test_a_mixture_of_materials_is_taken_apart():
    basis = (Lambert(0.5), BlinnPhong(0.0, 0.2, 30), LOBE)
    true = np.array([[0.3, 0.4, 0.5], [0.0, 0.7, 0.2], [1.5, 0.0, 0.1]])
    data = quadrature(Lambert(0.5), 512)
    data = replace(data, f=np.einsum("kc,knc->nc", true, [b.evaluate(data.wi, data.wo) for b in basis]))
    found = mixture(data, basis)
    assert np.array(found.brdf.weight) == pytest.approx(true, abs=1e-9)
    assert found.residual.max() < 1e-12


def test_weights_are_not_negative_unless_asked():
    basis = (Lambert(0.5), LOBE)
    data = quadrature(Lambert(0.5), 256)
    f = 2 * basis[0].evaluate(data.wi, data.wo) - 0.5 * basis[1].evaluate(data.wi, data.wo)
    data = replace(data, f=f)
    assert np.array(mixture(data, basis).brdf.weight).min() == 0.0
    assert np.array(mixture(data, basis, nonnegative=False).brdf.weight)[:, 0] == pytest.approx([2, -0.5])
    with pytest.raises(BrightfieldError, match="tell 2 materials apart"):
        mixture(data, (basis[0], Lambert(0.1)))


def test_batched_nonnegative_least_squares_is_scipys():
    design, right = RNG.normal(size=(200, 12, 5)), RNG.normal(size=(200, 12))
    gram, moment = np.einsum("pnk,pnl->pkl", design, design), np.einsum("pnk,pn->pk", design, right)
    expected = [nnls(a, b)[0] for a, b in zip(design, right, strict=True)]
    assert least_squares(gram, moment) == pytest.approx(np.array(expected), abs=1e-9)


def test_pixels_get_their_own_weights():
    """Two materials blended over a surface, seen under eight lights: the blend comes back as textures of a material."""
    basis = (Lambert((0.8, 0.4, 0.2)), LOBE)
    blend = np.stack([np.linspace(0, 1, 12).reshape(3, 4), np.linspace(1, 0.2, 12).reshape(3, 4)], axis=-1)
    lights = quadrature(Lambert(0.5), 8)
    f = sum(blend[:, :, None, k, None] * b.evaluate(lights.wi, lights.wo) for k, b in enumerate(basis))
    use = np.ones((3, 4, 8), bool)
    use[0, 0] = False
    use[1, 1, 0] = False
    f[1, 1, 0] = 1e3
    maps = weight_maps(f, lights.wi, lights.wo, basis, use)
    assert maps.shape == (3, 4, 2, 3)
    assert np.isnan(maps[0, 0]).all()
    expected = np.repeat(blend[..., None], 3, axis=-1)
    assert maps.reshape(12, 2, 3)[1:] == pytest.approx(expected.reshape(12, 2, 3)[1:], abs=1e-9)
    material = mixed_material("blend", maps, basis)
    assert set(material.maps) == {"weight0", "weight1"} <= set(material.brdf.slots())
    seen = evaluate_texture(material.maps["weight1"], np.array([[(2 + 0.5) / 4, 1 - (1 + 0.5) / 3]]))
    assert seen[0] == pytest.approx(expected[1, 2, 1], rel=1e-6)


def test_logarithms_of_materials_that_differ_by_a_factor_have_one_component():
    data = quadrature(Lambert(0.5), 64)
    grey = [Lambert(rho) for rho in (0.1, 0.2, 0.4, 0.8)]
    basis = log_basis(grey, data.wi, data.wo, 2, floor=1e-12)
    assert basis.variance[1] < 1e-12 * basis.variance[0]
    new = Lambert(0.3)
    back = basis.samples(basis.coefficients(new))
    assert back.f == pytest.approx(new.evaluate(data.wi, data.wo), rel=1e-9)
    with pytest.raises(BrightfieldError, match="span 1 to 3 dimensions; got 4"):
        log_basis(grey, data.wi, data.wo, 4)


def test_a_measured_spectrum_becomes_three_channels():
    samples = ReflectanceSamples.from_measurement(read("assets/measurements/garnet_red_60.brdf"))
    found = separable(samples, 2)
    assert found.residual.shape == (3,)
    assert (residual(found.brdf, samples) == found.residual).all()
    red, green, blue = found.brdf.evaluate(
        np.array([0.5, 0, np.sqrt(0.75)]), np.array([0.0, 0.5, np.sqrt(0.75)])
    )
    assert red > 2 * green
    assert red > 2 * blue


def test_no_usable_sample_is_an_error():
    samples = quadrature(Lambert(0.5), 4)
    with pytest.raises(BrightfieldError, match="got none of 4"):
        prepared(replace(samples, use=np.zeros(4, bool)))


def test_sigma_decides_whom_to_believe():
    """Half of the samples say 1, half 3; believed in the ratio 3 : 1 in sigma, 9 : 1 in weight."""
    data = quadrature(Lambert(0.5), 256)
    f = np.where(np.arange(256)[:, None] % 2, 3.0, 1.0) * np.ones(3)
    sigma = np.where(np.arange(256)[:, None] % 2, 3.0, 1.0) * np.ones(3)
    found = zernike(replace(data, f=f, sigma=sigma), 0)
    assert found.brdf.evaluate(data.wi[0], data.wo[0]) == pytest.approx([1.2] * 3, rel=1e-6)

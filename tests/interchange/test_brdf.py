"""What any BRDF must be, whatever its formula. A new file in interchange/brdf is tested here unasked."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interchange.brdf import BY_NAME, MODELS, Brdf
from interchange.brdf.blinn_phong import BlinnPhong
from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.brdf.phong import Phong
from interchange.brdf.sum import Sum
from interchange.brdf.usd_preview_surface import UsdPreviewSurface
from interchange.parameter import Kind, ParameterError, parameters, tables
from interchange.parameter import settings as settings_of

every_brdf = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())


@st.composite
def directions(draw):
    """A unit vector in the upper hemisphere, not below 3 degrees of elevation."""
    cos = draw(st.floats(0.05, 1.0))
    phi = draw(st.floats(0.0, 2 * np.pi))
    sin = np.sqrt(1 - cos * cos)
    return np.array([sin * np.cos(phi), sin * np.sin(phi), cos])


@st.composite
def brdfs(draw, model):
    """A model with parameters drawn from their declared bounds (exponents up to 200), edges included, or as the
    model itself draws them."""
    if model.drawn.__func__ is not Brdf.drawn.__func__:
        return model.drawn(np.random.default_rng(draw(st.integers(0, 1 << 32))), draw(st.integers(1, 3)))
    lobes = draw(st.integers(0, 3))
    values = {}
    for name, about in parameters(model).items():
        number = st.floats(about.low, min(about.high, 200.0))
        count = (lobes if about.per_lobe else 1) * about.kind.width
        drawn = np.array(draw(st.lists(number, min_size=count, max_size=count)))
        width = () if about.kind is Kind.FLOAT else (about.kind.width,)
        values[name] = drawn.reshape((lobes, *width) if about.per_lobe else width)
    return model(**values)


@every_brdf
@given(data=st.data(), wi=directions(), wo=directions())
@settings(max_examples=50, deadline=None)
def test_is_reciprocal_where_it_says_so(model, data, wi, wo):
    brdf = data.draw(brdfs(model))
    if model.reciprocal:
        assert brdf.evaluate(wi, wo) == pytest.approx(brdf.evaluate(wo, wi), rel=1e-6, abs=1e-12)


@every_brdf
@given(data=st.data(), wi=directions(), wo=directions())
@settings(max_examples=50, deadline=None)
def test_is_never_negative_and_finite(model, data, wi, wo):
    value = data.draw(brdfs(model)).evaluate(wi, wo)
    assert (value >= 0).all()
    assert np.isfinite(value).all()


def albedo(brdf, theta, n=400):
    """Directional albedo by the midpoint rule over the cosine-weighted hemisphere."""
    wo = np.array([np.sin(theta), 0, np.cos(theta)])
    u, v = (np.indices((n, n)) + 0.5) / n
    r, phi = np.sqrt(u), 2 * np.pi * v
    wi = np.stack([r * np.cos(phi), r * np.sin(phi), np.sqrt(1 - u)], axis=-1)
    return np.pi * brdf.evaluate(wi, wo).mean(axis=(0, 1))


@every_brdf
@pytest.mark.parametrize("degrees", [0, 30, 60, 80])
def test_reflects_no_more_light_than_it_receives(model, degrees):
    if model.conserves_energy:
        assert (albedo(model(), np.radians(degrees)) <= 1 + 1e-3).all()


@every_brdf
def test_an_unequal_treatment_of_azimuth_is_declared(model):
    """A model that calls itself isotropic does not change when both directions turn about the normal."""
    if not model.isotropic:
        return
    wi, wo = np.array([0.6, 0.0, 0.8]), np.array([-0.3, 0.4, np.sqrt(0.75)])
    c, s = np.cos(1.0), np.sin(1.0)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    assert model().evaluate(turn @ wi, turn @ wo) == pytest.approx(model().evaluate(wi, wo), rel=1e-9)


@every_brdf
def test_names_its_source_and_its_parameters(model):
    assert model.source
    assert parameters(model) or tables(model)
    slots = model().slots()
    assert sorted(i for slot in slots.values() for i in slot) == list(range(len(model().flat())))


@every_brdf
def test_other_numbers_make_the_same_model(model):
    brdf = model.drawn(np.random.default_rng(3), 2)
    assert brdf.with_flat(brdf.flat()) == brdf


def test_lambert_reflects_its_albedo():
    assert albedo(Lambert(0.5), 0.7) == pytest.approx([0.5] * 3, rel=1e-6)


def test_lafortune_mirror_lobe_has_the_albedo_of_lewis():
    """At normal incidence the lobe w cos^n reflects w 2 pi / (n + 2) (Lewis 1994)."""
    brdf = Lafortune(diffuse=0, weight=[1.0], C=[(-1, -1, 1)], n=[20])
    assert albedo(brdf, 0.0) == pytest.approx([2 * np.pi / 22] * 3, rel=1e-3)


def test_phong_renders_phongs_amount_of_light():
    """f cos is rho cos / pi + k cos^n of the angle to the mirror direction, here 20 degrees off it."""
    theta, off = np.radians(30), np.radians(20)
    wi = np.array([np.sin(theta), 0, np.cos(theta)])
    wo = np.array([-np.sin(theta + off), 0, np.cos(theta + off)])
    f = Phong(diffuse=0.3, specular=0.2, n=10).evaluate(wi, wo)[0]
    assert f * wi[2] == pytest.approx(0.3 / np.pi * wi[2] + 0.2 * np.cos(off) ** 10)


def test_blinn_phong_uses_half_the_angle():
    theta, off = np.radians(30), np.radians(20)
    wi = np.array([np.sin(theta), 0, np.cos(theta)])
    wo = np.array([-np.sin(theta + off), 0, np.cos(theta + off)])
    f = BlinnPhong(diffuse=0.0, specular=0.2, n=10).evaluate(wi, wo)[0]
    assert f * wi[2] == pytest.approx(0.2 * np.cos(off / 2) ** 10)


def test_usd_preview_surface_head_on_is_the_closed_form():
    """Along the normal D = 1 / (pi a²), G = 1 and F = ((1 - ior) / (1 + ior))² = 0.04, so f is explicit."""
    normal = np.array([0, 0, 1.0])
    f = UsdPreviewSurface(diffuseColor=0.5, roughness=0.5).evaluate(normal, normal)[0]
    assert f == pytest.approx(0.5 / np.pi * 0.96 + 0.04 / (np.pi * 0.25**2) / 4)


def test_usd_preview_surface_metal_has_no_diffuse_part():
    grazing = np.array([np.sin(1.4), 0, np.cos(1.4)])
    side = np.array([0, np.sin(1.4), np.cos(1.4)])
    metal = UsdPreviewSurface(diffuseColor=(1, 0.5, 0.25), metallic=1, roughness=0.05)
    assert metal.evaluate(grazing, side) == pytest.approx([0, 0, 0], abs=1e-3)


def test_parameters_out_of_bounds_are_all_named_with_unit_and_bounds():
    with pytest.raises(ParameterError) as error:
        Lafortune(diffuse=1.2, weight=[1], C=[(0, 0, 1)], n=[-3])
    assert "Lafortune.diffuse (ρ_d, diffuse albedo) must lie in [0, 1]; got 1.2." in str(error.value)
    assert "Lafortune.n (n, lobe exponent) must lie in [0.01, 20000]; got -3." in str(error.value)


def test_lobes_of_unequal_number_are_refused():
    with pytest.raises(ParameterError, match="as many entries in every lobe parameter"):
        Lafortune(weight=[1, 2], C=[(0, 0, 1)], n=[3, 4])


def test_not_a_number_is_outside_every_bound():
    with pytest.raises(ParameterError, match="must lie in"):
        Lambert(float("nan"))


def test_catalogue_is_found_by_folder():
    assert {"Lambert", "Phong", "BlinnPhong", "Lafortune", "UsdPreviewSurface"} <= set(BY_NAME)


def test_a_bound_that_a_file_rounded_to_single_precision_is_still_inside():
    assert Phong(n=float(np.float32(0.01))).n < 0.01


@every_brdf
def test_every_field_is_declared(model):
    declared = {**parameters(model), **settings_of(model), **tables(model)}
    assert {f.name for f in fields(model)} - {"parts"} == set(declared)


def test_a_sum_is_the_sum_and_is_bound_by_its_parts():
    wi, wo = np.array([0.6, 0.0, 0.8]), np.array([-0.3, 0.4, np.sqrt(0.75)])
    phong, lafortune = Phong(0.2, 0.3, 10), Lafortune(0.1, weight=[1.0], C=[(-1, -1, 1)], n=[5])
    inner = Sum(weight=[(1, 2, 3)], parts=(phong,))
    both = Sum(weight=[(0.25, 0.25, 0.25), (0.5, 0.6, 0.7)], parts=(lafortune, inner))
    expected = 0.25 * lafortune.evaluate(wi, wo) + np.array([0.5, 1.2, 2.1]) * phong.evaluate(wi, wo)
    assert both.evaluate(wi, wo) == pytest.approx(expected, rel=1e-12)
    assert "part1_part0_n" in both.slots()
    with pytest.raises(ParameterError, match="as many weights as parts"):
        Sum(weight=[1.0], parts=())

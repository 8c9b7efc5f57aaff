"""What other programs are shown in place of a BRDF that they do not know."""

import numpy as np
import pytest

from interchange.brdf import MODELS
from interchange.brdf.ggx import Ggx
from interchange.brdf.lambert import Lambert
from interchange.brdf.phong_lewis import PhongLewis
from interchange.brdf.usd_preview_surface import UsdPreviewSurface
from interchange.formats.usd_preview import preview_of


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.6])
def test_a_preview_surface_previews_as_itself(roughness):
    metal = UsdPreviewSurface(diffuseColor=(0.9, 0.7, 0.4), metallic=1.0, roughness=roughness)
    shown = preview_of(metal)
    assert shown.metallic == 1.0
    assert shown.roughness == pytest.approx(roughness, rel=0.05)
    assert shown.diffuseColor == pytest.approx(metal.diffuseColor, abs=0.05)
    plastic = UsdPreviewSurface(diffuseColor=(0.5, 0.2, 0.1), roughness=roughness)
    shown = preview_of(plastic)
    assert shown.metallic == 0.0
    assert shown.diffuseColor == pytest.approx(plastic.diffuseColor, abs=0.05)
    assert shown.roughness == pytest.approx(roughness, rel=0.1)
    assert 1.3 < shown.ior < 1.7


def test_matte_stays_matte():
    shown = preview_of(Lambert((0.2, 0.4, 0.6)))
    assert shown.diffuseColor == pytest.approx((0.2, 0.4, 0.6), abs=1e-3)
    assert shown.roughness == 1.0


def test_brushed_metal_is_a_metal_of_middle_width():
    shown = preview_of(Ggx(diffuse=0.0, alpha_x=0.1, alpha_y=0.3, eta=1.2, k=7.0))
    assert shown.metallic == 1.0
    assert np.sqrt(0.1) < shown.roughness < np.sqrt(0.3)


def test_a_mirror_lobe_has_the_half_width_of_its_cosine():
    """Seen along the light at t off the normal, Phong's lobe is cos(2 t)^n."""
    shown = preview_of(PhongLewis(diffuse=0.1, specular=0.5, n=200))
    half = np.tan(np.arccos(0.5 ** (1 / 200)) / 2)
    assert shown.roughness**2 == pytest.approx(half / np.sqrt(np.sqrt(2) - 1), rel=0.01)


def test_every_model_has_one():
    for model in MODELS.values():
        assert isinstance(preview_of(model()), UsdPreviewSurface)

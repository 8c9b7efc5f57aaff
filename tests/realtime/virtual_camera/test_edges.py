"""Edges are where they are, whichever way the rasteriser lights them: what is measured on live frames rests on it."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.brdf.lafortune import Lafortune
from interchange.material import Material


@pytest.mark.parametrize("brdf", ["alike", "other"])
def test_pixels_between_two_bodies_are_lit_by_both(rasterizer, bench, live, brdf):
    """Lit once a pixel where it is smooth, and sample by sample everywhere: the same picture of a white square on a
    dark ground, whether their materials share a formula or not."""
    ground, part = bench.bodies
    if brdf == "other":
        ground = replace(
            ground,
            material=Material("gloss", Lafortune((0.05,) * 3, ((0.01,) * 3,), ((-1, -1, 0.5),), (3.0,))),
        )
    scene = replace(bench, bodies=(ground, replace(part, world_from_body=live.at(0.0013, 0.0007))))
    once, each = (
        rasterizer.render(scene, scene.cameras[0], samples=4, shading=way).pixels
        for way in ("pixel", "sample")
    )
    mixed = (each > 1.5 * each.min()) & (each < 0.9 * each.max())
    assert mixed.any()
    np.testing.assert_allclose(once, each, rtol=1e-5)

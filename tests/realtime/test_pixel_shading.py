"""Pixels lit once (shading="pixel"), and how the samples of material groups are told apart."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.brdf.lobes import is_isotropic
from interchange.brdf.phong import Phong
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene
from realtime import lighting, stencil
from realtime.renderers.rasterizer import Rasterizer

BRUSHED = Lafortune(0.2, weight=((0.5, 0.2, 0.1),), C=((-1.0, -0.8, 0.9),), n=(12,))


@pytest.fixture
def scene(make):
    bodies = (
        Body("/ball", make.ball(), Material("brushed", BRUSHED), make.at(-0.6, 0, 0)),
        Body("/other", make.ball(), Material("phong", Phong()), make.at(1.2, 0.9, 0)),
        Body("/floor", make.plane(6, 6), Material("matte", Lambert()), make.at(0, 0, -1)),
        Body("/veil", make.plane(1, 1), Material("veil", Lambert(), opacity=0.5), make.at(0.5, -1, 0.8)),
    )
    lamp = Light("/lamp", LightKind.SPHERE, (4.0, 3.0, 2.0), make.at(1, -2, 3), casts_shadows=False)
    return Scene(bodies, (lamp, replace(lamp, name="/low", world_from_light=make.at(-3, -1, 2))))


@pytest.mark.parametrize("lens", ["pinhole", "telecentric"])
def test_pixels_lit_once_equal_the_mean_of_their_samples(rasterizer, make, scene, lens):
    """Without shadows what is left is of second order within a pixel, silhouettes included: 1e-3 of the brightest,
    but for the few pixels in which a facet's own horizon runs (at most one in 200)."""
    if lens == "pinhole":
        camera = make.pinhole((2.5, -3, 2), (0, 0, 0), (160, 120), 0.9)
    else:
        camera = make.telecentric((2.5, -3, 2), (0, 0, 0), 3e-2, (160, 120))
    for samples in (4, 8):
        each = rasterizer.render(scene, camera, samples=samples).pixels
        once = rasterizer.render(scene, camera, samples=samples, shading="pixel").pixels
        off = np.abs(once - each).max(axis=-1) / each.max()
        assert (off > 1e-3).mean() < 1 / 200
        assert (off > 0).mean() > 0.2  # another way to the same
        # where a single sample stands for the pixel, silhouettes are far off
        hard = rasterizer.render(scene, camera, samples=1).pixels
        assert (np.abs(hard - each).max(axis=-1) / each.max() > 1e-3).mean() > 1 / 50


def cube(side):
    corners, normals = [], []
    for axis, sign in ((a, s) for a in range(3) for s in (-1.0, 1.0)):
        normal, across = sign * np.eye(3)[axis], np.eye(3)[(axis + 1) % 3]
        up = np.cross(normal, across)
        corners += [
            (normal + i * across + j * up) * side / 2 for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        normals += [normal] * 4
    faces = (4 * np.arange(6)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return Mesh(np.array(corners), faces.astype(np.int32), np.array(normals))


@pytest.mark.parametrize("formulas", ["alike", "other"])
@pytest.mark.parametrize("casts_shadows", [False, True])
def test_no_pixel_is_dark_between_solids(rasterizer, make, formulas, casts_shadows):
    """Three cubes, each before the next, under one distant lamp: whatever a pixel shows of them is lit, where it lies
    between two bodies too. Flat faces without shadows have the same radiance either way; a shadow's edge may be moved
    within its pixel, in at most one of 2000."""
    brdfs = [Lambert(0.3), Lambert(0.5), Phong() if formulas == "other" else Lambert(0.7)]
    bodies = tuple(
        Body(f"/cube{i}", cube(1.0), Material(f"m{i}", brdf), make.at(1.3 * i - 1.3, 0.2 * i, 0))
        for i, brdf in enumerate(brdfs)
    )
    pose = make.facing((1, -2, 3), (0, 0, 0))
    lamp = Light("/lamp", LightKind.DISTANT, (3.0, 3.0, 3.0), pose, casts_shadows=casts_shadows)
    camera = make.pinhole((2, -4, 3), (0, 0, 0), (160, 120), 0.8)
    each, once = (
        rasterizer.render(Scene(bodies, (lamp,)), camera, samples=4, shading=way).pixels[..., 0]
        for way in ("sample", "pixel")
    )
    assert (each > 0).mean() > 0.2
    off = np.abs(once - each) > 1e-3 * each.max()
    assert off.mean() < (1 / 2000 if casts_shadows else 1e-9)


@pytest.mark.parametrize("before", ["nothing", "bodies"])
def test_a_scene_without_bodies_is_dark(make, scene, before):
    """Also after an image that left bodies and their materials on the GPU."""
    camera = make.pinhole((2.5, -3, 2), (0, 0, 0), (32, 24), 0.9)
    with Rasterizer() as renderer:
        if before == "bodies":
            assert renderer.render(scene, camera, samples=4, shading="pixel").pixels.any()
        for samples in (4, 8):
            image = renderer.render(
                Scene((), scene.lights), camera, ("object_id",), True, samples, shading="pixel"
            )
            assert not image.pixels.any()
            assert not image.passes["light:/lamp"].any()
            assert (image.passes["object_id"] == -1).all()
        again = renderer.render(scene, camera, samples=4, shading="pixel").pixels
    assert again.any()


def test_each_lamp_alone_lit_once_sums_to_the_image(rasterizer, make, scene):
    camera = make.pinhole((2.5, -3, 2), (0, 0, 0), (64, 48), 0.9)
    image = rasterizer.render(scene, camera, samples=4, shading="pixel", per_light=True)
    lamps = image.passes["light:/lamp"] + image.passes["light:/low"]
    whole = rasterizer.render(scene, camera, samples=4, shading="pixel").pixels
    np.testing.assert_allclose(lamps, whole, atol=1e-5 * whole.max())


def test_no_tile_is_left_out_that_shows_a_group(rasterizer, make, scene, monkeypatch):
    """Drawing every tile for every group gives the same image; its sides are no multiples of a tile's."""
    camera = make.pinhole((2.5, -3, 2), (0, 0, 0), (163, 121), 0.9)
    image = rasterizer.render(scene, camera, samples=4, shading="pixel").pixels
    every = 2**32 - 1
    monkeypatch.setattr(lighting, "tile_bits", lambda depth: (every, every))
    np.testing.assert_array_equal(image, rasterizer.render(scene, camera, samples=4, shading="pixel").pixels)
    monkeypatch.setattr(lighting, "tile_bits", lambda depth: (0, 0))
    assert rasterizer.render(scene, camera, samples=4, shading="pixel").pixels.max() == 0


def test_shading_has_a_known_name(rasterizer, make, scene):
    with pytest.raises(BrightfieldError, match='"sample" or "pixel"; got "vertex"'):
        rasterizer.render(scene, make.pinhole((2.5, -3, 2), (0, 0, 0)), shading="vertex")


@pytest.mark.parametrize("samples", [1, 4])
def test_more_groups_than_a_stencil_tells_apart(make, scene, monkeypatch, samples):
    camera = make.pinhole((2.5, -3, 2), (0, 0, 0), (64, 48), 0.9)
    with Rasterizer() as renderer:
        by_stencil = renderer.render(scene, camera, samples=samples).pixels
        monkeypatch.setattr(stencil, "MOST_GROUPS", 1)
        by_depth = renderer.render(scene, camera, samples=samples).pixels
    assert by_stencil.max() > 0
    np.testing.assert_array_equal(by_depth, by_stencil)


def test_isotropy_is_found_for_the_parameters_at_hand():
    assert not is_isotropic(BRUSHED)
    assert is_isotropic(replace(BRUSHED, C=((-1.0, -1.0, 0.9),)))
    assert is_isotropic(Lambert())


def test_nothing_is_left_over_from_earlier_images(rasterizer, make):
    """The samples' buffer is cleared every 15 images only; what moved away is gone in each of 17 all the same."""
    glow = Material("glow", Lambert(0.0), emission=(1.0, 1.0, 1.0))
    mesh = make.ball(16, 0.2)
    camera = make.pinhole((0, 0, 3), (0, 0, 0), (48, 36))

    def scene(k):
        return Scene((Body("/ball", mesh, glow, make.at(0.05 * k - 0.4, 0, 0)),))

    images = [rasterizer.render(scene(k), camera, samples=4, shading="pixel").pixels for k in range(17)]
    with Rasterizer() as fresh:
        for k in (0, 1, 13, 14, 15, 16):
            alone = fresh.render(scene(k), camera, samples=4, shading="pixel").pixels
            np.testing.assert_array_equal(images[k], alone)
            assert 0 < np.count_nonzero(alone[..., 0]) < 150

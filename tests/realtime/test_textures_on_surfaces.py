"""Textures on surfaces are interchange.material.evaluate_texture at the point that the pixel shows."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from interchange.brdf.lambert import Lambert
from interchange.brdf.phong import Phong
from interchange.light import Light, LightKind
from interchange.material import Material, Texture, Wrap, evaluate_texture
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene

RNG = np.random.default_rng(7)
TRANSFORM = np.array([[2.1, -0.6, 0.3], [0.5, 1.7, -0.4], [0, 0, 1]])
SUN = Light("/sun", LightKind.DISTANT, (np.pi, np.pi, np.pi))


PIXEL = 0.0101  # m
GRID = 1 / 256  # px: GPUs lay vertices on this grid of the window before they interpolate between them


def near(pixels, value, uv, rtol=0.0):
    """Whether ``pixels`` are ``value`` of coordinates within a step of GRID, and of float32 ones times 7 texels."""
    steps = [np.array([i, j]) * GRID * PIXEL for i in (-1, 0, 1) for j in (-1, 0, 1)]
    exact = value(uv)
    slack = np.max([np.abs(value(uv + step) - exact) for step in steps], axis=0)
    return (np.abs(pixels - exact) <= slack + 3e-5 + rtol * exact).all()


def seen(rasterizer, make, material, lights=(), camera=None):
    """Pixels, and the texture coordinates (W3 of the plane, from the position pass)."""
    camera = camera or make.telecentric((0, 0, 1), (0, 0, 0), PIXEL, (96, 96))
    scene = Scene((Body("/p", make.plane(), material),), lights)
    image = rasterizer.render(scene, camera, ["position"], samples=1)
    uv = image.passes["position"][..., :2].astype(float) + 0.5
    return image.pixels, uv


@pytest.mark.parametrize("wrap", list(Wrap))
@pytest.mark.parametrize("channels", [1, 3])
def test_emission(rasterizer, make, wrap, channels):
    texture = Texture(
        RNG.uniform(0, 1, (5, 7, channels)).astype(np.float32), (wrap, Wrap.MIRROR), uv_from_st=TRANSFORM
    )
    pixels, uv = seen(rasterizer, make, Material("m", Lambert(0.0), emission_map=texture))
    assert near(pixels, partial(evaluate_texture, texture), uv)


@pytest.mark.parametrize("channels", [1, 3])
def test_map_of_a_parameter(rasterizer, make, channels):
    texture = Texture(RNG.uniform(0, 1, (6, 6, channels)).astype(np.float32), uv_from_st=TRANSFORM)
    pixels, uv = seen(rasterizer, make, Material("m", Lambert(0.0), {"diffuse": texture}), (SUN,))
    assert near(pixels, partial(evaluate_texture, texture), uv)


def test_map_of_an_exponent(rasterizer, make):
    texture = Texture(RNG.uniform(1, 30, (6, 6, 1)).astype(np.float32))
    brdf = Phong(0.0, specular=1.0, n=1.0)
    camera = make.telecentric((0.5, 0, 1), (0, 0, 0), PIXEL, (96, 96))
    pixels, uv = seen(rasterizer, make, Material("m", brdf, {"n": texture}), (SUN,), camera)
    hit = np.isfinite(uv[..., 0])

    def expected(uv):
        return np.pi * (1 / np.sqrt(1.25)) ** evaluate_texture(texture, uv)

    assert near(pixels[hit], expected, uv[hit], rtol=1e-4)


def test_texture_under_a_distorting_lens(rasterizer, make):
    """The coordinates are those of the pixel's own ray, within 0.05 px."""
    texture = Texture(RNG.uniform(0, 1, (16, 16, 1)).astype(np.float32))
    camera = make.pinhole(
        (0.3, -0.2, 1), (0, 0, 0), (96, 72), 0.7, distortion=(-0.3, 0.1, 0.002, -0.001, 0, 0, 0, 0)
    )
    pixels, uv = seen(rasterizer, make, Material("m", Lambert(0.0), emission_map=texture), (), camera)
    hit = np.isfinite(uv[..., 0])
    assert hit.mean() > 0.5
    exact = np.where(hit, evaluate_texture(texture, np.nan_to_num(uv))[..., 0], np.nan)
    step = np.abs(np.diff(exact, axis=0))[:, :-1] + np.abs(np.diff(exact, axis=1))[:-1]  # of a pixel, at most
    error = np.abs(pixels[..., 0] - exact)[:-1, :-1]
    inside = np.isfinite(step)
    # the texture's slope steps at its own texels: a pixel's step next to one tells less than the slope beyond it
    assert np.quantile((error - 0.05 * step)[inside], 0.99) < 1e-4


def test_normal_map(rasterizer, make):
    """A constant tilt: the shaded normal is tangent, bitangent and normal in its proportions; mirrored u too."""
    tilt = np.array([0.3, 0.2, np.sqrt(1 - 0.13)])
    pixels = np.broadcast_to(tilt, (2, 2, 3)).astype(np.float32)
    material = Material("m", Lambert(1.0), normal_map=Texture(pixels))
    mesh = make.plane()
    mirrored = type(mesh)(mesh.vertices, mesh.faces, mesh.normals, mesh.uv * [-1, 1])
    camera = make.telecentric((0, 0, 1), (0, 0, 0), 0.01, (8, 8))
    for surface, expected in ((mesh, tilt), (mirrored, tilt * [-1, 1, 1])):
        image = rasterizer.render(
            Scene((Body("/p", surface, material),), (SUN,)), camera, ["normal"], samples=1
        )
        assert np.allclose(image.passes["normal"], expected, atol=1e-5)
        assert np.allclose(image.pixels, tilt[2], atol=1e-5)


def test_opacity_is_a_share_and_a_cut_out(rasterizer, make):
    """A veil over an emitter: the mean is the share; above the threshold all of it, below nothing. Its shadow too."""
    glow = Body(
        "/glow", make.plane(), Material("glow", Lambert(0.0), emission=(1.0, 1.0, 1.0)), make.at(0, 0, -1)
    )
    camera = make.telecentric((0, 0, 1), (0, 0, 0), 0.01, (16, 16))
    for opacity, threshold, expected in ((0.3, 0.0, 0.7), (0.3, 0.5, 1.0), (0.6, 0.5, 0.0)):
        material = Material("veil", Lambert(0.0), opacity=opacity, opacity_threshold=threshold)
        scene = Scene((glow, Body("/veil", make.plane(), material)))
        image = rasterizer.render(scene, camera, ["object_id"], samples=64)
        assert np.allclose(image.pixels, expected, atol=0.07)  # four times 16 samples, spread evenly
        assert abs(image.pixels.mean() - expected) < 2e-3
        assert (image.passes["object_id"] == (1 if opacity > 0.5 else 0)).all()
        floor = Body("/floor", make.plane(), Material("floor", Lambert(1.0)), make.at(0, 0, -1))
        under = make.telecentric((0.6, 0, -0.9), (0, 0, -1), 0.01, (8, 8))
        lit = rasterizer.render(
            Scene((floor, Body("/veil", make.plane(), material)), (SUN,)), under, samples=64
        )
        assert abs(lit.pixels.mean() - expected) < 0.01


@pytest.mark.parametrize("opacity", [0.3, 0.6])
def test_both_sides_of_a_hollow_body_let_their_share_through(rasterizer, make, opacity):
    """A hollow black ball before an emitter, and its shadow: (1 - opacity)^2; 256 pixels of 64 samples, shadows of
    64 times as many texels."""
    ball = Body("/ball", make.ball(), Material("veil", Lambert(0.0), opacity=opacity))
    glow = Material("glow", Lambert(0.0), emission=(1.0, 1.0, 1.0))
    camera = make.telecentric((0, 0, 3), (0, 0, 0), 0.01, (16, 16))
    through = rasterizer.render(
        Scene((ball, Body("/glow", make.plane(), glow, make.at(0, 0, -2)))), camera, samples=64
    )
    assert through.pixels.mean() == pytest.approx((1 - opacity) ** 2, abs=0.01)
    floor = Body("/floor", make.plane(), Material("floor", Lambert(1.0)), make.at(0, 0, -2))
    under = make.telecentric((0.6, 0, -1.5), (0, 0, -2), 0.01, (8, 8))
    lit = rasterizer.render(Scene((floor, ball), (SUN,)), under, samples=64)
    assert lit.pixels.mean() == pytest.approx((1 - opacity) ** 2, abs=0.02)


@pytest.mark.parametrize("threshold", [0.0, 0.5])
def test_what_a_veil_leaves_is_lit_as_an_opaque_surface(rasterizer, make, threshold):
    """Which neighbours are holes must not matter to the slopes of the depth, by which a facet is in shadow or not."""
    texture = Texture(RNG.uniform(0, 1, (100, 100, 1)).astype(np.float32))
    veil = Material("veil", Lambert(1.0), opacity_map=texture, opacity_threshold=threshold)
    camera = make.pinhole((0.6, -0.8, 1.2), (0, 0, 0), fov=0.5)
    sun = replace(SUN, world_from_light=make.facing((1.0, 0.5, 1.0), (0, 0, 0)))
    floor = Body("/floor", make.plane(4, 4), Material("black", Lambert(0.0)), make.at(0, 0, -0.3))
    pixels, opaque = (
        rasterizer.render(
            Scene((Body("/p", make.plane(2, 2), material), floor), (sun,)), camera, samples=1
        ).pixels
        for material in (veil, Material("opaque", Lambert(1.0)))
    )
    seen = pixels[..., 0] > 0
    assert abs(seen.mean() - 0.5) < 0.05
    assert np.allclose(pixels[seen], opaque[seen], rtol=1e-5)


def test_a_texture_that_does_not_fit_is_an_error(rasterizer, make):
    texture = Texture(np.ones((2, 2, 3), np.float32))
    camera = make.telecentric((0, 0, 1), (0, 0, 0))
    for name in ("n", "nonsense"):
        with pytest.raises(BrightfieldError, match=name):
            rasterizer.render(
                Scene((Body("/p", make.plane(), Material("m", Phong(), {name: texture})),)), camera
            )

"""Lamps that the camera sees itself: their radiance, over their own outline, hidden by what stands before them."""

import numpy as np
import pytest

from interchange.brdf.lambert import Lambert
from interchange.light import Light, LightKind, latlong_uv
from interchange.material import Material, Texture, Wrap, evaluate_texture
from interchange.scene import Body, Scene

POWER = (1.0, 2.0, 3.0)


@pytest.mark.parametrize("telecentric", [False, True])
@pytest.mark.parametrize("kind", ["sphere", "disk", "rect", "cylinder"])
def test_outline_and_radiance(rasterizer, make, kind, telecentric):
    pose = make.facing((0, 0, 1), (0, 0, 2))
    light = {
        "sphere": Light("/l", LightKind.SPHERE, POWER, pose, radius=0.1, visible=True),
        "disk": Light("/l", LightKind.DISK, POWER, pose, radius=0.1, visible=True),
        "rect": Light("/l", LightKind.RECT, POWER, pose, width=0.3, height=0.2, visible=True),
        "cylinder": Light("/l", LightKind.CYLINDER, POWER, pose, radius=0.05, length=0.3, visible=True),
    }[kind]
    pixel = 0.8 / 128
    camera = make.telecentric((0, 0, 2), (0, 0, 1), pixel, (128, 128))
    if not telecentric:
        camera = make.pinhole((0, 0, 5), (0, 0, 1), (128, 128), 2 * np.arctan(0.1))
    image = rasterizer.render(Scene((), (light,)), camera, ["object_id"], samples=16)
    area = light.projected_area
    assert np.allclose(image.pixels[64, 64], light.radiance, rtol=1e-5)
    near = 1 - 0.1 / 4 if kind == "sphere" else 1 - 0.05 / 4 if kind == "cylinder" else 1.0
    seen = image.pixels.sum(axis=(0, 1)) / light.radiance * pixel**2
    assert np.allclose(seen, area, rtol=0.01 if telecentric else 0.01 + 2 * (1 - near))
    assert (image.passes["object_id"] == -1).all()  # passes tell of bodies


def test_lamps_are_hidden_by_bodies_and_shine_to_one_side(rasterizer, make):
    screen = Body("/screen", make.plane(0.5, 2), Material("black", Lambert(0.0)), make.at(-0.25, 0, 1.5))
    camera = make.telecentric((0, 0, 2), (0, 0, 1), 0.01, (64, 64))
    up = Light(
        "/l", LightKind.RECT, POWER, make.facing((0, 0, 1), (0, 0, 2)), width=0.4, height=0.4, visible=True
    )
    image = rasterizer.render(Scene((screen,), (up,)), camera, samples=4).pixels
    assert (image[:, :32] == 0).all()
    assert np.allclose(image[32, 34:50], up.radiance)
    down = Light("/l", LightKind.RECT, POWER, make.at(0, 0, 1), width=0.4, height=0.4, visible=True)
    assert (rasterizer.render(Scene((screen,), (down,)), camera, samples=4).pixels == 0).all()


def test_dome_behind_everything(rasterizer, make):
    texture = Texture(
        np.random.default_rng(2).uniform(0, 1, (16, 32, 3)).astype(np.float32), (Wrap.REPEAT, Wrap.CLAMP)
    )
    pose = make.facing((1, 2, 3), (0, 0, 0))
    light = Light("/sky", LightKind.DOME, POWER, pose, texture=texture, visible=True)
    camera = make.pinhole((0, 0, 0), (1, 0.3, 0.2), (64, 48), 1.2)
    image = rasterizer.render(Scene((), (light,)), camera, samples=1)
    column, row = np.meshgrid(np.arange(64), np.arange(48))
    _, rays = camera.rays(np.stack([column, row], -1).astype(float))
    expected = evaluate_texture(texture, latlong_uv(rays @ pose[:3, :3])) * POWER
    assert np.allclose(image.pixels, expected, atol=1e-3)

"""What is uploaded, and when; what is freed; and scenes at the edge of what there can be."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import psutil
import pytest

from interchange.brdf.lambert import Lambert
from interchange.brdf.phong import Phong
from interchange.camera import Camera
from interchange.image import Quantity
from interchange.light import Light, LightKind
from interchange.material import Material, Texture
from interchange.mesh import Mesh
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene
from realtime.renderers.rasterizer import GIVES, Rasterizer


def simple(make):
    bodies = (
        Body("/floor", make.plane(), Material("matte", Lambert())),
        Body(
            "/ball", make.ball(), Material("gloss", Phong()), make.at(0, 0, 0.2) @ np.diag([0.2, 0.2, 0.2, 1])
        ),
    )
    lamp = Light("/lamp", LightKind.SPHERE, (1.0, 1.0, 1.0), make.at(0.3, 0.2, 1))
    return Scene(bodies, (lamp,))


def test_only_what_changed_is_uploaded(make):
    scene = simple(make)
    cameras = [make.pinhole((0, -1.2, h), (0, 0, 0.1), (48, 36), 0.9) for h in (0.9, 0.91)]
    with Rasterizer() as renderer:

        def cost(scene, camera=cameras[0]):
            before = renderer.uploads.copy()
            image = renderer.render(scene, camera, samples=1)
            return image, {k: n for k, n in (renderer.uploads - before).items() if n}

        first, all_of_it = cost(scene)
        assert all_of_it == {"mesh": 2, "materials": 1, "transforms": 2, "shadow map": 1}
        assert cost(scene)[1] == {}
        assert cost(replace(scene, time=3.0))[1] == {}
        assert cost(scene, cameras[1])[1] == {}
        dimmed = replace(scene, lights=(replace(scene.lights[0], intensity=(0.5, 0.5, 0.5)),))
        image, changed = cost(dimmed)
        assert changed == {}
        assert np.allclose(image.pixels, first.pixels / 2, rtol=1e-6)
        moved_lamp = replace(scene, lights=(replace(scene.lights[0], world_from_light=make.at(0, 0.2, 1)),))
        assert cost(moved_lamp)[1] == {"shadow map": 1}
        ball = replace(scene.bodies[1], world_from_body=make.at(0.1, 0, 0) @ scene.bodies[1].world_from_body)
        image, changed = cost(replace(scene, bodies=(scene.bodies[0], ball)))
        assert changed == {"transforms": 1, "shadow map": 1}
        assert np.abs(image.pixels - first.pixels).max() > 0.01
        paint = replace(scene.bodies[0], material=Material("matte", Lambert(0.9)))
        assert cost(replace(scene, bodies=(paint, ball)))[1].keys() <= {"materials", "transforms"}
        back, _ = cost(scene)
        assert np.array_equal(back.pixels, first.pixels)


def test_instances_share_one_mesh(rasterizer, make):
    """A thousand balls of one mesh and material are one upload and one transform buffer."""
    mesh, material = make.ball(8, 0.02), Material("m")
    bodies = tuple(
        Body(f"/b{i}", mesh, material, make.at(i % 32 / 16 - 1, i // 32 / 16 - 1, 0)) for i in range(1000)
    )
    before = rasterizer.uploads.copy()
    image = rasterizer.render(
        Scene(bodies), make.pinhole((0, 0, 3), (0, 0, 0), (96, 96), 0.9), ["object_id"], samples=1
    )
    spent = rasterizer.uploads - before
    assert spent["mesh"] == 1
    assert spent["transforms"] == 1
    assert len(np.unique(image.passes["object_id"])) > 900


@pytest.mark.slow
def test_memory_is_flat(make):
    """A new mesh, material and texture every frame: after a warm-up, 300 frames leave nothing behind."""
    camera = make.pinhole((0, -1.2, 0.9), (0, 0, 0.1), (48, 36), 0.9)
    process = psutil.Process()
    with Rasterizer(shadow_resolution=256) as renderer:

        def frames(count):
            for i in range(count):
                texture = Texture(np.full((64, 64, 3), 0.1 + 0.001 * i, np.float32))
                scene = simple(make)
                floor = replace(scene.bodies[0], material=Material("m", Lambert(), {"diffuse": texture}))
                renderer.render(replace(scene, bodies=(floor, scene.bodies[1])), camera, samples=1)
            return process.memory_info().rss / 2**20

        before = frames(60)
        after = frames(300)
    assert after - before < 8  # MiB; a frame uploads 0.15 MiB and draws 0.25 MiB of shadow map


def test_edges_of_what_there_can_be(rasterizer, make):
    camera = make.pinhole((0, -1.2, 0.9), (0, 0, 0.1), (32, 24), 0.9)
    nothing = rasterizer.render(Scene(), camera, ["all"], samples=4)
    assert (nothing.pixels == 0).all()
    assert np.isinf(nothing.passes["depth"]).all()
    assert (nothing.passes["object_id"] == -1).all()
    dark = rasterizer.render(replace(simple(make), lights=()), camera, ["all"])
    assert (dark.pixels == 0).all()
    assert np.isfinite(dark.passes["depth"]).any()
    empty = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros((0, 3)))
    flat = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32), np.tile([0, 0, 1.0], (3, 1)))
    odd = (Body("/empty", empty, Material("a")), Body("/flat", flat, Material("b")))
    scene = simple(make)
    lamp_off = Light("/off", LightKind.SPHERE, (0.0, 0.0, 0.0))
    image = rasterizer.render(
        replace(scene, bodies=odd + scene.bodies, lights=(*scene.lights, lamp_off)), camera
    )
    assert np.array_equal(image.pixels, rasterizer.render(scene, camera).pixels)
    assert image.quantity is Quantity.RADIANCE
    assert image.pixels.dtype == np.float32
    assert image.made_by["renderer"] == "rasterizer"


def test_many_lamps_add_up(rasterizer, make):
    """150 lamps are the sum of their own images, and three of them that of three."""
    scene = simple(make)
    ring = [(np.cos(a), np.sin(a), 0.5) for a in np.linspace(0, 2 * np.pi, 150, endpoint=False)]
    lamps = tuple(
        Light(f"/l{i}", LightKind.SPHERE, (0.01, 0.02, 0.03), make.at(*p)) for i, p in enumerate(ring)
    )
    camera = make.pinhole((0, -1.2, 0.9), (0, 0, 0.1), (32, 24), 0.9)
    together = rasterizer.render(replace(scene, lights=lamps), camera, samples=1)
    apart = rasterizer.render(replace(scene, lights=lamps), camera, per_light=True, samples=1)
    single = [apart.passes[f"light:{lamp.name}"] for lamp in lamps]
    assert np.allclose(np.sum(single, axis=0), together.pixels, rtol=1e-4, atol=1e-7)
    alone = rasterizer.render(replace(scene, lights=lamps[40:41]), camera, samples=1)
    assert np.allclose(single[40], alone.pixels, rtol=1e-5, atol=1e-8)


def test_passes(rasterizer, make):
    camera = make.pinhole((0, -1.2, 0.9), (0, 0, 0.1), (32, 24), 0.9)
    scene = simple(make)
    image = rasterizer.render(scene, camera, ["all"], samples=4)
    assert set(image.passes) == {
        "depth",
        "position",
        "normal",
        "object_id",
        "material_id",
        "direct",
        "lit:/lamp",
    }
    assert np.array_equal(image.passes["direct"], image.pixels)
    assert image.passes["object_id"].dtype == np.int32
    assert "indirect" not in GIVES
    for wrong, word in ((["indirect"], "direct light only"), (["nonsense"], "nonsense")):
        with pytest.raises(BrightfieldError, match=word):
            rasterizer.render(scene, camera, wrong)
    with pytest.raises(BrightfieldError, match="sample"):
        rasterizer.render(scene, camera, samples=0)


def test_the_same_twice(make):
    scene, camera = simple(make), make.pinhole((0, -1.2, 0.9), (0, 0, 0.1), (48, 36), 0.9)
    scene = replace(
        scene,
        lights=(
            *scene.lights,
            Light("/r", LightKind.RECT, (1, 1, 1), make.at(0, 0, 1), width=0.2, height=0.1),
        ),
    )
    images = []
    for _ in range(2):
        with Rasterizer() as renderer:
            renderer.render(simple(make), Camera(), samples=1)
            images.append(renderer.render(scene, camera).pixels)
    assert np.array_equal(*images)


def test_without_opengl_there_is_one_clear_error():
    script = "from realtime.renderers.rasterizer import Rasterizer\nRasterizer()"
    missing = {**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent", "LIBGL_DRIVERS_PATH": "/nonexistent",
               "EGL_PLATFORM": "wayland", "WAYLAND_DISPLAY": "none"}  # fmt: skip
    result = subprocess.run(
        [sys.executable, "-c", script], env=missing, capture_output=True, text=True, timeout=60
    )
    last = result.stderr.strip().splitlines()[-1]
    assert "BrightfieldError" in last
    assert "apt install libegl1" in last

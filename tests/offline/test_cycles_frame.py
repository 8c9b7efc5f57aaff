"""Cameras, passes, textures, see-through surfaces, determinism, and a worker that dies."""

import os
import signal
import threading
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material, Texture, Wrap, evaluate_texture
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings

ONE = CyclesSettings(samples=1, max_bounces=0)
DISTORTION = (-0.28, 0.11, 0.0012, -0.0009, 0.02, 0.03, -0.01, 0.004)


@pytest.mark.parametrize(
    ("distortion", "fy_over_fx", "projection"),
    [
        ((0.0,) * 8, 1.0, Projection.PERSPECTIVE),
        ((0.0,) * 8, 1.01, Projection.PERSPECTIVE),
        (DISTORTION, 1.004, Projection.PERSPECTIVE),
        ((0.0,) * 8, 1.0, Projection.ORTHOGRAPHIC),
        ((0.0,) * 8, 1.02, Projection.ORTHOGRAPHIC),
    ],
)
def test_points_lie_where_opencv_projects_them(cycles, build, distortion, fy_over_fx, projection):
    pose = look_at(np.array([0.3, -0.7, 0.8]), np.array([0.05, 0.02, 0.1]))
    pitch = 1e-2 if projection is Projection.ORTHOGRAPHIC else 30e-6
    camera = Camera(
        "c", pose, Lens(focal_length=5e-3, distortion=distortion, projection=projection),
        Sensor(resolution=(160, 120), pixel_pitch=(pitch, pitch / fy_over_fx)), principal_point=(83.3, 54.2),
    )  # fmt: skip
    scene = Scene(
        (Body("/ball", build.sphere(0.3), Material("m")), Body("/plane", build.plane(2.0), Material("n")))
    )
    image = cycles.render(scene, camera, ONE, ["position", "depth", "object_id"])
    x = image.passes["position"].astype(np.float64).reshape(-1, 3)
    ok = np.isfinite(x[:, 0])
    assert ok.mean() > 0.5
    centre = np.stack(np.meshgrid(np.arange(160), np.arange(120)), axis=-1).reshape(-1, 2)
    view = camera.camera_from_world
    if projection is Projection.PERSPECTIVE:
        rotation = cv2.Rodrigues(view[:3, :3])[0]
        pixels = cv2.projectPoints(x[ok], rotation, view[:3, 3], camera.K, np.array(distortion))[0].reshape(
            -1, 2
        )
    else:
        p = x[ok] @ view[:3, :3].T + view[:3, 3]
        pixels = p[:, :2] * np.diag(camera.K)[:2] + camera.K[:2, 2]
    assert np.hypot(*(pixels - centre[ok]).T).max() < 0.02
    depth = image.passes["depth"].reshape(-1)
    assert np.allclose(depth[ok], (x[ok] @ view[:3, :3].T + view[:3, 3])[:, 2], rtol=1e-5)
    assert np.all(np.isinf(depth[~ok]))
    assert np.all(image.passes["object_id"].reshape(-1)[~ok] == -1)


def room(build) -> Scene:
    """A glossy ball on a matte ground, two lamps, one of them large."""
    gloss = Lafortune(diffuse=(0.3, 0.2, 0.1), weight=((0.6, 0.6, 0.6),), C=((-1, -1, 0.98),), n=(40,))
    return Scene(
        (
            Body("/ground", build.plane(1.0), Material("paper", Lambert((0.7, 0.6, 0.5)))),
            Body("/ball", build.sphere(0.2, 32), Material("gloss", gloss), build.at(0, 0, 0.2)),
        ),
        (
            Light("/small", LightKind.SPHERE, (1.0, 0.8, 0.6), build.at(0.6, -0.4, 0.8)),
            Light("/bar", LightKind.RECT, (0.5, 0.6, 0.7), build.at(-0.5, 0, 0.9), width=0.3, height=0.1),
        ),
    )


def test_same_seed_same_bits_and_another_seed_another_noise(cycles, build):
    camera, settings = (
        build.camera((0, -1.2, 0.8), (0, 0, 0.15)),
        CyclesSettings(samples=4, max_bounces=2, seed=7),
    )
    first = cycles.render(room(build), camera, settings, ["all"], next_scene=room(build))
    other = cycles.render(room(build), camera, replace(settings, seed=8))
    with Cycles() as fresh:
        again = fresh.render(room(build), camera, settings, ["all"], next_scene=room(build))
    assert np.array_equal(first.pixels, again.pixels)
    for name, values in first.passes.items():
        assert np.array_equal(values, again.passes[name], equal_nan=True), name
    assert not np.array_equal(first.pixels, other.pixels)


def test_image_does_not_depend_on_what_was_rendered_before(cycles, build):
    camera = build.camera((0, -1.2, 0.8), (0, 0, 0.15), size=(32, 24))
    first: dict[int, np.ndarray] = {}
    for samples in (3, 64, 3, 1, 64, 300, 3, 1):
        image = cycles.render(room(build), camera, CyclesSettings(samples=samples, max_bounces=1), ["normal"])
        assert np.array_equal(first.setdefault(samples, image.pixels), image.pixels), samples


def test_noise_target_stops_early_where_the_light_is_even(cycles, build):
    """Pixels that reach the target lack samples, and have another noise; where none can reach it all are the same."""
    camera, full = build.camera((0, -1.2, 0.8), (0, 0, 0.15)), CyclesSettings(samples=256, max_bounces=2)
    all_samples, few, never = (
        cycles.render(room(build), camera, replace(full, noise=noise)).pixels for noise in (0.0, 0.1, 1e-6)
    )
    assert few.mean() == pytest.approx(all_samples.mean(), rel=5e-3)
    assert np.mean(few != all_samples) > 0.3  # of a floor and a ball, a half of them in penumbra
    np.testing.assert_array_equal(never, all_samples)


def test_parts_add_up(cycles, build):
    """direct + indirect = image; the lamps' own images = image; indirect light is there and smaller."""
    camera, settings = build.camera((0, -1.2, 0.8), (0, 0, 0.15)), CyclesSettings(samples=64, max_bounces=3)
    image = cycles.render(room(build), camera, settings, ["direct", "indirect"])
    direct, indirect = image.passes["direct"], image.passes["indirect"]
    assert np.allclose(direct + indirect, image.pixels, atol=1e-6)
    assert 0.005 < indirect.mean() / direct.mean() < 0.5
    assert indirect.min() > -1e-6
    split = cycles.render(room(build), camera, settings, per_light=True)
    total = split.passes["light:/small"] + split.passes["light:/bar"]
    assert np.allclose(total, split.pixels, atol=1e-6)
    assert total.mean() == pytest.approx(image.pixels.mean(), rel=1e-2)
    alone = cycles.render(replace(room(build), lights=room(build).lights[:1]), camera, settings)
    assert split.passes["light:/small"].mean() == pytest.approx(alone.pixels.mean(), rel=1e-2)


def test_what_each_pixel_shows(cycles, build):
    """Ids, normals on the seen side, and lit shares: the ball's shadow, the lamp's back."""
    camera = build.camera((0, -1.2, 0.8), (0, 0, 0.15), size=(96, 72))
    image = cycles.render(room(build), camera, ONE, ["object_id", "material_id", "normal", "position", "lit"])
    ids, n, x = (image.passes[k] for k in ("object_id", "normal", "position"))
    assert image.object_names == ("/ground", "/ball")
    ball = ids == 1
    assert np.array_equal(image.passes["material_id"], ids)
    assert np.allclose(np.linalg.norm(x[ball] - [0, 0, 0.2], axis=1), 0.2, atol=2e-3)
    assert np.allclose(n[ids == 0], [0, 0, 1], atol=1e-6)
    eye = np.array([0, -1.2, 0.8])
    assert (np.einsum("ij,ij->i", n[ball], eye - x[ball]) > -0.02).all()
    lamp = np.array([0.6, -0.4, 0.8])
    ground = ids == 0
    d = lamp - x[ground]
    along = np.clip(np.einsum("ij,ij->i", [0, 0, 0.2] - x[ground], d) / np.sum(d * d, axis=1), 0, 1)
    miss = np.linalg.norm(x[ground] + along[:, None] * d - [0, 0, 0.2], axis=1)
    lit = image.passes["lit:/small"][ground]
    assert np.all(lit[miss > 0.203] == 1)
    assert np.all(lit[miss < 0.197] == 0)
    facing = np.einsum("ij,ij->i", n[ball], lamp - x[ball])
    assert np.all(image.passes["lit:/small"][ball][facing < 0] == 0)
    share = image.passes["lit:/bar"][ground]
    assert ((share > 0.05) & (share < 0.95)).sum() > 5  # a penumbra


def test_motion_follows_body_and_camera(cycles, build):
    camera = replace(build.camera((0, -1.2, 0.8), (0, 0, 0.15)), name="/cam")
    now = replace(room(build), cameras=(camera,))
    moved = replace(now.bodies[1], world_from_body=build.at(0.03, 0, 0.2))
    pose = camera.world_from_camera.copy()
    pose[0, 3] += 0.01
    then = replace(now, bodies=(now.bodies[0], moved), cameras=(replace(camera, world_from_camera=pose),))
    image = cycles.render(now, camera, ONE, ["motion", "position", "object_id"], next_scene=then)
    x, ids = image.passes["position"].astype(np.float64), image.passes["object_id"]
    for k, shift in ((0, -0.01), (1, 0.02)):  # m along the image's x, relative to the camera
        z = camera.camera_from_world[2, :3] @ x[ids == k].T + camera.camera_from_world[2, 3]
        assert np.allclose(image.passes["motion"][ids == k][:, 0], camera.K[0, 0] * shift / z, atol=1e-2)
    assert np.all(np.isnan(image.passes["motion"][ids == -1]))


@pytest.mark.parametrize("wrap", list(Wrap))
def test_texture_is_the_one_of_the_definition(cycles, build, wrap):
    rng = np.random.default_rng(2)
    st = np.array([[1.6, 0.3, -0.4], [-0.2, 1.5, 0.1], [0, 0, 1.0]])
    texture = Texture(rng.uniform(0.1, 0.9, (5, 7, 3)).astype(np.float32), (wrap, wrap), uv_from_st=st)
    height = Texture(rng.uniform(0.1, 0.9, (4, 4, 1)).astype(np.float32), (wrap, wrap))
    brdf = Lafortune(diffuse=0.1, weight=((0.1, 0.1, 0.1),), C=((-1, -1, 1),), n=(5,))
    material = Material("m", brdf, maps={"diffuse": texture, "n": height})
    mesh = build.plane(1.0, uv=True)
    light = Light("/l", LightKind.DISTANT, (np.pi, np.pi, np.pi))
    camera = build.camera((0, 0, 3), (0, 0, 0), 1.8, (64, 64), projection=Projection.ORTHOGRAPHIC)
    image = cycles.render(Scene((Body("/p", mesh, material),), (light,)), camera, ONE, ["position"])
    uv = image.passes["position"][..., :2].astype(np.float64) / 2 + 0.5
    gloss = replace(brdf, diffuse=0.0).evaluate(np.array([0, 0, 1.0]), np.array([0, 0, 1.0])) * np.pi
    expected = evaluate_texture(texture, uv) + gloss
    assert np.abs(image.pixels - expected).max() < 2e-3


def test_normal_map_and_glow_map(cycles, build):
    tilted = np.zeros((2, 2, 3), np.float32)
    tilted[...] = np.array([0.6, 0.0, 0.8])
    material = Material(
        "m",
        Lambert(1.0),
        normal_map=Texture(tilted),
        emission_map=Texture(np.full((1, 1, 3), 0.25, np.float32)),
    )
    light = Light("/l", LightKind.DISTANT, (np.pi, np.pi, np.pi))
    camera = build.camera((0, 0, 3), (0, 0, 0), 1.8, (16, 16), projection=Projection.ORTHOGRAPHIC)
    scene = Scene((Body("/p", build.plane(1.0, uv=True), material),), (light,))
    image = cycles.render(scene, camera, ONE, ["normal"])
    assert np.allclose(image.passes["normal"], [0.6, 0, 0.8], atol=1e-5)
    assert np.allclose(image.pixels, 0.8 + 0.25, rtol=1e-4)


@pytest.mark.parametrize("mapped", [False, True])
def test_see_through_surface_dims_what_is_behind_and_its_shadow(cycles, build, mapped):
    half = Texture(np.full((2, 2, 1), 0.4, np.float32)) if mapped else None
    veil = Material("veil", Lambert(0.0), opacity=1.0 if mapped else 0.4, opacity_map=half)
    ground = Body("/ground", build.plane(1.0), Material("paper", Lambert(1.0)))
    sheet = Body("/veil", build.plane(0.3, uv=True), veil, build.at(0, 0, 0.5))
    light = Light("/l", LightKind.SPHERE, (1.0, 1.0, 1.0), build.at(0, 0, 2.0))
    scene = Scene((ground, sheet), (light,))
    above = build.camera((0, 0, 1.0), (0, 0, 0), 0.01, (16, 16), projection=Projection.ORTHOGRAPHIC)
    below = build.camera((0.3, 0, 0.3), (0, 0, 0), 0.5, (16, 16))
    settings = CyclesSettings(samples=256, max_bounces=0)
    assert cycles.render(scene, below, settings).pixels.mean() == pytest.approx(0.6 / 4 / np.pi, rel=1e-3)
    assert cycles.render(scene, above, settings).pixels.mean() == pytest.approx(0.36 / 4 / np.pi, rel=2e-2)
    solid = Body("/veil", sheet.mesh, replace(veil, opacity_threshold=0.5), sheet.world_from_body)
    clear = cycles.render(replace(scene, bodies=(ground, solid)), above, ONE)
    assert clear.pixels.mean() == pytest.approx(1.0 / 4 / np.pi, rel=1e-3) if mapped else True


def test_stage_follows_edits_as_a_fresh_one_would(cycles, build):
    """Move, add, remove and recolour: the warm worker's image is the cold worker's, bit by bit."""
    camera = build.camera((0, -1.2, 0.8), (0, 0, 0.15), size=(32, 24))
    base = room(build)
    ball = base.bodies[1]
    second = replace(
        ball,
        name="/second",
        world_from_body=build.at(0.4, 0, 0.2),
        material=Material("red", Lambert((0.8, 0.1, 0.1))),
    )
    frames = [
        base,
        replace(base, bodies=(*base.bodies, second)),
        replace(base, bodies=(base.bodies[0], second)),
        replace(base, bodies=(replace(ball, world_from_body=build.at(0, 0, 0.5)),), lights=base.lights[1:]),
        base,
    ]
    settings = CyclesSettings(samples=2, max_bounces=1)
    warm = [cycles.render(frame, camera, settings, ["normal"]) for frame in frames]
    for k in (2, 3):
        with Cycles() as fresh:
            cold = fresh.render(frames[k], camera, settings, ["normal"])
        assert np.array_equal(warm[k].pixels, cold.pixels), k
        assert np.array_equal(warm[k].passes["normal"], cold.passes["normal"], equal_nan=True), k
    assert np.array_equal(warm[0].pixels, warm[-1].pixels)
    assert not np.array_equal(warm[0].pixels, warm[1].pixels)


def test_killed_worker_costs_one_try(build):
    camera, settings = build.camera((0, -1.2, 0.8), (0, 0, 0.15)), CyclesSettings(samples=4, max_bounces=1)
    with Cycles() as renderer:
        before = renderer.render(room(build), camera, settings)
        assert renderer.worker is not None
        slow = threading.Timer(0.1, os.kill, (renderer.worker.pid, signal.SIGKILL))
        slow.start()
        long = renderer.render(room(build), camera, replace(settings, samples=512))
        assert renderer.restarts == 1
        assert long.pixels.mean() == pytest.approx(before.pixels.mean(), rel=0.05)
        after = renderer.render(room(build), camera, settings)
        assert np.array_equal(after.pixels, before.pixels)  # whatever was rendered in between


def test_worker_that_fails_twice_is_one_clear_error(build):
    camera = build.camera((0, -1.2, 0.8), (0, 0, 0.15))
    began = time.monotonic()
    with (
        Cycles(timeout=1.0) as renderer,
        pytest.raises(
            BrightfieldError, match=r"failed twice on the frame at time 3: it did not answer within 1 s"
        ),
    ):
        renderer.render(replace(room(build), time=3.0), camera, CyclesSettings(samples=2**20))
    assert time.monotonic() - began < 120  # two starts of Cycles and two seconds, on a busy machine
    with (
        Cycles(memory=50 * 2**20) as renderer,
        pytest.raises(BrightfieldError, match="needed more than 50 MiB of memory"),
    ):
        renderer.render(room(build), camera, CyclesSettings(samples=2**20))


def test_glsl_material_is_refused(cycles, build):
    body = Body(
        "/b",
        build.plane(),
        Material("special", glsl="vec3 brdf(vec3 wi, vec3 wo, vec2 uv) { return vec3(0.1); }"),
    )
    with pytest.raises(BrightfieldError, match='"special" must have a BRDF of the catalogue'):
        cycles.render(Scene((body,)), build.spot(), ONE)


def test_denoising_leaves_direct_light_alone_and_brings_the_rest_nearer_to_the_truth(cycles, build):
    camera = build.camera((0, -1.2, 0.8), (0, 0, 0.15))
    few = CyclesSettings(samples=16, max_bounces=3)
    plain, clean, hasty, true = (
        cycles.render(room(build), camera, s, ["direct", "indirect", "object_id"])
        for s in (
            few,
            replace(few, denoise=1),
            replace(few, denoise=1, direct_samples=1),
            replace(few, samples=256, seed=5),  # a quarter of the noise
        )
    )
    assert np.allclose(hasty.passes["indirect"], clean.passes["indirect"], atol=1e-6)
    assert not np.allclose(hasty.passes["direct"], clean.passes["direct"], rtol=1e-3)  # edges, by one sample
    assert np.allclose(clean.passes["direct"], plain.passes["direct"], rtol=1e-5, atol=1e-7)
    errors = [np.sqrt(np.mean((x.passes["indirect"] - true.passes["indirect"]) ** 2)) for x in (plain, clean)]
    assert errors[1] < 0.8 * errors[0]
    assert np.array_equal(
        plain.passes["object_id"], true.passes["object_id"]
    )  # true at the centre, however many samples


@pytest.mark.parametrize("kind", list(LightKind))
def test_camera_sees_the_lamp_itself(cycles, build, kind):
    """Every kind shows its radiance over its own outline; a half in front covers half of it; unseen ones stay dark."""
    down = build.at(0, 0, 1.0)
    light = Light(
        "/l",
        kind,
        (1.0, 2.0, 3.0),
        down,
        radius=0.1,
        width=0.3,
        height=0.2,
        length=0.4,
        angle=0.2,
        visible=True,
    )
    camera = build.camera((0, 0, 0.0), (0, 0, 1.0), 30, (64, 64))
    screen = Body("/screen", build.plane(1.0), Material("black", Lambert(0.0)), build.at(1.0, 0, 0.5))
    settings = CyclesSettings(samples=8, max_bounces=0)
    image = cycles.render(Scene((), (light,)), camera, settings, ["direct"])
    pixel = (2 * np.tan(np.radians(15)) / 64) ** 2  # m² at 1 m
    area = {
        LightKind.SPHERE: np.pi * 0.1**2 / (1 - 0.1**2), LightKind.DISK: np.pi * 0.1**2, LightKind.RECT: 0.06,
        LightKind.CYLINDER: 2 * 0.1 / np.sqrt(1 - 0.1**2) * 0.4 / 0.9, LightKind.DISTANT: np.pi * np.tan(0.1) ** 2,
        LightKind.DOME: 64 * 64 * pixel,
    }[kind]  # fmt: skip
    total = image.pixels.sum(axis=(0, 1)) * pixel
    # a cylinder's near edge bulges by perspective; the others are exact up to the 4 x 4 rays of a pixel
    assert total == pytest.approx(light.radiance * area, rel=0.06 if kind is LightKind.CYLINDER else 0.01)
    assert np.allclose(image.passes["direct"], image.pixels)
    half = cycles.render(Scene((screen,), (light,)), camera, settings)
    assert half.pixels.sum() == pytest.approx(image.pixels.sum() / 2, rel=0.1)
    assert cycles.render(Scene((), (replace(light, visible=False),)), camera, settings).pixels.max() == 0

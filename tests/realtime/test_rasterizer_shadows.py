"""Where shadows lie, how soft they are, and that nothing shades itself."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.brdf.lambert import Lambert
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from realtime import lamps, shadow_maps
from realtime.bodies import Bodies

WHITE = Material("white", Lambert(1.0))


def over_the_edge(make, height, light, side=2.0):
    """A floor, and above it a half-plane x < 0 at ``height``; seen from below the screen by a telecentric camera."""
    screen = Body("/screen", make.plane(side, 2 * side), WHITE, make.at(-side / 2, 0, height))
    return Scene((Body("/floor", make.plane(2 * side, 2 * side), WHITE), screen), (light,))


def profile(rasterizer, make, scene, span, samples, columns=256):
    """Lit share of the floor along x, at y = 0, by the camera's own view from a flat angle under the screen."""
    camera = make.telecentric((0, -0.05, 0.02), (0, 0, 0), span / columns, (columns, 2))
    image = rasterizer.render(scene, camera, ["position", "lit"], samples=samples)
    x = image.passes["position"][0, :, 0]
    return x, image.pixels[0, :, 0], image.passes[f"lit:{scene.lights[0].name}"][0]


@pytest.mark.parametrize("place", [(0.0, 0, 1.0), (0.5, 0.2, 1.5), (-0.6, 0, 0.9)])
def test_edge_of_a_hard_shadow(rasterizer, make, place):
    light = Light("/lamp", LightKind.SPHERE, (1.0, 1.0, 1.0), make.at(*place))
    height = 0.2
    x, _, lit = profile(rasterizer, make, over_the_edge(make, height, light), 0.4, 1)
    edge = place[0] + (0 - place[0]) * place[2] / (place[2] - height)
    inside = (x > -0.19) & (x < 0.19)
    assert inside.sum() > 200
    crossing = x[np.argmin(np.abs(lit - 0.5))]
    assert abs(crossing - edge) < 2e-3  # a pixel is 1.6 mm, a texel 3 mm; the scene is 6 m wide
    assert (lit[inside & (x < edge - 5e-3)] == 0).all()
    assert (lit[inside & (x > edge + 5e-3)] == 1).all()


def test_edge_in_parallel_light(rasterizer, make):
    light = Light("/sun", LightKind.DISTANT, (1.0, 1.0, 1.0), make.facing((0.5, 0, 1), (0, 0, 0)))
    x, _, lit = profile(rasterizer, make, over_the_edge(make, 0.1, light), 0.4, 1)
    assert abs(x[np.argmin(np.abs(lit - 0.5))] + 0.05) < 1e-3


@pytest.mark.parametrize("offset", [0.01, 0.04])
def test_a_shadow_on_points_that_stand_off_ends_sooner(rasterizer, make, offset):
    """Light falls at 0.5 to the side a metre: points raised by δ lie 0.5 δ nearer below the edge."""
    light = Light("/sun", LightKind.DISTANT, (1.0, 1.0, 1.0), make.facing((0.5, 0, 1), (0, 0, 0)))
    scene, camera = (
        over_the_edge(make, 0.1, light),
        make.telecentric((0, -0.05, 0.02), (0, 0, 0), 0.4 / 256, (256, 2)),
    )
    lit = [
        rasterizer.render(scene, camera, samples=64, shadow_offset=o).pixels[0, :, 0] for o in (0.0, offset)
    ]
    nearer = (lit[0].sum() - lit[1].sum()) / lit[0].max() * 0.4 / 256
    assert abs(abs(nearer) - 0.5 * offset) < 1e-3  # a third of a texel


@pytest.mark.parametrize(
    "kind",
    ["rect", "distant", *(pytest.param(k, marks=pytest.mark.slow) for k in ("disk", "sphere", "cylinder"))],
)
def test_penumbra(rasterizer, make, kind):
    """Behind a straight edge half-way up, the lamp comes out of the shadow by its own outline's
    area; within the discrepancy of its 256 points."""
    size, distance, height = 0.1, 1.0, 0.5
    pose = make.at(0, 0, distance)
    lamp = {
        "rect": Light("/lamp", LightKind.RECT, (1, 1, 1), pose, width=size, height=size),
        "disk": Light("/lamp", LightKind.DISK, (1, 1, 1), pose, radius=size / 2),
        "sphere": Light("/lamp", LightKind.SPHERE, (1, 1, 1), pose, radius=size / 2),
        "cylinder": Light(
            "/lamp",
            LightKind.CYLINDER,
            (1, 1, 1),
            pose @ np.diag([1.0, -1, -1, 1])[[1, 0, 2, 3]],
            radius=size / 2,
            length=size,
        ),
        "distant": Light("/lamp", LightKind.DISTANT, (1, 1, 1), angle=2 * np.arctan(size / 2 / distance)),
    }[kind]
    x, radiance, _ = profile(rasterizer, make, over_the_edge(make, height, lamp), 0.3, 256)
    width = size * height / (distance - height) if kind != "distant" else size / distance * height
    t = np.clip(x / (width / 2), -1, 1)  # how far the edge stands across the lamp, -1 to 1
    round_one = 1 - (np.arccos(t) - t * np.sqrt(1 - t * t)) / np.pi
    expected = (1 + t) / 2 if kind in ("rect", "cylinder") else round_one
    bare = over_the_edge(make, height, replace(lamp, casts_shadows=False))
    _, open_sky, _ = profile(rasterizer, make, bare, 0.3, 256)
    inside = np.abs(x) < 0.14
    assert np.abs(radiance / open_sky - expected)[inside].max() < 0.02  # 256 points: their discrepancy


def test_a_facet_does_not_shade_itself(rasterizer, make):
    """Under a lamp in every direction, what faces it and is hidden by nothing is fully lit, to the horizon of light."""
    ball = Body("/ball", make.ball(96, 0.2), WHITE, make.at(0, 0, 0.2))
    floor = Body("/floor", make.plane(3, 3), WHITE)
    for place in ((0.3, -0.2, 1.0), (1.2, 0, 0.35), (0.0, -0.4, 0.6)):
        light = Light("/lamp", LightKind.SPHERE, (1.0, 1.0, 1.0), make.at(*place))
        camera = make.pinhole((0.2, -1.0, 0.8), (0, 0, 0.1), (128, 96), 0.9)
        image = rasterizer.render(
            Scene((floor, ball), (light,)), camera, ["position", "normal", "object_id", "lit"], samples=1
        )
        p, n = image.passes["position"], image.passes["normal"]
        to = np.array(place) - p
        cosine = np.sum(to * n, -1) / np.linalg.norm(to, axis=-1)
        a = p - [0, 0, 0.2]  # the lamp's ray misses the ball, by 6 mm at least
        along = np.sum(a * to, -1) / np.sum(to * to, -1)
        miss = np.linalg.norm(a - along[..., None] * to, axis=-1) > 0.206
        on_floor = (image.passes["object_id"] == 0) & (miss | (along > 0))
        on_ball = (image.passes["object_id"] == 1) & (cosine > 0.15)
        lit = image.passes["lit:/lamp"]
        assert on_floor.sum() > 3000
        assert on_ball.sum() > 200
        assert (lit[on_floor] > 0.999).mean() > 0.997
        assert (lit[on_ball] > 0.999).mean() > 0.997
        hidden = (
            (image.passes["object_id"] == 0)
            & (np.linalg.norm(a - along[..., None] * to, axis=-1) < 0.188)
            & (along < 0)
        )
        assert (lit[hidden] == 0).mean() > 0.997  # a texel is long where light grazes
        assert (lit[(image.passes["object_id"] == 1) & (cosine < 0)] == 0).all()


def test_a_lamp_may_cast_no_shadow(rasterizer, make):
    light = Light("/lamp", LightKind.SPHERE, (1.0, 1.0, 1.0), make.at(-0.5, 0, 1), casts_shadows=False)
    _, radiance, lit = profile(rasterizer, make, over_the_edge(make, 0.2, light), 0.2, 1)
    assert (lit == 1).all()
    assert radiance.min() > 0.1


def test_a_lamp_inside_the_scene_sees_all_around(rasterizer, make):
    """In the middle of a box: every wall is lit as in the open."""
    half = make.at(0, 0, -0.5)
    turns = (
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    )
    walls = []
    for i, turn in enumerate(turns):
        pose = np.eye(4)
        pose[:3, :3] = turn
        walls.append(Body(f"/w{i}", make.plane(), WHITE, pose @ half))
    light = Light("/lamp", LightKind.SPHERE, (1.0, 1.0, 1.0), make.at(0.1, 0.05, -0.1))
    for target in (
        (0.5, 0.1, 0),
        (-0.5, 0.1, 0),
        (0, 0.5, 0.1),
        (0.1, -0.5, 0),
        (0.01, 0, 0.5),
        (0.01, 0, -0.5),
    ):
        camera = make.pinhole((0, 0, 0), target, (48, 48), 1.5)
        image = rasterizer.render(
            Scene(tuple(walls), (light,)), camera, ["position", "normal", "lit"], samples=1
        )
        assert (image.passes["lit:/lamp"] > 0.99).mean() > 0.995  # a texel of each inner corner
        to = light.world_from_light[:3, 3] - image.passes["position"]
        d = np.linalg.norm(to, axis=-1)
        expected = np.sum(to * image.passes["normal"], axis=-1) / d**3 / np.pi
        assert np.quantile(np.abs(image.pixels[..., 0] / expected - 1), 0.99) < 1e-3


@pytest.mark.parametrize("kind", [LightKind.SPHERE, LightKind.RECT, LightKind.CYLINDER, LightKind.DISTANT])
@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_the_part_of_a_map_that_casts_is_enough(rasterizer, make, monkeypatch, kind, radius):
    """Only the part of a map with what casts shadows is kept; the image is that of whole maps."""
    light = Light(
        "/lamp",
        kind,
        (1.0, 1.0, 1.0),
        make.at(0.5, 0.3, 2.0),
        radius=radius,
        width=radius,
        height=radius,
        length=radius,
    )
    screen = Body("/screen", make.plane(0.3, 0.4), WHITE, make.at(0.2, 0.1, 0.3))
    scene = Scene((Body("/floor", make.plane(4.0), WHITE), screen), (light,))
    camera = make.telecentric((0, 0, 1), (0, 0, 0), 0.03, (64, 64))
    kept = rasterizer.render(scene, camera, samples=4).pixels
    monkeypatch.setattr(shadow_maps, "cropped", lambda frustum, corners, side: frustum)
    monkeypatch.setattr(Bodies, "casting", lambda bodies, sample: np.ones(len(bodies.bodies), bool))
    whole = rasterizer.render(scene, camera, samples=4).pixels
    beyond = (
        np.abs(kept - whole).max(axis=-1) > 1e-4 * whole.max()
    )  # 1e-4 of a texel in which an edge may round
    assert beyond.mean() < 2e-3
    assert whole.min() < 0.5 * np.median(whole)  # there is a shadow


@pytest.mark.parametrize(("below", "lamp", "casts"), [(0, 1.0, False), (0, -1.0, True), (1, 1.0, True)])
def test_a_floor_casts_no_shadow_on_what_stands_on_it(rasterizer, make, below, lamp, casts):
    """Unless the lamp is on its other side, or something is below."""
    things = [Body("/thing", make.ball(16, 0.1), WHITE, make.at(0.3, 0, z)) for z in (0.1, -0.3)]
    light = Light("/lamp", LightKind.SPHERE, (1.0, 1.0, 1.0), make.at(0, 0, lamp))
    scene = Scene((Body("/floor", make.plane(2.0), WHITE), *things[: 1 + below]), (light,))
    camera = make.telecentric((0, 0, 1), (0, 0, 0), 0.03, (16, 16))
    rasterizer.render(scene, camera, samples=1)
    sample = lamps.samples(light, 0, 1, rasterizer._stages.bodies.origin)[0][0]
    assert rasterizer._stages.bodies.casting(sample).tolist() == [casts] + [True] * (1 + below)

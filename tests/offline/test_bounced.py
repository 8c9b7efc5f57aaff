"""How reflected light grows with an albedo: closed forms, and the path tracer's own difference."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.light.radiance import Rendered, render_all
from analysis.gap.renderers import renderer
from analysis.gap.terms.bounced import STEP, Blocks, _depends, _footprint, _kernel, growth
from interchange.brdf.lambert import Lambert
from interchange.camera import Projection
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from tests.offline.conftest import Build

DARKER = 0.9


def _blocks(position: list[list[float]], normal: list[list[float]], indirect: list[float]) -> Blocks:
    n = len(position)
    i = np.repeat(np.array(indirect, np.float32)[:, None], 3, axis=1)
    return Blocks(
        np.arange(n),
        np.array(position, np.float32),
        np.array(normal, np.float32),
        np.full(n, 1e-6, np.float32),
        np.arange(n),
        {"lamp": np.ones((n, 3), np.float32)},
        {"lamp": i},
    )


def test_two_that_face_each_other_give_light_to_and_fro() -> None:
    """What a has of b grows with b's albedo, and with what b has of a: s = 1 / (1 - i_a i_b) with b's, of which a's own
    is i_b; three bounces leave i_a i_b² of that."""
    two = _blocks([[0, 0, 0], [0, 0, 1]], [[0, 0, 1], [0, 0, -1]], [0.1, 0.3])
    s = _depends(_kernel(two), two, "lamp", 2)[..., 0]
    assert s[0] == pytest.approx([0.3 / (1 - 0.03), 1 / (1 - 0.03)], abs=0.3 * 0.031)
    assert s[1] == pytest.approx([1 / (1 - 0.03), 0.1 / (1 - 0.03)], abs=0.3 * 0.031)


def test_what_is_turned_away_gives_nothing_and_what_is_twice_as_far_a_quarter() -> None:
    three = _blocks(
        [[0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 1, 0]],
        [[0, 0, 1], [0, 0, -1], [0, 0, -1], [0, 0, 1]],
        [0, 0, 0, 0],
    )
    K = _kernel(three)
    assert K[0, 1] == pytest.approx(1e-6)
    assert K[0, 2] == pytest.approx(1e-6 / 4)
    assert K[0, 3] == K[0, 0] == 0
    assert _depends(K, three, "lamp", 4)[0, :, 0] == pytest.approx([0, 0.8, 0.2, 0])


@pytest.mark.parametrize("projection", [Projection.PERSPECTIVE, Projection.ORTHOGRAPHIC])
def test_pixels_cover_what_they_show(build: Build, projection: Projection) -> None:
    """All of a leaning plate of 80 x 80 mm, but for the pixels of its rim."""
    camera = build.camera((0.05, 0.0, 0.4), (0, 0, 0), 0.15 if projection is Projection.ORTHOGRAPHIC else 20.0,
                          (160, 160), projection=projection)  # fmt: skip
    grid = np.stack(np.meshgrid(np.arange(160.0), np.arange(160.0)), axis=-1).reshape(-1, 2)
    origin, direction = camera.rays(grid)
    n = np.array([0.3, 0.0, 1.0]) / np.hypot(0.3, 1)
    hit = origin - ((origin @ n) / (direction @ n))[:, None] * direction
    inside = (np.abs(hit @ np.cross([0.0, 1.0, 0.0], n)) < 0.04) & (np.abs(hit[:, 1]) < 0.04)
    own = hit[inside].astype(np.float32)
    assert _footprint(camera, own, np.broadcast_to(n, own.shape)).sum() == pytest.approx(0.08**2, rel=0.02)


def _corner(build: Build, floor: float) -> Scene:
    """A floor and two walls of a fifth of a metre under a lamp: light goes to and fro."""
    plane = build.plane(0.1)
    upright = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # its normal, z, looks along -y
    aside = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # along x
    bodies = (
        Body("/floor", plane, Material("/m/floor", Lambert((floor,) * 3))),
        Body("/back", plane, Material("/m/back", Lambert((0.6, 0.5, 0.4))), build.at(0, 0.1, 0.1, upright)),
        Body("/side", plane, Material("/m/side", Lambert((0.3, 0.3, 0.3))), build.at(-0.1, 0, 0.1, aside)),
    )
    lamp = Light("/lamp", LightKind.SPHERE, (1.0, 1.0, 1.0), build.at(0.05, -0.05, 0.25), radius=0.005)
    return Scene(bodies, (lamp,))


@pytest.mark.slow
def test_reflected_light_grows_with_a_floors_albedo_as_paths_say(build: Build, tmp_path: Path) -> None:
    """On the walls to a tenth, of both what a path tracer's difference tells and what is told: what no camera sees and
    what stands between is left out, of which there is none here. Mean over some hundred pixels of denoised paths, whose
    noise is a hundredth; curvature of 1 - DARKER adds some hundredths where light meets the floor twice."""
    camera = build.camera((0.35, -0.5, 0.4), (-0.02, 0.03, 0.05), field=32.0, size=(96, 72))
    with renderer("offline", 16) as (render, settings):
        whole, darker = (
            render_all([(_corner(build, floor), camera)], render, settings, tmp_path)[0]
            for floor in (0.7, 0.7 * DARKER)
        )
    found = growth(whole, [])
    again = growth(whole, [replace(whole, passes=dict(whole.passes))] * 3)  # what is seen twice counts once
    assert all(np.array_equal(again[key], found[key]) for key in found)
    names = whole.scene.material_names

    def light(r: Rendered) -> np.ndarray:
        return np.asarray(r.lamps["/lamp"] * r.indirect["/lamp"])

    told = found["/lamp", "/m/floor"] * STEP
    for wall in ("/m/back", "/m/side"):
        on = whole.passes["material_id"] == names.index(wall)
        before, after = (light(r)[on].sum(axis=0) for r in (whole, darker))
        by_paths = (1 - after / before) / (1 - DARKER)
        mine = (light(whole)[on] * told[on]).sum(axis=0) / before
        assert np.abs(mine - by_paths).max() < 0.1, (wall, mine, by_paths)

"""What lies beyond the frame is rendered where the image as found shows it; bench of 128 x 96 px."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.light.margin import beyond, margin_for, widened
from analysis.gap.light.radiance import Paths, Rendered, render_all
from analysis.gap.light.views import seen
from interchange.camera import Camera
from interchange.effects.object_pose import ObjectPose
from interchange.image import Image
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer

SETTINGS = {"renderer": "rasteriser", "samples": 36}
ASIDE = np.array([7.0, -4.0], np.float32)  # px that the image moves by, along columns and rows


@pytest.fixture
def render(rasterizer: Rasterizer):
    def drawn(
        scene: Scene, camera: Camera, passes: Sequence[str], per_light: bool, parts: int, paths: Paths
    ) -> Image:
        drawn.cost += int(np.prod(camera.sensor.resolution))
        return rasterizer.render(scene, camera, passes, per_light, 4)

    drawn.cost = 0
    return drawn


def test_how_far_outside_an_image_lies() -> None:
    still = np.zeros((6, 8, 2), np.float32)
    assert beyond(None) == beyond(still) == 0
    assert beyond(still + ASIDE) == 7
    assert beyond(still - ASIDE) == 7
    still[5, 3] = (0, -2.5)
    assert beyond(still) == 2.5


def test_a_width_for_it() -> None:
    camera = Camera("C", np.eye(4))
    short = min(camera.sensor.resolution)
    assert margin_for(0.9, camera) == 0
    assert 5 <= margin_for(5.0, camera) <= 8
    assert margin_for(10.0 * short, camera) <= short // 2


def test_an_image_that_moved_shows_what_a_camera_there_renders(small_bench, render, tmp_path: Path) -> None:
    """A principal point that lies elsewhere: the same image, moved. Along the rim, where the frame as rendered ends,
    within a twentieth of what repeating the rim is off by (spots of a pixel differ at edges)."""
    c = small_bench(tmp_path, {0: "Camera0", 6: "Camera0", 16: "Camera1"}, 4)[1]
    cache = tmp_path / "cache"
    cx, cy = c.camera.K[:2, 2]
    there = replace(c.camera, principal_point=(cx + float(ASIDE[0]), cy + float(ASIDE[1])))
    truth, base = render_all([(c.scene, there), (c.scene, c.camera)], render, SETTINGS, cache)
    h, w = c.mean.shape[:2]
    flow = np.broadcast_to(ASIDE, (h, w, 2)).copy()
    render.cost = 0
    wide = widened(base, margin_for(beyond(flow), c.camera), render, SETTINGS, cache)
    around = 2 * (h + w + 2 * wide.margin) * wide.margin
    assert render.cost == 9 * around  # pixels of the finer grid: the strips alone
    rim = np.zeros((h, w), bool)
    rim[:, :7], rim[-4:] = True, True

    def off(shown: Rendered, where: np.ndarray) -> float:
        found = seen(shown, flow).here.lamps
        return float(np.sqrt(np.mean([(found[n] - L)[where] ** 2 for n, L in truth.lamps.items()])))

    assert off(wide, rim) < 0.05 * off(base, rim)
    assert off(wide, ~rim) == pytest.approx(off(base, ~rim), rel=1e-3)
    still = seen(wide, None).here.lamps
    assert all(np.array_equal(still[n], L) for n, L in base.lamps.items())
    assert widened(wide, wide.margin, render, SETTINGS, cache) is wide


def test_what_stands_elsewhere_is_wider_too(small_bench, render, tmp_path: Path) -> None:
    c = small_bench(tmp_path, {0: "Camera0", 6: "Camera0", 16: "Camera1"}, 4)[1]
    cache = tmp_path / "cache"
    standing = ((ObjectPose(x=3.0), "/World/pin"),)
    moved = standing[0][0].on_scene(c.scene, "/World/pin")
    base, other = render_all([(c.scene, c.camera), (moved, c.camera)], render, SETTINGS, cache)
    both = replace(base, elsewhere=(replace(other, standing=standing),))
    wide = widened(both, 5, render, SETTINGS, cache)
    assert [x.margin for x in (wide, *wide.elsewhere)] == [5, 5]
    assert wide.elsewhere[0].standing == standing

    def never(*_: object) -> Image:
        raise AssertionError("what the cache holds must not be rendered")

    again = widened(both, 5, never, SETTINGS, cache)
    assert all(np.array_equal(again.fine[n], plane) for n, plane in wide.fine.items())
    bare = replace(base, fine={})
    assert widened(bare, 5, never, SETTINGS, cache) is bare

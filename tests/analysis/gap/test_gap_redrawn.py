"""What is rendered anew in part is what a whole rendering of the changed scene shows; bench of 128 x 96 px."""

from collections.abc import Sequence
from dataclasses import field, make_dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.named import fingerprint
from analysis.gap.light.radiance import Changes, Paths, render_all
from analysis.gap.light.redrawn import redrawn
from interchange.camera import Camera
from interchange.effects.light_position import LightPosition
from interchange.effects.object_pose import ObjectPose
from interchange.image import Image
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer

PIN, LED = "/World/pin", "/World/LED0"
SETTINGS = {"renderer": "a rasteriser with bounces", "indirect": True}
BOUNCED = 0.1  # of the direct light, which stands for what is reflected


@pytest.fixture
def traced(rasterizer: Rasterizer):
    """Renders as a path tracer would be asked to, and counts pixels times lamps."""

    def render(
        scene: Scene, camera: Camera, passes: Sequence[str], per_light: bool, parts: int, paths: Paths
    ) -> Image:
        wanted = [p for p in passes if p != "indirect"]
        image = rasterizer.render(scene, camera, wanted, per_light, 4)
        w, h = camera.sensor.resolution
        render.cost += w * h * len(scene.lights)
        if paths is Paths.REFLECTED:
            lamps = {k: v for k, v in image.passes.items() if k.startswith("light:")}
            image.passes.update({k.replace("light:", "indirect:"): BOUNCED * v for k, v in lamps.items()})
        return image

    render.cost = 0
    return render


@pytest.mark.parametrize(
    ("standing", "share"),
    [(((ObjectPose(x=3.0, y=1.0), PIN),), 0.6), (((LightPosition(x=20.0), LED),), 0.7)],
    ids=["object", "lamp"],
)
def test_in_part_as_in_whole(standing: Changes, share: float, small_bench, traced, tmp_path: Path) -> None:
    """Within a tenth of the change (spots of a pixel differ at the edges), for less work; what does not change is what
    it was."""
    found: list[Condition] = small_bench(tmp_path, {0: "Camera0", 6: "Camera0", 16: "Camera1"}, 4)
    c = found[1]
    base = render_all([(c.scene, c.camera)], traced, SETTINGS, tmp_path / "cache")[0]
    effect, target = standing[0]
    traced.cost = 0
    whole = render_all([(effect.on_scene(c.scene, target), c.camera)], traced, SETTINGS, tmp_path / "cache")[
        0
    ]
    needed, traced.cost = traced.cost, 0
    part = redrawn(base, standing, traced, SETTINGS, tmp_path / "cache")
    assert traced.cost < share * needed
    assert part.standing == standing
    for lamp, L in whole.lamps.items():
        change = L - base.lamps[lamp]
        missed = part.lamps[lamp] - L
        if np.abs(change).max() < 1e-6 * L.max():
            assert np.array_equal(part.lamps[lamp], base.lamps[lamp])
        else:
            assert np.sqrt(np.mean(missed**2)) < 0.1 * np.sqrt(np.mean(change**2))
    differs = part.passes["object_id"] != whole.passes["object_id"]
    assert differs.mean() < 0.002

    def never(*_: object) -> Image:
        raise AssertionError("what the cache holds must not be rendered")

    again = redrawn(base, standing, never, SETTINGS, tmp_path / "cache")
    assert all(np.array_equal(again.lamps[n], part.lamps[n]) for n in part.lamps)


def test_without_a_finer_grid_all_of_it_is(small_bench, traced, tmp_path: Path) -> None:
    c = small_bench(tmp_path, {0: "Camera0", 6: "Camera0", 16: "Camera1"}, 4)[1]
    standing = ((ObjectPose(x=3.0), PIN),)
    plain = {"renderer": "rasteriser"}
    part = redrawn(replace(c.shown, fine={}), standing, traced, plain, tmp_path / "cache")
    scene = standing[0][0].on_scene(c.scene, PIN)
    whole = render_all([(scene, c.camera)], traced, plain, tmp_path / "cache")[0]
    assert all(np.array_equal(part.lamps[n], whole.lamps[n]) for n in whole.lamps)


def test_a_field_that_is_added_makes_no_rendering_anew() -> None:
    """As long as it is what a new one has it says nothing; arrays and all else are told."""
    old = make_dataclass("Part", [("size", float)])
    new = make_dataclass("Part", [("size", float), ("kind", str, field(default="plain"))])
    assert fingerprint(new(2.0)) == fingerprint(old(2.0))
    assert fingerprint(new(2.0, "odd")) != fingerprint(old(2.0))
    assert fingerprint(new(3.0)) != fingerprint(old(2.0))

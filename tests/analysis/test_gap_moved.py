"""A motion of a part of a pixel moves the edges of a rendering as it moves them in a camera."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.conditions import Condition
from analysis.gap.radiance import FINE, Rendered, pixels
from analysis.gap.state import State
from analysis.gap.views import Views
from interchange.camera import Camera, Lens, Sensor
from interchange.effects.lateral_chromatic_aberration import LateralChromaticAberration
from interchange.light import Light, LightKind
from interchange.scene import Scene

LAMP, SIZE = "/lamp", (24, 16)


def shown(edge: float, finer: int = FINE) -> Rendered:
    """Light to the left of column ``edge``, px from the image's left side; 1 is what a lit pixel has."""
    camera = Camera("/eye", sensor=Sensor(SIZE, (1e-6, 1e-6)))
    n = finer * SIZE[0]
    row = np.clip(finer * edge - np.arange(n), 0, 1)
    fine = np.broadcast_to(row[None, :, None], (finer * SIZE[1], n, 3)).astype(np.float16)
    scene = Scene(lights=(Light(LAMP, LightKind.SPHERE, (1.0, 1.0, 1.0)),))
    nothing = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    lamps = {LAMP: pixels(fine, 1.0, camera)}
    whole = Rendered(scene, camera, lamps, {LAMP: np.ones(3)}, nothing, nothing, {}, {})
    return replace(whole, fine={LAMP: fine}) if finer == FINE else whole


@pytest.mark.parametrize("by", [0.1, -0.2, 1 / 3, 0.5])
def test_an_edge_moves_by_parts_of_a_pixel(by: float) -> None:
    """Which pixels alone cannot tell: there the edge is as wide as two of them, and by up to 0.2 of its height off."""
    flow = np.zeros((SIZE[1], SIZE[0], 2))
    flow[..., 0] = by
    want = shown(12.4 + by).lamps[LAMP][4, 4:-4, 0]
    got = Views(shown(12.4), flow, ()).here.lamps[LAMP][4, 4:-4, 0]
    alone = Views(replace(shown(12.4), fine={}), flow, ()).here.lamps[LAMP][4, 4:-4, 0]
    assert (
        np.abs(got - want).max() < 0.08
    )  # a quarter of a third of a pixel, where the fine grid rounds an edge
    assert got.sum() == pytest.approx(want.sum(), abs=0.01)
    assert np.abs(got - want).sum() < 0.5 * np.abs(alone - want).sum() + 1e-3


def test_a_step_of_the_finer_grid_is_a_motion_by_as_much() -> None:
    flow = np.full((SIZE[1], SIZE[0], 2), 0.0)
    flow[..., 0] = 1 / FINE
    want = Views(shown(12.4), flow, ()).here.lamps[LAMP]
    assert Views(shown(12.4), None, ()).beside((1, 0)).lamps[LAMP] == pytest.approx(want, abs=1e-3)
    assert Views(shown(12.4), flow, ()).beside((-1, 0)).lamps[LAMP] == pytest.approx(
        shown(12.4).lamps[LAMP], abs=1e-3
    )


def test_a_colour_moves_by_parts_of_a_pixel() -> None:
    """As an edge does that lies so far aside; and a step from there is what the chain makes of it."""
    bare = shown(12.4)
    camera = replace(bare.camera, sensor=replace(bare.camera.sensor, responsivity=1000.0, full_well=1e4))
    image = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    rendered = replace(bare, camera=camera)
    condition = Condition(
        (), bare.scene, camera, image, None, np.ones(image.shape[:2], bool), rendered=rendered
    )
    red = LateralChromaticAberration(red_u=0.3 / np.hypot(SIZE[0] / 2, SIZE[1] / 2))
    apart = State(condition, [red])
    want = shown(12.7).lamps[LAMP]
    assert apart.shown.lamps[LAMP][..., 0] == pytest.approx(want[..., 0], abs=0.08)
    assert np.array_equal(apart.shown.lamps[LAMP][..., 1], bare.lamps[LAMP][..., 1])
    assert apart.simulation.dn == pytest.approx(apart.dn([red]))
    back = apart.dn([])
    assert back == pytest.approx(State(condition).simulation.dn, abs=0.12 * float(np.ptp(back)))
    assert np.abs(back - apart.simulation.dn)[..., 0].max() > 0.2 * np.ptp(back)


def test_points_are_finite_where_the_lens_images_nothing() -> None:
    """This lens folds at r = 0.91, which lies at r' = 0.62; the corner's 0.74 has no ray. Where there is one, the point
    lies far away on it."""
    camera = Camera("/eye", sensor=Sensor(SIZE, (1e-6, 1e-6)), lens=Lens(18.5e-6, distortion=(-0.3, -0.1)))
    empty = np.full((SIZE[1], SIZE[0], 3), np.nan)
    image = np.zeros((SIZE[1], SIZE[0], 1))
    rendered = replace(shown(12.4), camera=camera, passes={"position": empty})
    state = State(Condition((), rendered.scene, camera, image, None, image[..., 0] == 0, rendered=rendered))
    _, direction = camera.rays(np.stack(state.grid, axis=-1))
    there = np.isfinite(direction).all(axis=-1)
    assert not there[0, 0]
    assert there[8, 12]
    assert np.isfinite(state.position).all()
    away = state.position[there] / np.linalg.norm(state.position[there], axis=-1, keepdims=True)
    assert np.allclose(away, direction[there])

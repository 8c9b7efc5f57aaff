"""Ground-truth masks, rendered by the ids, against outlines that are known in numbers: pixel for pixel."""

import numpy as np
import pytest

from analysis.series.specimens import camera_above, pixel_grid
from analysis.sweep.defects import MODELS
from analysis.sweep.surface import Anchor, OffSurface, anchor_of
from interchange.brdf.ggx import Ggx
from interchange.formats.gprims import box
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.scene import Body, Scene
from realtime.renderers.rasterizer import Rasterizer

SIZE, FIELD = 96, 24e-3
PX = FIELD / SIZE


def block(name: str, size: tuple[float, float, float], at: tuple[float, float, float]) -> Body:
    """Millimetres."""
    b = box(1.0)
    pose = np.eye(4)
    pose[:3, 3] = 1e-3 * np.array(at)
    return Body(
        name, Mesh(b.vertices * size * 1e-3, b.faces, b.normals, b.uv), Material("steel", Ggx()), pose
    )


PLATE = block("/Plate", (20, 16, 2), (0, 0, -1))
PART = block("/Part", (4, 4, 2), (3, 3, 1))
SCENE = Scene((PLATE, PART), (), (camera_above(SIZE, FIELD),))
CAMERA = SCENE.cameras[0]
X, Y = (1e3 * v for v in pixel_grid(SIZE, FIELD))  # mm


@pytest.fixture(scope="module")
def live():
    with Rasterizer() as rasterizer:
        yield rasterizer


def put(live, kind, scene=SCENE, on="/Plate", anchor=None, **numbers):
    anchor = anchor or anchor_of(scene, on, None, None)
    placed = MODELS[kind](**numbers).on(scene, on, anchor, f"{kind}_0")
    image = live.render(placed.scene, CAMERA, ("object_id", "depth", "normal"), samples=1)
    return placed, *placed.truth(live, CAMERA, image), image


def covered() -> np.ndarray:
    return (np.abs(X - 3) < 2) & (np.abs(Y - 3) < 2)


NUMBERS = {
    "scratch": {"x": -3.0, "y": 1.0, "angle": 700.0, "length": 9.0, "width": 1.0, "depth": 0.05},
    "dent": {"x": 1.5, "y": 1.5, "angle": 400.0, "length": 6.0, "width": 4.0, "depth": 0.3},
    "groove": {"x": -1.0, "y": -3.0, "angle": 250.0, "length": 11.0, "width": 2.0, "depth": 0.3},
    "stain": {"x": 3.0, "y": -2.0, "radius": 3.0, "irregularity": 0.35, "seed": 3.0},
}


@pytest.mark.parametrize("kind", NUMBERS)
def test_a_defects_mask_is_its_outline_at_the_pixels_centres(live, kind):
    numbers = NUMBERS[kind]
    _, seen, whole, _ = put(live, kind, **numbers)
    angle = 1e-3 * numbers.get("angle", 0.0)
    dx, dy = 1e-3 * (X - numbers["x"]), 1e-3 * (Y - numbers["y"])
    c, s = np.cos(angle), np.sin(angle)
    level = MODELS[kind](**numbers).footprint().level(c * dx + s * dy, c * dy - s * dx)
    sure = (
        np.abs(level) > 0.02 * PX
    )  # an outline of chords may leave the curve by their sagitta, far below that
    np.testing.assert_array_equal(whole[sure], (level < 0)[sure])
    np.testing.assert_array_equal(seen[sure], ((level < 0) & ~covered())[sure])
    assert seen.sum() > 50


def test_a_defect_under_a_part_is_whole_but_not_seen(live):
    _, seen, whole, _ = put(live, "dent", x=3.0, y=3.0, length=3.0, width=3.0, depth=0.2)
    assert seen.sum() == 0
    assert whole.sum() * PX**2 * 1e6 == pytest.approx(np.pi * 9 / 4, rel=0.05)


def test_a_missing_part_is_where_it_would_be_seen(live):
    placed, seen, whole, image = put(live, "missing_part", on="/Part")
    np.testing.assert_array_equal(seen, covered())
    np.testing.assert_array_equal(whole, covered())
    assert "/Part" not in image.object_names
    assert len(placed.scene.bodies) == 1


def test_a_misplaced_part_is_where_it_is_and_where_it_should_be(live):
    _, seen, _, _ = put(live, "misplacement", on="/Part", tx=-1.5, ty=1.0)
    there = (np.abs(X - 1.5) < 2) & (np.abs(Y - 4) < 2)
    np.testing.assert_array_equal(seen, covered() | there)


def test_depth_and_normals_of_the_frame_show_the_hollow(live):
    _, _, whole, image = put(live, "dent", **{**NUMBERS["dent"], "x": -4.0, "y": -2.0})
    flat = live.render(SCENE, CAMERA, ("depth",), samples=1).passes["depth"]
    there = np.isfinite(flat)
    deeper = np.where(
        there, 1e3 * (np.where(there, image.passes["depth"], 0.0) - np.where(there, flat, 0)), 0
    )
    assert deeper[whole].max() == pytest.approx(0.3, rel=0.02)
    assert np.abs(deeper[~whole]).max() < 1e-4  # mm: single precision of 0.4 m
    assert (image.passes["normal"][whole][:, 2] < 0.99).any()


def test_a_defect_moves_over_a_curved_surface_and_its_hollow_points_inwards(live):
    from interchange.formats.gprims import sphere

    ball = Body("/Ball", sphere(8e-3), Material("steel", Ggx()))
    scene = Scene((ball,), (), SCENE.cameras)
    for x in (-4.0, 0.0, 4.0):
        placed, seen, _, _ = put(live, "dent", scene, "/Ball", x=x, y=1.0, length=2.0, width=2.0, depth=0.15)
        rows, columns = np.nonzero(seen)
        assert X[0, columns].mean() == pytest.approx(x, abs=0.15)  # foreshortening draws it to the rim's side
        own = next(b for b in placed.scene.bodies if b.name.endswith("|dent_0"))
        depth = 8e-3 - np.linalg.norm(own.mesh.vertices, axis=1)
        assert depth.max() * 1e3 == pytest.approx(0.15, rel=0.1)  # from the ball, not along the view
        assert depth.min() > -2e-5
        del rows


@pytest.mark.parametrize("place", [{"x": 30.0}, {"x": 9.0}, {"y": -7.6}])
def test_a_hollow_that_has_no_room_is_refused(place):
    with pytest.raises(OffSurface, match="must lie on /Plate"):
        MODELS["dent"](**place).on(SCENE, "/Plate", anchor_of(SCENE, "/Plate", None, None), "dent_0")


def test_a_defect_stays_on_its_object_when_that_moves(live):
    from dataclasses import replace

    anchor = anchor_of(SCENE, "/Plate", None, None)
    pose = np.eye(4)
    pose[:2, :2] = [[0, -1], [1, 0]]
    pose[:3, 3] = [2e-3, 1e-3, -1e-3]
    moved = replace(SCENE, bodies=(replace(PLATE, world_from_body=pose),))
    _, _, whole, _ = put(live, "stain", moved, anchor=anchor, x=4.0, y=2.0, radius=1.5, irregularity=0.0)
    rows, columns = np.nonzero(whole)
    # (4, 2) mm on the plate, turned by 90 degrees and moved by (2, 1) mm
    assert (X[0, columns].mean(), Y[rows, 0].mean()) == pytest.approx((0, 5), abs=0.05)
    assert isinstance(anchor, Anchor)


def test_every_defect_of_the_catalogue_can_be_put_somewhere(live):
    for kind in MODELS:
        placed, *_ = put(live, kind, on="/Part" if not MODELS[kind].needs_place else "/Plate")
        assert placed.scene is not SCENE
        assert MODELS[kind].source


def test_defects_that_overlap_are_both_whole_and_the_surface_stays_closed(live):
    anchor = anchor_of(SCENE, "/Plate", None, None)
    scratch = MODELS["scratch"](x=-3.0, y=-3.0, length=9.0, width=1.0, depth=0.05)
    dent = MODELS["dent"](x=-3.0, y=-3.0, length=4.0, width=4.0, depth=0.3)
    first = scratch.on(SCENE, "/Plate", anchor, "scratch_0")
    both = dent.on(first.scene, "/Plate", anchor, "dent_0")
    image = live.render(both.scene, CAMERA, ("object_id",), samples=1)
    for placed, model in ((first, scratch), (both, dent)):
        level = model.footprint().level(1e-3 * (X + 3), 1e-3 * (Y + 3))
        sure = np.abs(level) > 0.02 * PX
        np.testing.assert_array_equal(placed.truth(live, CAMERA, image)[0][sure], (level < 0)[sure])
    pieces = [b for b in both.scene.bodies if b.name.startswith("/Plate")]
    assert sorted(b.name for b in pieces) == [
        "/Plate",
        "/Plate|dent_0",
        "/Plate|scratch_0",
        "/Plate|scratch_0|dent_0",
    ]
    p = np.concatenate([b.mesh.vertices[b.mesh.faces] for b in pieces]) * 1e3
    volume = np.sum(p[:, 0] * np.cross(p[:, 1], p[:, 2])) / 6
    deep = 0.05 * (9 / 2 + np.pi * 0.25 * (0.5 - 2 / np.pi**2)) + 0.3 * np.pi * 4 / 3
    assert 20 * 16 * 2 - volume == pytest.approx(
        deep, rel=0.03
    )  # mm³: the divergence theorem needs it closed

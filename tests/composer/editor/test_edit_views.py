"""What the window is made of, without a window: views, tools, picking, panels and the library."""

from dataclasses import replace
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from composer.editor.commands import AddMaterial, Delete, SetBrdf, SetParameter, Transform
from composer.editor.fields import Widget, fields_of, of_camera
from composer.editor.glyphs import box, frustum, on_screen
from composer.editor.modal import AXES, Modal, meant
from composer.editor.orbit import Orbit, gl_matrices
from composer.editor.picking import body_at
from composer.editor.poses import around, rotation, shifted, turned
from composer.editor.presets import COMMON, MEASURED, preset, presets
from composer.editor.preview import moved
from composer.editor.proposals import camera as proposed_camera
from composer.editor.proposals import lamp as proposed_lamp
from composer.editor.workspace import Workspace
from interchange.brdf import BY_NAME
from interchange.camera import Camera, Lens
from interchange.effects import MODELS
from interchange.parameter import parameters
from realtime.renderers.rasterizer import Rasterizer

NUMBER = st.floats(-0.3, 0.3)
ORBITS = st.builds(
    Orbit,
    st.tuples(NUMBER, NUMBER, NUMBER),
    st.floats(0.2, 3),
    st.floats(0, 6.28),
    st.floats(-1.5, 1.5),
    orthographic=st.booleans(),
)


@given(ORBITS, st.tuples(NUMBER, NUMBER, NUMBER), st.tuples(*[st.floats(0.01, 1)] * 3), st.floats(0.4, 3))
@settings(max_examples=40, deadline=None)
def test_what_is_fitted_is_in_view(orbit: Orbit, low: tuple, size: tuple, aspect: float) -> None:
    bounds = np.array([low, np.add(low, size)])
    height = 480
    camera = orbit.fitted(bounds, aspect).camera(round(aspect * height), height)
    pixels = camera.project(box(bounds).reshape(-1, 3))
    width = camera.sensor.resolution[0]
    assert (pixels > -0.5).all()
    assert (pixels < (width - 0.5, height - 0.5)).all()
    cube = np.array([low, np.add(low, max(size))])  # which is as large from every side
    camera = orbit.fitted(cube, aspect).camera(width, height)
    assert np.ptp(camera.project(box(cube).reshape(-1, 3)), axis=0).max() > 0.2 * min(width, height)


@given(ORBITS, st.floats(-100, 100), st.floats(-100, 100))
@settings(max_examples=40, deadline=None)
def test_what_is_panned_stays_under_the_cursor(orbit: Orbit, dx: float, dy: float) -> None:
    before = orbit.camera(640, 480).project(np.array(orbit.target))
    after = orbit.panned(dx, dy, 480).camera(640, 480).project(np.array(orbit.target))
    np.testing.assert_allclose(after - before, (dx, dy), atol=1e-6)


@given(ORBITS, st.tuples(NUMBER, NUMBER, NUMBER))
@settings(max_examples=40, deadline=None)
def test_the_gizmo_sees_what_the_renderer_sees(orbit: Orbit, offset: tuple) -> None:
    """OpenGL's matrices put a point where the camera's own model does; pixel centres differ by half a pixel."""
    camera = orbit.camera(640, 480)
    point = np.asarray(orbit.target) + np.asarray(offset) * orbit.distance
    view, projection = gl_matrices(camera)
    clip = projection @ view @ np.append(point, 1)
    x, y, z = clip[:3] / clip[3]
    np.testing.assert_allclose(camera.project(point) + 0.5, ((x + 1) * 320, (1 - y) * 240), atol=1e-6)
    assert -1 <= z <= 1


@pytest.mark.parametrize(("side", "towards"), [("front", 1), ("right", 0), ("top", 2)])
def test_views_of_the_keypad_look_along_an_axis(side: str, towards: int) -> None:
    forward = Orbit().seen_from(side).axes[:, 2]
    assert abs(forward[towards]) == pytest.approx(1, abs=1e-4)  # the top is seen from 89.999 degrees


def test_lines_behind_the_eye_are_cut() -> None:
    camera = Orbit(azimuth=0.0, elevation=0.0, distance=1.0).camera(640, 480)  # at x = -1, looks along x
    through = np.array([[[-3.0, 0.01, 0.01], [1.0, 0.01, 0.01]], [[-5.0, 0, 0], [-2.0, 0, 0]]])
    pixels, kept = on_screen(camera, through)
    assert kept.tolist() == [0]
    np.testing.assert_allclose(pixels[0, 1], camera.project(through[0, 1]) + 0.5, atol=1e-9)


def test_a_frustum_ends_where_the_field_does() -> None:
    camera = replace(Camera(), lens=Lens(5e-3, distortion=(-0.2, 0.05)))
    ends = frustum(camera, 0.1, 0.5).reshape(-1, 3)
    far = ends[np.isclose(ends[:, 2], 0.5)]
    pixels = camera.project(far)
    width, height = camera.sensor.resolution
    edge = np.minimum.reduce(
        [*np.abs(pixels.T + 0.5), np.abs(pixels[:, 0] - width + 0.5), np.abs(pixels[:, 1] - height + 0.5)]
    )
    assert edge.max() < 1e-3  # px; undistort's own residual


@given(ORBITS, st.sampled_from(["", "x", "y", "z"]), st.floats(-80, 80), st.floats(-80, 80))
@settings(max_examples=60, deadline=None)
def test_a_grabbed_thing_follows_the_cursor(orbit: Orbit, axis: str, dx: float, dy: float) -> None:
    """Free: exactly. Held to an axis: it stays on the axis."""
    camera = orbit.camera(640, 480)
    modal = Modal("move", orbit.target, (320.0, 240.0), axis)
    by = modal.motion(camera, (320 + dx, 240 + dy))
    np.testing.assert_allclose(by[:3, :3], np.eye(3))
    if axis:
        np.testing.assert_allclose(np.cross(by[:3, 3], AXES[axis]), 0, atol=1e-12)
    else:
        at = np.array(orbit.target)
        np.testing.assert_allclose(
            camera.project(at + by[:3, 3]) - camera.project(at), (dx, dy), rtol=0, atol=1e-6
        )


@pytest.mark.parametrize(
    ("kind", "keys", "expected"),
    [
        ("move", "x-12.5", shifted((-0.0125, 0, 0))),
        ("rotate", "z90", turned((0, 0, 1), 90, (0.1, 0.2, 0.3))),
        ("scale", "2", around(2 * np.eye(3), (0.1, 0.2, 0.3))),
        ("scale", "y3", around(np.diag([1.0, 3, 1]), (0.1, 0.2, 0.3))),
    ],
)
def test_typed_numbers_are_exact(kind: str, keys: str, expected: np.ndarray) -> None:
    modal = Modal(kind, (0.1, 0.2, 0.3), (5.0, 5.0))
    for key in keys:
        modal = modal.held_to(key) if key in AXES else modal.with_key(key)
    by = modal.motion(Orbit().camera(640, 480), (300.0, 17.0))
    np.testing.assert_allclose(by, expected, atol=1e-12)


def test_snapping_gives_whole_steps() -> None:
    camera = Orbit().camera(640, 480)
    by = Modal("move", (0, 0, 0), (300, 200), "x").motion(camera, (377, 211), snap=5.0)
    steps = by[0, 3] * 1e3 / 5
    assert steps == pytest.approx(round(steps))
    assert steps != 0


@given(st.tuples(*[st.floats(-170, 170)] * 3), st.tuples(NUMBER, NUMBER, NUMBER), st.floats(0.2, 4))
@settings(max_examples=40, deadline=None)
def test_a_gizmos_motion_is_cleaned_of_its_rounding(degrees: tuple, shift: tuple, factor: float) -> None:
    start = np.eye(4)
    start[:3, :3] = rotation((20, 30, 40)) * factor
    start[:3, 3] = 1, 2, 3
    noise = 1 + 1e-7 * np.sin(np.arange(16)).reshape(4, 4)
    for kind, by in (("move", shifted(shift)), ("rotate", around(rotation(degrees), (1, 2, 3)))):
        found = meant(kind, start, (by @ start) * noise)
        np.testing.assert_allclose(found, by, atol=5e-6)  # single precision of a pose some metres away
        np.testing.assert_allclose(found[:3, :3] @ found[:3, :3].T, np.eye(3), atol=1e-12)


@pytest.fixture(scope="module")
def stocked() -> Workspace:
    workspace = Workspace()
    for kind in ("box", "sphere", "cylinder"):
        at = {"box": -0.15, "sphere": 0.0, "cylinder": 0.15}[kind]
        workspace.do(f"add_solid kind={kind} name={kind} size=[0.1,0.1,0.1] position=[{at},0,0]")
    for kind in ("sphere", "rect", "disk", "cylinder", "distant", "dome"):
        workspace.select(())
        workspace.do(proposed_lamp(workspace, kind))
    workspace.select(())
    workspace.do(proposed_camera(workspace))
    workspace.do("add_material model=Lafortune name=Metal")
    return workspace


def test_picking_agrees_with_the_whole_id_pass(stocked: Workspace) -> None:
    camera = Orbit().fitted(stocked.bounds()).camera(160, 120)
    with Rasterizer() as renderer:
        image = renderer.render(stocked.scene, camera, passes=("object_id",), samples=1)
        ids = image.passes["object_id"]
        rng = np.random.default_rng(1)
        for row, column in zip(rng.integers(0, 120, 12), rng.integers(0, 160, 12), strict=True):
            name, _ = body_at(renderer, stocked.scene, camera, (column + 0.5, row + 0.5))
            assert name == (image.object_names[ids[row, column]] if ids[row, column] >= 0 else "")
    assert len(np.unique(ids)) == 4


def test_what_is_dragged_looks_as_it_will_be(stocked: Workspace) -> None:
    """The preview of a motion is the scene after the step, for bodies, lamps and cameras."""
    paths = ("/World/box", "/World/AreaLamp", "/World/Camera", "/World/DiskLamp")
    by = turned((0, 0.6, 0.8), 40, (0.1, 0, 0)) @ shifted((0, 0.05, 0))
    shown = moved(stocked.scene, paths, by)
    stocked.do(Transform(paths, tuple(map(tuple, by.tolist()))))
    after = stocked.scene
    stocked.undo()
    for a, b in zip(shown.bodies, after.bodies, strict=True):
        np.testing.assert_allclose(a.world_from_body, b.world_from_body, atol=1e-9)
    for a, b in zip(shown.lights, after.lights, strict=True):
        np.testing.assert_allclose(a.world_from_light, b.world_from_light, atol=1e-9)
    for a, b in zip(shown.cameras, after.cameras, strict=True):
        np.testing.assert_allclose(a.world_from_camera, b.world_from_camera, atol=1e-9)


def test_a_new_lamp_lights_the_middle_and_a_new_camera_sees_all(stocked: Workspace) -> None:
    bounds = stocked.bounds()
    assert bounds is not None
    middle = bounds.mean(axis=0)
    for light in stocked.scene.lights:
        if light.kind not in ("distant", "dome"):
            way = middle - light.world_from_light[:3, 3]
            assert -light.world_from_light[:3, 2] @ way / np.linalg.norm(way) == pytest.approx(1, abs=1e-5)
    pixels = stocked.scene.cameras[0].project(box(bounds).reshape(-1, 3))
    assert (pixels > 0).all()
    assert (pixels < stocked.scene.cameras[0].sensor.resolution).all()


@pytest.mark.parametrize("name", sorted(set(BY_NAME) - {"Sum"}))
def test_every_parameter_of_every_model_has_its_field_and_can_be_set(stocked: Workspace, name: str) -> None:
    """Setting a field to the value that it shows changes nothing; single precision of the file."""
    path = "/World/Materials/Metal"
    stocked.do(SetBrdf(path, name))
    material = stocked.material(path)
    assert material is not None
    assert type(material.brdf).__name__ == name
    fields = [f for f in fields_of(material) if f.group != "Beside the BRDF" and f.widget is not Widget.TEXT]
    declared = parameters(material.brdf)
    filled = [n for n, p in declared.items() if not p.per_lobe or len(getattr(material.brdf, n))]
    assert {f.name for f in fields} == set(filled)
    for f in fields:
        assert f.source == material.brdf.source
        stocked.do(SetParameter(path, f.name, f.value))
    after = stocked.material(path)
    assert after is not None
    np.testing.assert_allclose(after.brdf.flat(), material.brdf.flat(), rtol=1e-6)


def test_every_field_of_a_camera_and_of_the_lamps_can_be_set(stocked: Workspace) -> None:
    before = stocked.scene
    for thing in (before.cameras[0], *before.lights):
        for f in fields_of(thing):
            stocked.do(SetParameter(thing.name, f.name, f.value))
    after = stocked.scene
    assert after.cameras[0].lens == before.cameras[0].lens
    assert after.cameras[0].sensor == before.cameras[0].sensor
    for a, b in zip(after.lights, before.lights, strict=True):
        np.testing.assert_allclose(a.intensity, b.intensity, rtol=1e-6)
        assert (a.kind, a.cone_softness, a.focus, a.visible) == (b.kind, b.cone_softness, b.focus, b.visible)
        for name in ("radius", "width", "height", "length", "cone_angle"):
            assert getattr(a, name) == pytest.approx(getattr(b, name), rel=1e-6)


def test_the_panel_has_every_number_of_every_effect(stocked: Workspace) -> None:
    shown = {f.name for f in of_camera(stocked.scene.cameras[0])}
    for effect in MODELS.values():
        if not effect.always:
            numbers = {p for n, p in effect.carried_by.items() if n in parameters(effect)}
            assert numbers <= shown, effect.name()


def test_the_library_brings_what_it_shows() -> None:
    """Every entry's edit gives the BRDF of its ball; single precision of the file."""
    assert sum(p.group == MEASURED for p in presets()) == 50
    workspace = Workspace()
    for name in ("aluminium", "beige-fabric", *COMMON, "Ward"):
        entry = preset(name)
        assert isinstance(entry.command, AddMaterial)
        workspace.do(entry.command)
        (path,) = workspace.selection
        found = workspace.material(path)
        assert found is not None
        np.testing.assert_allclose(found.brdf.flat(), entry.brdf.flat(), rtol=1e-6)
        workspace.do(Delete((path,)))


def test_every_preset_file_row_is_a_material() -> None:
    assert len({p.name for p in presets()}) == len(presets())
    assert (Path(__file__).parents[3] / "assets/lafortune_fits/ngan2005_lafortune_1lobe.csv").read_text() == (
        Path(__file__).parents[3] / "composer/editor/presets.csv"
    ).read_text()

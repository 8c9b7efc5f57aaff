"""Where the scene itself stands elsewhere: what is simulated there, and what its terms say from there."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.conditions import Condition, conditions
from analysis.gap.fit import fit
from analysis.gap.knot_terms import knot_terms, standing, together
from analysis.gap.knots import MANY, Knots
from analysis.gap.model import Model
from analysis.gap.radiance import render_all
from analysis.gap.reach import cropped, region
from analysis.gap.sensitivities import sensitivities
from analysis.gap.state import State
from interchange.camera import Camera
from interchange.captures import Tolerances
from interchange.effects.light_position import LightPosition
from interchange.effects.object_pose import ObjectPose
from interchange.effects.parts import SEVERAL, bounds
from interchange.formats import captures as captures_file
from interchange.formats import images
from interchange.formats.document import open_scene
from interchange.image import Image
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer

BENCH = Path(__file__).parents[2] / "assets/bench_sample/scene.usda"
WIDTH, HEIGHT = 128, 96
SHOTS = ((0, "Camera0"), (2, "Camera0"), (16, "Camera1"))
BRACKET = "/World/bracket"
MOVED = ObjectPose(x=3.0, y=-2.0)  # mm: about 1.5 px
SPOTS = 16


@pytest.fixture(scope="module")
def rasterizer() -> Iterator[Rasterizer]:
    with Rasterizer() as rasterizer:
        yield rasterizer


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stands")
    (folder / "scene.usda").write_text(BENCH.read_text().replace("(480, 360)", f"({WIDTH}, {HEIGHT})"))
    for time, _ in SHOTS:
        images.write(folder / f"{time}.png", np.zeros((HEIGHT, WIDTH, 3), np.uint16))
    entries = [
        {"image": f"{time}.png", "camera": f"/World/{camera}", "time": time, "exposure": 1.0}
        for time, camera in SHOTS
    ]
    (folder / "captures.json").write_text(json.dumps({"scene": "scene.usda", "captures": entries}))
    return folder


@pytest.fixture(scope="module")
def found(folder: Path, rasterizer: Rasterizer) -> list[Condition]:
    """Two lamps of the bench's six."""

    def render(scene: Scene, camera: Camera, passes: Sequence[str], per_light: bool, parts: int) -> Image:
        return rasterizer.render(scene, camera, passes, per_light, max(2 * SPOTS // parts, 1))

    bare = conditions(captures_file.read(folder / "captures.json"), open_scene(folder / "scene.usda"))
    bare = [replace(c, scene=replace(c.scene, lights=c.scene.lights[0:3:2])) for c in bare]
    views = [(c.scene, c.camera) for c in bare]
    shown = render_all(views, render, {"renderer": "rasterizer", "samples": SPOTS}, folder / "cache")
    return [replace(c, rendered=r) for c, r in zip(bare, shown, strict=True)]


@pytest.fixture(scope="module")
def knots(folder: Path, rasterizer: Rasterizer) -> Knots:
    return Knots(folder / "cache", lambda: rasterizer)


def test_what_is_simulated_is_the_changed_scene(found, knots, rasterizer) -> None:
    """Within a tenth of the change: both sides sample edges of their own."""
    stands = State(found[0], scene=((MOVED, BRACKET),), knots=knots)
    before, after = (
        rasterizer.render(s, found[0].camera, samples=4 * MANY).pixels
        for s in (found[0].scene, MOVED.on_scene(found[0].scene, BRACKET))
    )
    real = State(found[0]).per_radiance * (after - before)
    said = stands.simulation.dn - State(found[0]).simulation.dn
    assert np.sqrt(np.mean(real**2)) > 5
    assert np.sqrt(np.mean((said - real) ** 2)) < 0.1 * np.sqrt(np.mean(real**2))


def test_terms_tell_what_more_does_from_there(found, knots, rasterizer) -> None:
    """The column at the place where the object stands, against two renderings around it; elsewhere it is another."""
    terms = {t.key: t for t in knot_terms(found, Tolerances(), knots)}
    term = terms["object_pose", BRACKET, "x"]
    further = replace(MOVED, x=MOVED.x + 1.0)
    real = State(found[0]).per_radiance * np.subtract(*(
        rasterizer.render(e.on_scene(found[0].scene, BRACKET), found[0].camera, samples=4 * MANY).pixels
        for e in (further, MOVED)
    ))  # fmt: skip
    there, at_home = (
        np.asarray(term.field(State(found[0], scene=scene, knots=knots)))
        for scene in (((MOVED, BRACKET),), ())
    )
    missed = [np.sqrt(np.mean((x - real) ** 2) / np.mean(real**2)) for x in (there, at_home)]
    assert missed[0] < 0.5
    assert missed[0] < 0.7 * missed[1]


def test_a_part_of_the_image_is_rendered_as_in_the_whole(found, rasterizer) -> None:
    """Nothing changes outside the region, and inside the cropped camera sees the same."""
    scene, camera = found[0].scene, found[0].camera
    boxes = [bounds(s, BRACKET) for s in (scene, MOVED.on_scene(scene, BRACKET))]
    rows, columns = region(scene, boxes, camera) or (slice(None), slice(None))
    assert (rows.stop - rows.start) * (columns.stop - columns.start) < 0.8 * WIDTH * HEIGHT
    before, after = (rasterizer.render(s, camera).pixels for s in (scene, MOVED.on_scene(scene, BRACKET)))
    outside = np.ones((HEIGHT, WIDTH), bool)
    outside[rows, columns] = False
    assert np.abs(after - before)[outside].max() < 1e-3 * after.max()
    part = rasterizer.render(scene, cropped(camera, rows, columns)).pixels
    assert np.mean(np.abs(part - before[rows, columns]) > 0.02 * before.max()) < 0.02


def test_sensitivities_are_kept_where_the_model_stands_near(found, knots) -> None:
    terms = knot_terms(found, Tolerances(), knots)[:4]
    state = State(found[0])
    kept = sensitivities(state, terms)
    assert sensitivities(State(found[0]), terms, kept) is kept
    moved = State(found[0], flow=np.full((HEIGHT, WIDTH, 2), 0.3))
    assert sensitivities(moved, terms, kept) is not kept
    again = sensitivities(State(found[0]), terms, kept, anew=[1])
    assert again is not kept
    assert again.columns == pytest.approx(kept.columns)
    assert kept.of(np.array([2, 0])).columns[0] == pytest.approx(kept.columns[0])


def test_an_object_that_lies_elsewhere_is_followed_there(found, knots, rasterizer) -> None:
    """1.5 px away, which no single linearisation tells: named, and its place within a fifth of a millimetre."""
    rng = np.random.default_rng(3)
    captured = []
    for c in found:
        image = rasterizer.render(MOVED.on_scene(c.scene, BRACKET), c.camera, samples=4 * MANY).pixels
        model = State(c)
        dn = model.simulation.dn + model.per_radiance * (image - model.radiance)
        noise = np.sqrt(model.simulation.temporal) * rng.standard_normal(dn.shape)
        captured.append(replace(c, mean=dn + noise))
    assert BRACKET in standing(captured)
    done = fit(captured, Tolerances(), knots=knots)
    assert ("object_pose", BRACKET) in done.best.causes
    own = {
        t.parameter: float(x)
        for t, x in zip(done.terms, done.theta, strict=True)
        if t.candidate == ("object_pose", BRACKET)
    }
    assert own["x"] == pytest.approx(MOVED.x, abs=0.3)
    assert own["y"] == pytest.approx(MOVED.y, abs=0.3)
    assert isinstance(done.after, Model)
    assert done.after.scene


def test_parts_that_move_alike_are_one_workpiece(found) -> None:
    names = found[0].shown.scene.object_names
    parts = [BRACKET, next(n for n in names if n != BRACKET)]
    alone = next(n for n in names if n not in parts)
    moved = ObjectPose(x=5.0, rz=20.0).on_scene(found[1].shown.scene, SEVERAL.join(parts))
    moved = ObjectPose(x=-5.0).on_scene(moved, alone)
    series = [found[0], replace(found[1], rendered=replace(found[1].shown, scene=moved)), found[2]]
    assert not together(found)
    assert [set(t.split(SEVERAL)) for t in together(series)] == [set(parts)]
    keys = {t.key for t in knot_terms(series, Tolerances(), Knots(Path()))}
    assert {("object_pose", together(series)[0], p) for p in ("x", "y", "z", "rz")} <= keys


def test_several_parts_turn_about_their_common_middle(found) -> None:
    scene = found[0].scene
    parts = [BRACKET, next(n for n in scene.object_names if n != BRACKET)]
    turned = ObjectPose(rz=1e3 * np.pi / 2).on_scene(scene, SEVERAL.join(parts))
    middle = bounds(scene, SEVERAL.join(parts)).mean(axis=0)
    quarter = np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]])
    for old, new in zip(scene.bodies, turned.bodies, strict=True):
        if old.name in parts:
            at = old.world_from_body[:3, 3]
            assert new.world_from_body[:3, 3] == pytest.approx(middle + quarter @ (at - middle), abs=1e-9)
        else:
            assert new is old


def test_a_lamp_that_an_arrangement_lacks_changes_nothing_there(found, knots) -> None:
    """Lamps that are never on under a camera are not in what it shows."""
    shown = found[0].shown
    first, *others = shown.scene.lights
    dark = replace(shown, scene=replace(shown.scene, lights=tuple(others)))
    moved = ((LightPosition(x=5.0), first.name), (MOVED, BRACKET))
    lacking = knots.change(dark, moved)
    assert set(lacking.lamps) <= {x.name for x in others}
    assert knots.change(dark, (moved[0],)).lamps == {}

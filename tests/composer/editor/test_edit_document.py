"""The document layer: every edit is taken back exactly, is text and data alike, and keeps what others wrote."""

import os
import re
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from composer.editor.autosave import Autosave, orphans
from composer.editor.command_text import COMMANDS, as_text, parse
from composer.editor.commands import (
    AddCamera,
    AddLamp,
    AddMaterial,
    AddSolid,
    AssignMaterial,
    Command,
    Delete,
    Duplicate,
    Import,
    Place,
    Rename,
    SetBrdf,
    SetParameter,
    Show,
    Transform,
)
from composer.editor.poses import split, turned
from composer.editor.workspace import Workspace
from interchange.problems import BrightfieldError

ASSETS = Path(__file__).parents[3] / "assets"

FOREIGN = """#usda 1.0
(
    defaultPrim = "Cell"
    metersPerUnit = 0.01
    upAxis = "Y"
    customLayerData = { string author = "someone else" }
)
def Xform "Cell" (assetInfo = { string name = "cell" })
{
    custom double plc:speed = 3.5
    def Cube "Block" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        double size = 4
        double3 xformOp:translate = (1, 2, 3)
        float3 xformOp:rotateXYZ = (0, 30, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
        custom string erp:number = "A-17"
        rel material:binding = </Cell/Looks/Paint>
    }
    def Sphere "Turning"
    {
        float xformOp:rotateY.timeSamples = { 0: 0, 1: 45 }
        uniform token[] xformOpOrder = ["xformOp:rotateY"]
    }
    def SphereLight "Lamp"
    {
        float inputs:intensity = 50
        float inputs:radius = 0.5
        custom int plc:port = 7
    }
    def Camera "Eye"
    {
        float focalLength = 2
        double3 xformOp:translate = (0, 1, 30)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Scope "Looks"
    {
        def Material "Paint"
        {
            token outputs:brdf:surface.connect = </Cell/Looks/Paint/Brdf.outputs:surface>
            def Shader "Brdf"
            {
                uniform token info:id = "Lafortune"
                color3f inputs:diffuse = (0.12, 0.12, 0.13)
                color3f[] inputs:weight = [(1.2, 1.2, 1.25)]
                float3[] inputs:C = [(-0.98, -0.98, 0.99)]
                float[] inputs:n = [25]
                token outputs:surface
                custom string lab:batch = "7b"
            }
        }
    }
}
"""


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("scene") / "cell.usda"
    file.write_text(FOREIGN)
    return file


@pytest.fixture
def workspace(foreign: Path) -> Workspace:
    opened = Workspace()
    opened.open(foreign)
    return opened


BODY, LAMP, EYE, PAINT = "/Cell/Block", "/Cell/Lamp", "/Cell/Eye", "/Cell/Looks/Paint"
TURN = tuple(map(tuple, turned((0, 0, 1), 30, (0.1, 0, 0)).tolist()))

EXAMPLES: list[Command] = [
    Import(str(ASSETS / "cad" / "featuretype.STL"), unit="mm"),
    AddLamp("rect", "Bar", (0.1, 0.2, 0.3), (0, 0, 0), 2.0, 0.05),
    AddLamp("dome", "Sky"),
    AddCamera("Top", (0, 0, 0.5)),
    AddSolid("cylinder", "Post", (0.1, 0.2, 0.3), (0, 0, 0.1)),
    AddMaterial("Ward", "Brushed", {"alpha": 0.1}),
    AssignMaterial(("/Cell",), PAINT),
    SetBrdf(PAINT, "Lambert", {"diffuse": (0.5, 0.4, 0.3)}),
    SetParameter(LAMP, "intensity", 3.0),
    SetParameter(LAMP, "cone_angle", 0.5),
    SetParameter(EYE, "lens.f_stop", 4.0),
    SetParameter(EYE, "lens.vignetting.1", -0.1),
    SetParameter(PAINT, "n", (40.0,)),
    SetParameter(PAINT, "emission", (0.0, 1.0, 0.0)),
    Place(BODY, (0.1, 0.2, 0.3), (10, 20, 30), (1, 2, 1)),
    Transform((BODY, LAMP), TURN),
    Show(BODY, False),
    Delete((LAMP, BODY)),
    Duplicate((BODY, EYE), (0.1, 0, 0)),
    Rename("/Cell/Looks", "Materials"),
]


def test_there_is_an_example_of_every_edit() -> None:
    assert {type(c) for c in EXAMPLES} == set(COMMANDS.values())


@pytest.mark.parametrize("command", EXAMPLES, ids=as_text)
def test_undo_and_redo_give_back_what_was_to_the_last_opinion(workspace: Workspace, command: Command) -> None:
    before = workspace.live.snapshot()
    workspace.do(command)
    after = workspace.live.snapshot()
    assert not workspace.live.equals(before)
    workspace.undo()
    assert workspace.live.equals(before)
    workspace.redo()
    assert workspace.live.equals(after)
    workspace.undo()
    workspace.do(command)  # what is data gives the same again
    assert workspace.live.equals(after)


@pytest.mark.parametrize("command", EXAMPLES, ids=as_text)
def test_an_edit_is_the_same_as_its_text(workspace: Workspace, command: Command) -> None:
    workspace.do(command)
    after = workspace.live.snapshot()
    workspace.undo()
    workspace.do(parse(as_text(command)))
    assert workspace.live.equals(after)


FREE = st.floats(-0.5, 0.5)
EDITS = st.one_of(
    st.builds(Place, st.sampled_from([BODY, LAMP, EYE]), st.tuples(FREE, FREE, FREE)),
    st.builds(SetParameter, st.just(LAMP), st.just("intensity"), st.floats(0, 100)),
    st.builds(SetParameter, st.just(EYE), st.just("lens.focal_length"), st.floats(1e-3, 0.2)),
    st.builds(SetParameter, st.just(PAINT), st.just("diffuse"), st.tuples(*[st.floats(0, 1)] * 3)),
    st.sampled_from([c for c in EXAMPLES if not isinstance(c, Import)]),
)


@given(st.lists(st.one_of(EDITS, st.sampled_from(["undo", "redo"])), max_size=12))
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_any_walk_through_history_comes_back(foreign_text: str, walk: list[Command | str]) -> None:
    workspace = Workspace()
    workspace.stage.GetRootLayer().ImportFromString(foreign_text)
    workspace._look()
    first = workspace.live.snapshot()
    for step in walk:
        try:
            if step == "undo":
                workspace.undo()
            elif step == "redo":
                workspace.redo()
            else:
                workspace.do(step)
        except BrightfieldError:  # a lamp that was deleted cannot be set: the stage is then as it was
            last = workspace.history.last
            assert workspace.live.equals(last.after if last else first)
    while workspace.undo():
        pass
    assert workspace.live.equals(first)


@pytest.fixture(scope="module")
def foreign_text() -> str:
    return FOREIGN


def test_saving_keeps_what_others_wrote(workspace: Workspace, tmp_path: Path) -> None:
    workspace.do(Place(BODY, (0.1, 0.2, 0.3)))
    workspace.do(SetParameter(PAINT, "n", (40.0,)))
    workspace.save(tmp_path / "out.usda")
    text = (tmp_path / "out.usda").read_text()
    for word in (
        "plc:speed = 3.5",
        'erp:number = "A-17"',
        "plc:port = 7",
        'lab:batch = "7b"',
        "someone else",
    ):
        assert word in text
    assert "metersPerUnit = 0.01" in text
    assert 'upAxis = "Y"' in text
    block = text[text.index('"Block"') :]
    found = re.search(
        r"double3 xformOp:translate = \((.*?)\)", block
    )  # the op that was there, in cm with y up
    assert found is not None
    np.testing.assert_allclose([float(x) for x in found[1].split(",")], (10, 30, -20), atol=1e-9)


def test_a_saved_scene_reads_as_it_was_left(workspace: Workspace, tmp_path: Path) -> None:
    for command in EXAMPLES[1:16]:
        if not isinstance(command, SetBrdf):  # the steps after it set what only the BRDF before it has
            workspace.do(command)
    assert workspace.unsaved
    workspace.save(tmp_path / "out.usda")
    assert not workspace.unsaved
    again = Workspace()
    again.open(tmp_path / "out.usda")
    assert [b.name for b in again.scene.bodies] == [b.name for b in workspace.scene.bodies]
    for a, b in zip(again.scene.bodies, workspace.scene.bodies, strict=True):
        np.testing.assert_array_equal(a.world_from_body, b.world_from_body)
        assert a.material.brdf == b.material.brdf
    assert [x.intensity for x in again.scene.lights] == [x.intensity for x in workspace.scene.lights]
    assert [c.lens for c in again.scene.cameras] == [c.lens for c in workspace.scene.cameras]


@pytest.mark.parametrize("path", [BODY, LAMP, EYE, "/Cell/Turning"])
def test_a_thing_goes_where_it_is_placed(workspace: Workspace, path: str) -> None:
    """In m, z up, whatever the stage's unit, axes and ops; single precision of USD's own rotate ops."""
    workspace.do(Place(path, (0.3, -0.2, 0.1), (15, -40, 70)))
    position, degrees, _ = split(workspace.pose(path))
    np.testing.assert_allclose(position, (0.3, -0.2, 0.1), atol=1e-7)
    np.testing.assert_allclose(degrees, (15, -40, 70), atol=1e-4)


def test_moving_what_is_animated_moves_all_of_its_way(workspace: Workspace) -> None:
    ways = [workspace.pose("/Cell/Turning")]
    workspace.go_to(1.0)
    ways.append(workspace.pose("/Cell/Turning"))
    workspace.go_to(0.0)
    by = np.array(TURN)
    workspace.do(Transform(("/Cell/Turning",), TURN))
    for time, way in enumerate(ways):
        workspace.go_to(float(time))
        np.testing.assert_allclose(workspace.pose("/Cell/Turning"), by @ way, atol=1e-9)


def test_a_step_that_cannot_be_leaves_everything_as_it_was(workspace: Workspace) -> None:
    before = workspace.live.snapshot()
    for wrong in (
        SetParameter(PAINT, "n", (1e9,)),  # beyond its declared bounds: seen when the scene is read
        SetParameter(PAINT, "shininess", 1.0),
        SetParameter(EYE, "lens.f_stpo", 1.0),
        SetParameter(LAMP, "intensity", -1.0),
        Delete(("/Cell/Nothing",)),
        Duplicate(()),
        Rename(BODY, "9 lives"),
        AddLamp("candle"),
        AddMaterial("Lafortun"),
        Place(BODY, scale=(0, 1, 1)),
        Import("/nowhere/part.step"),
    ):
        with pytest.raises(BrightfieldError):
            workspace.do(wrong)
        assert workspace.live.equals(before)
        assert workspace.history.last is None


def test_what_no_edit_touched_stays_the_same_object(workspace: Workspace) -> None:
    """Renderers upload a mesh again only where it is another one."""
    meshes = {b.name: b.mesh for b in workspace.scene.bodies}
    workspace.do(Place(BODY, (0.1, 0, 0)))
    workspace.do(SetParameter(PAINT, "n", (40.0,)))
    assert {b.name: b.mesh for b in workspace.scene.bodies} == meshes


def test_a_held_slider_is_one_step(workspace: Workspace) -> None:
    before = workspace.live.snapshot()
    for k in range(5):
        workspace.do(SetParameter(LAMP, "intensity", 1.0 + k), continuing=k > 0)
    assert len(workspace.history.done) == 1
    assert len(workspace.log) == 1
    assert workspace.scene.lights[0].intensity[0] == pytest.approx(5.0)
    workspace.undo()
    assert workspace.live.equals(before)


def test_import_brings_unit_axes_and_materials(workspace: Workspace) -> None:
    """A STEP part in mm, z up, into a stage in cm, y up: as large and as coloured as on its own."""
    alone = Workspace()
    file = ASSETS / "cad" / "featuretype.STEP"
    alone.open(file)
    workspace.do(Import(str(file)))
    (path,) = workspace.selection
    np.testing.assert_allclose(workspace.bounds([path]), alone.bounds(), atol=1e-6)
    (body,) = [b for b in workspace.scene.bodies if b.name.startswith(path)]
    assert body.material.brdf == alone.scene.bodies[0].material.brdf
    assert workspace.kind(body.material.name) == "material"


def test_an_autosave_of_a_crash_is_found_and_recovered(workspace: Workspace, tmp_path: Path) -> None:
    workspace.autosave = Autosave(tmp_path)
    workspace.do(Place(BODY, (0.1, 0.2, 0.3)))
    pose = workspace.pose(BODY)
    workspace.keep()
    assert orphans(tmp_path) == []  # its editor still runs
    note = next(tmp_path.glob("*.json"))
    gone = note.read_text().replace(f'"pid": {os.getpid()}', '"pid": 999999999')
    note.write_text(gone)
    (left,) = orphans(tmp_path)
    other = Workspace()
    other.recover(left)
    np.testing.assert_array_equal(other.pose(BODY), pose)
    assert other.unsaved
    other.undo()
    assert not np.allclose(other.pose(BODY), pose)
    assert orphans(tmp_path) == []

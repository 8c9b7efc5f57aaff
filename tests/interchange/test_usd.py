"""Scenes in USD, as the file contract says."""

from pathlib import Path

import numpy as np
import pytest

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.brdf.phong import Phong
from interchange.brdf.usd_preview_surface import UsdPreviewSurface
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.formats import gprims
from interchange.formats.document import Document, open_scene
from interchange.formats.usd_author import author_scene
from interchange.formats.usd_validation import validate
from interchange.frames import apply, look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.problems import FileError, Severity
from interchange.scene import Body, Scene

BALL = gprims.sphere(0.01)
HEAD = '#usda 1.0\n(\n    metersPerUnit = {unit}\n    upAxis = "{up}"\n    {more}\n)\n'


def written(tmp_path: Path, text: str, unit: float = 0.001, up: str = "Z", more: str = "") -> Path:
    file = tmp_path / "scene.usda"
    file.write_text(
        HEAD.format(unit=unit, up=up, more=more) + text.replace(" }", "\n}")
    )  # a line a statement
    return file


def pose(*eye: float) -> np.ndarray:
    return look_at(np.array(eye), np.zeros(3)) @ np.diag([1.0, -1, -1, 1])


def made_in_python(k: int = 0) -> Scene:
    metal = Material("metal", Lafortune(0.1, [(1.2, 1.2, 1.25)], [(-0.98, -0.98, 0.99)], [25]))
    shapes = [
        Light("sphere", LightKind.SPHERE, (1, 2, 4), pose(0, 0.1, 0.3), radius=0.002),
        Light("point", LightKind.SPHERE, (1, 1, 1), pose(0.1, 0.1, 0.3)),
        Light("disk", LightKind.DISK, (1 + k, 1 + k, 1 + k), pose(0.3, 0.1, 0.3), radius=0.02),
        Light(
            "rect",
            LightKind.RECT,
            (1, 1, 1),
            pose(0.2, 0, 0.3),
            width=0.1,
            height=0.2,
            cone_angle=1.0,
            focus=2.0,
        ),
        Light("cylinder", LightKind.CYLINDER, (1, 1, 1), pose(0, -0.2, 0.3), radius=0.001, length=0.1),
        Light("distant", LightKind.DISTANT, (3, 3, 3), pose(1, 1, 1), angle=0.1),
        Light("dome", LightKind.DOME, (0.1, 0.1, 0.1)),
    ]
    lens = Lens(16e-3, distortion=(-0.1, 0.01, 0, 0, 0, 0, 0, 0))
    telecentric = Lens(projection=Projection.ORTHOGRAPHIC)
    return Scene(
        bodies=(
            Body("ball", BALL, metal, pose(0.01 * k, 0.2, 0.1)),
            Body("plate", gprims.plane(0.1, 0.2), Material("paint", UsdPreviewSurface(roughness=0.3))),
            Body("matte", gprims.box(0.02), Material("matte", Lambert(0.4))),
            Body("glossy", gprims.box(0.02), Material("glossy", Phong(0.4, 0.2, 30))),
        ),
        lights=tuple(shapes),
        cameras=(
            Camera(
                "a",
                look_at(np.array([0.1 + 0.01 * k, -0.2, 0.3]), np.zeros(3)),
                lens,
                principal_point=(300, 200.5),
            ),
            Camera(
                "b",
                look_at(np.array([0, 0, 0.3]), np.zeros(3)),
                telecentric,
                Sensor((320, 200), (1e-4, 1e-4)),
            ),
        ),
    )


@pytest.mark.parametrize("unit", [1.0, 0.001, 0.0254])
def test_a_scene_survives_writing_and_reading(tmp_path, unit):
    stage = author_scene(made_in_python(0), unit, [made_in_python(1), made_in_python(2)])
    assert Document(stage, Path("memory")).save(tmp_path / "scene.usda") == []
    back = open_scene(tmp_path / "scene.usda")
    assert back.times == [0, 1, 2]
    assert back.problems == []
    for k in range(3):
        ours, theirs = made_in_python(k), back.scene(k)
        assert [p.severity for p in back.scene_problems()] == []
        for a, b in zip(ours.bodies, theirs.bodies, strict=True):
            assert b.name.endswith(a.name)
            assert np.array_equal(a.mesh.faces, b.mesh.faces)
            ends = [apply(x.world_from_body, x.mesh.vertices) for x in (a, b)]
            assert ends[0] == pytest.approx(ends[1], abs=1e-8)  # float32 points of at most 0.1 m: 6e-9
            assert a.mesh.normals == pytest.approx(b.mesh.normals, abs=1e-6)
            assert b.material.brdf.flat() == pytest.approx(a.material.brdf.flat(), rel=1e-6)
            assert type(a.material.brdf) is type(b.material.brdf)
        for a, b in zip(ours.lights, theirs.lights, strict=True):
            assert b.kind is a.kind
            assert b.intensity == pytest.approx(a.intensity, rel=1e-6)
            for name in ("radius", "width", "height", "length", "angle", "cone_angle", "focus"):
                assert getattr(b, name) == pytest.approx(getattr(a, name), rel=1e-6)
            assert b.world_from_light == pytest.approx(a.world_from_light, abs=1e-9)
        for a, b in zip(ours.cameras, theirs.cameras, strict=True):
            assert pytest.approx(a.K, rel=1e-6) == b.K
            assert b.world_from_camera == pytest.approx(a.world_from_camera, abs=1e-9)
            assert b.lens.distortion == pytest.approx(a.lens.distortion)
            assert b.sensor.resolution == a.sensor.resolution


def test_what_does_not_change_is_the_same_object_in_every_frame(tmp_path):
    stage = author_scene(made_in_python(0), 0.001, [made_in_python(1)])
    Document(stage, Path("memory")).save(tmp_path / "scene.usda")
    document = open_scene(tmp_path / "scene.usda")
    first, second = document.scene(0), document.scene(1)
    assert [a is b for a, b in zip(first.bodies, second.bodies, strict=True)] == [False, True, True, True]
    assert first.bodies[0].mesh is second.bodies[0].mesh
    assert first.bodies[0].material is second.bodies[0].material
    assert [a is b for a, b in zip(first.lights, second.lights, strict=True)].count(False) == 1


def test_what_we_write_passes_the_validators_of_usd(tmp_path):
    Document(author_scene(made_in_python()), Path("memory")).save(tmp_path / "scene.usda")
    assert validate(open_scene(tmp_path / "scene.usda").stage) == []


def test_validators_are_not_deaf(tmp_path):
    file = written(tmp_path, 'def Shader "s" { uniform token info:id = "NoSuchShader" }')
    assert any("NoSuchShader" in p.message for p in validate(open_scene(file).stage))


def test_saving_loses_nothing_that_others_wrote(tmp_path):
    text = """
def Xform "World" (
    customData = { string robot = "line 4" }
    prepend apiSchemas = ["SomeVendorAPI"]
)
{
    custom double vendor:torque = 3.5
    rel vendor:next = </World/A>
    def UnknownType "A" { token whatever = "x" }  
    def Cube "C" { double size = 2; custom string note = "keep" }
    variantSet "v" = { "one" { custom int x = 1 } }
}
over "Elsewhere" {}
"""
    file = written(tmp_path, text)
    document = open_scene(file)
    document.stage.GetPrimAtPath("/World/C").GetAttribute("size").Set(3.0)
    document.save(tmp_path / "again.usda")
    before, after = file.read_text(), (tmp_path / "again.usda").read_text()
    for piece in (
        "vendor:torque = 3.5",
        "line 4",
        "SomeVendorAPI",
        "UnknownType",
        "keep",
        "variantSet",
        "Elsewhere",
    ):
        assert piece in before
        assert piece in after
    assert open_scene(tmp_path / "again.usda").scene().bounds[1] == pytest.approx([0.0015] * 3)


def test_a_reference_is_kept_as_a_reference_when_the_scene_moves(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/part.usda").write_text(
        '#usda 1.0\n(defaultPrim = "P")\ndef Cube "P" { double size = 4\n}'
    )
    (tmp_path / "out").mkdir()
    file = written(tmp_path, 'def "A" (references = @./parts/part.usda@) {}')
    open_scene(file).save(tmp_path / "out/moved.usda")
    assert "../parts/part.usda" in (tmp_path / "out/moved.usda").read_text()
    assert open_scene(tmp_path / "out/moved.usda").scene().bounds[1] == pytest.approx([0.002] * 3)


def test_a_failed_save_leaves_the_old_file(tmp_path, monkeypatch):
    file = written(tmp_path, 'def Cube "C" {}')
    before = file.read_bytes()
    document = open_scene(file)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(FileError, match="No space left on device"):
        document.save(file)
    assert file.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["scene.usda"]


@pytest.mark.parametrize(("up", "expected"), [("Z", [1, 2, 3]), ("Y", [1, -3, 2])])
def test_up_axis_and_unit_become_metres_with_z_up(tmp_path, up, expected):
    text = """def SphereLight "L" { double3 xformOp:translate = (1, 2, 3)
        uniform token[] xformOpOrder = ["xformOp:translate"] }"""
    light = open_scene(written(tmp_path, text, 0.01, up)).scene().lights[0]
    assert light.world_from_light[:3, 3] == pytest.approx(np.array(expected) * 0.01)


def test_apertures_are_tenths_of_a_unit_and_offsets_move_the_principal_point(tmp_path):
    """A 16 mm lens over a 7.2 x 5.4 mm sensor of 480 x 360 px: 15 µm pixels, f = 1066.67 px."""
    text = """def Camera "C" {
        float focalLength = 160
        float horizontalAperture = 72
        float verticalAperture = 54
        float horizontalApertureOffset = 1.5
        float verticalApertureOffset = -3
        custom int2 sensor:resolution = (480, 360) }"""
    camera = open_scene(written(tmp_path, text)).scene().camera()
    assert camera.sensor.pixel_pitch == pytest.approx((15e-6, 15e-6))
    assert np.diag(camera.K)[:2] == pytest.approx([1066.667, 1066.667], rel=1e-6)
    # the aperture moved 0.15 mm = 10 px to the right, 0.3 mm = 20 px down: the axis meets it left and above
    assert camera.K[:2, 2] == pytest.approx([239.5 - 10, 179.5 - 20])


@pytest.mark.parametrize(
    ("lamp", "expected"),
    [
        (
            'SphereLight "L" { float inputs:intensity = 36; bool inputs:normalize = 1; float inputs:radius = 1.5 }',
            9.0,
        ),
        (
            'SphereLight "L" { float inputs:intensity = 36; float inputs:radius = 1.5 }',
            36 * np.pi * 0.0015**2,
        ),
        ('DiskLight "L" { float inputs:intensity = 5; float inputs:radius = 10 }', 5 * np.pi * 1e-4),
        (
            'RectLight "L" { float inputs:intensity = 5; float inputs:width = 10; float inputs:height = 20 }',
            5 * 2e-4,
        ),
        ('RectLight "L" { float inputs:intensity = 5; bool inputs:normalize = 1 }', 5.0),
        (
            'CylinderLight "L" { float inputs:intensity = 5; float inputs:radius = 1; float inputs:length = 9 }',
            5 * 18e-6,
        ),
        ('CylinderLight "L" { float inputs:intensity = 5; bool inputs:normalize = 1 }', 5 / np.pi),
        ('DistantLight "L" { float inputs:intensity = 5; float inputs:angle = 0 }', 5.0),
        ('DistantLight "L" { float inputs:intensity = 5; float inputs:angle = 60 }', 5 * np.pi * 0.25),
        ('DomeLight "L" { float inputs:intensity = 5; float inputs:exposure = 1 }', 10.0),
    ],
)
def test_lamps_get_the_physical_quantity_of_their_kind(tmp_path, lamp, expected):
    """Sizes in mm, areas in m². A normalised sphere has intensity / 4 W/sr whatever its radius."""
    assert open_scene(written(tmp_path, "def " + lamp)).scene().lights[0].intensity == pytest.approx(
        [expected] * 3
    )


def test_a_scaled_lamp_is_larger(tmp_path):
    text = """def Xform "X" {
        double3 xformOp:scale = (2, 2, 2)
        uniform token[] xformOpOrder = ["xformOp:scale"]
        def RectLight "L" { float inputs:width = 10; float inputs:height = 20; bool inputs:normalize = 1 } }"""
    lamp = open_scene(written(tmp_path, text)).scene().lights[0]
    assert (lamp.width, lamp.height) == pytest.approx((0.02, 0.04))
    assert lamp.intensity == pytest.approx([1, 1, 1])


def test_point_instancer_places_each_copy(tmp_path):
    text = """def PointInstancer "I" {
        point3f[] positions = [(0, 0, 0), (10, 0, 0), (0, 20, 0)]
        int[] protoIndices = [0, 0, 0]
        int64[] invisibleIds = [1]
        rel prototypes = </I/P>
        double3 xformOp:translate = (100, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Xform "P" { double3 xformOp:translate = (0, 0, 5)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            def Cube "C" { double size = 2 } } }"""
    bodies = open_scene(written(tmp_path, text)).scene().bodies
    assert [b.name for b in bodies] == ["/I/P/C[0]", "/I/P/C[2]"]
    assert bodies[1].world_from_body[:3, 3] * 1e3 == pytest.approx([100, 20, 5])
    assert bodies[0].mesh is bodies[1].mesh


def test_instances_and_references_are_followed(tmp_path):
    text = """class "Proto" { def Cube "C" { double size = 2 } }
    def "A" (instanceable = true; references = </Proto>) {}
    def "B" (instanceable = true; references = </Proto>) { }"""
    scene = open_scene(written(tmp_path, text)).scene()
    assert [b.name for b in scene.bodies] == ["/A/C", "/B/C"]


def test_subsets_share_a_name_and_have_their_own_material(tmp_path):
    text = """
def Material "red" { token outputs:surface.connect = </red/S.outputs:surface>
    def Shader "S" { uniform token info:id = "UsdPreviewSurface"; color3f inputs:diffuseColor = (1, 0, 0)
        token outputs:surface } }
def Mesh "M" {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4, 3]
    int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0)]
    def GeomSubset "S" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </red> } }"""
    scene = open_scene(written(tmp_path, text)).scene()
    assert scene.object_names == ("/M",)
    assert [len(b.mesh.faces) for b in scene.bodies] == [2, 1]
    assert scene.bodies[1].material.brdf.diffuseColor == (1, 0, 0)
    assert scene.material_names[1] == "/red"


def test_invisible_and_guide_prims_are_not_drawn_and_visibility_follows_time(tmp_path):
    text = """def Cube "Guide" { uniform token purpose = "guide" }
    def Cube "Blink" { token visibility.timeSamples = { 0: "invisible", 1: "inherited" } }"""
    document = open_scene(written(tmp_path, text))
    assert [len(document.scene(t).bodies) for t in (0, 1)] == [0, 1]


def test_every_problem_is_told_at_once_with_file_prim_and_attribute(tmp_path):
    text = """
def Material "m" { token outputs:brdf:surface.connect = </m/B.outputs:surface>
    def Shader "B" { uniform token info:id = "Lafortun"; token outputs:surface } }
def Material "n" { token outputs:brdf:surface.connect = </n/B.outputs:surface>
    def Shader "B" { uniform token info:id = "Lambert"; color3f inputs:diffuse = (2, 0, 0)
        float inputs:difuse = 1; token outputs:surface } }
def Cube "A" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </m> }
def Cube "B" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </n> }
def Mesh "M" { int[] faceVertexCounts = [3]; int[] faceVertexIndices = [0, 1, 9]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)] }
def Camera "C" { float horizontalAperture = 0 }
def SphereLight "L" { float inputs:intensity = -1 }
"""
    file = written(tmp_path, text)
    with pytest.raises(FileError) as error:
        open_scene(file).scene()
    lines = str(error.value).splitlines()
    for part in (
        f'{file}: /m/B.info:id: No BRDF is called "Lafortun". Did you mean "Lafortune"?',
        "/n/B: Lambert.diffuse (ρ_d, diffuse albedo) must lie in [0, 1]; got 2.",
        '/n/B.inputs:difuse: Lambert has no input of this name. Did you mean "diffuse"?',
        "/M.faceVertexIndices: Indices must lie in [0, 2]; got 0 to 9.",
        "/C.horizontalAperture",
        "/L.inputs:intensity",
    ):
        assert any(part in line for line in lines), part
    assert len(lines) == 6


def test_a_missing_reference_is_an_error_of_the_scene(tmp_path):
    file = written(tmp_path, 'def "A" (references = @./nowhere.usda@) {}')
    document = open_scene(file)
    assert document.problems[0].severity is Severity.ERROR
    with pytest.raises(FileError, match="nowhere"):
        document.scene()


def test_a_broken_file_is_one_clear_error(tmp_path):
    file = tmp_path / "broken.usda"
    file.write_text('#usda 1.0\ndef Xform "A" {')
    with pytest.raises(FileError) as error:
        open_scene(file)
    assert len(str(error.value).splitlines()) == 1
    assert str(file) in str(error.value)


def test_a_unit_nobody_can_mean_is_refused(tmp_path):
    with pytest.raises(FileError, match="metersPerUnit must be above 0"):
        open_scene(written(tmp_path, 'def Cube "C" {}', unit=-1)).scene()


def test_the_digest_changes_with_what_the_scene_refers_to(tmp_path):
    (tmp_path / "part.usda").write_text('#usda 1.0\n(defaultPrim = "P")\ndef Cube "P" { double size = 4\n}')
    file = written(tmp_path, 'def "A" (references = @./part.usda@) {}')
    first = open_scene(file).digest
    del file
    other = tmp_path / "other"
    other.mkdir()
    (other / "part.usda").write_text('#usda 1.0\n(defaultPrim = "P")\ndef Cube "P" { double size = 5\n}')
    file = written(other, 'def "A" (references = @./part.usda@) {}')
    assert open_scene(file).digest != first

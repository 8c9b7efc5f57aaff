"""Stages written as COLLADA: valid by the schema, the same scene when read again, and readable by another program."""

from dataclasses import fields, replace
from pathlib import Path

import collada
import numpy as np
import pytest
from lxml import etree
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.brdf.phong import Phong
from interchange.camera import Camera, Lens, Sensor
from interchange.formats.collada.write_material import nearest_phong
from interchange.formats.collada.writer import write
from interchange.formats.document import Document, open_scene
from interchange.formats.usd_author import (
    author_camera,
    author_light,
    author_material,
    author_mesh,
    bind,
    new_stage,
)
from interchange.frames import apply, look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import from_corners
from interchange.scene import Scene

SAMPLES = Path("assets/collada")
RESOURCES = Path(collada.__file__).parent / "resources"

USDA = """#usda 1.0
(
    defaultPrim = "Line"
    metersPerUnit = 0.01
    upAxis = "Y"
    startTimeCode = 2
    endTimeCode = 6
    timeCodesPerSecond = 30
)
def Xform "Line" (kind = "component")
{
    def Xform "Arm"
    {
        double3 xformOp:translate.timeSamples = { 2: (0, 0, 0), 4: (1, 2, 3), 6: (1, 2, 9) }
        float3 xformOp:rotateXYZ = (10, 20, 30)
        float3 xformOp:rotateXYZ.timeSamples = { 2: (10, 20, 30), 6: (50, 80, 90) }
        double3 xformOp:translate:pivot = (1, 0, 0)
        float3 xformOp:scale = (1, 2, 1)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:translate:pivot", "xformOp:rotateXYZ",
            "!invert!xformOp:translate:pivot", "xformOp:scale"]
        custom string note = "left & right"
        def Mesh "Plate"
        {
            int[] faceVertexCounts = [4, 3]
            int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 2]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0.5, 0.25)]
            normal3f[] normals = [(0, 0, 1), (0, 0.6, 0.8)] (interpolation = "uniform")
            texCoord2f[] primvars:map1 = [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0.5)] (interpolation = "vertex")
            uniform token subdivisionScheme = "none"
            uniform bool doubleSided = 1
            custom float part:hardness = 62.5
        }
        def Cube "Block"
        {
            double size = 0.5
            color3f[] primvars:displayColor = [(0.25, 0.5, 0.75)]
        }
    }
    def RectLight "Bar"
    {
        float inputs:intensity = 3
        float inputs:width = 40
        float inputs:height = 5
        color3f inputs:color.timeSamples = { 2: (1, 1, 1), 6: (0, 1, 0) }
        float3 xformOp:scale = (2, 1, 1)
        uniform token[] xformOpOrder = ["xformOp:scale"]
    }
    def SphereLight "Spot" (prepend apiSchemas = ["ShapingAPI"])
    {
        float inputs:intensity = 7
        bool inputs:normalize = 1
        float inputs:radius = 0.5
        float inputs:shaping:cone:angle = 35
        float inputs:shaping:focus = 2
    }
    def Camera "Eye"
    {
        float focalLength = 35
        float horizontalAperture = 11
        float verticalAperture = 7
        float horizontalApertureOffset = 0.25
        int2 sensor:resolution = (1100, 700)
        float[] lens:distortion = [-0.1, 0.02, 0, 0, 0, 0, 0, 0]
        quatf xformOp:orient.timeSamples = { 2: (1, 0, 0, 0), 6: (0.70710677, 0, 0.70710677, 0) }
        uniform token[] xformOpOrder = ["xformOp:orient"]
    }
}
"""


@pytest.fixture(scope="module")
def schema() -> etree.XMLSchema:
    class Local(etree.Resolver):
        def resolve(self, url: str, _: object, context: object) -> object:
            return self.resolve_filename(str(RESOURCES / "xsd.xml"), context) if "xml.xsd" in url else None

    parser = etree.XMLParser(no_network=True)
    parser.resolvers.add(Local())
    return etree.XMLSchema(etree.parse(str(RESOURCES / "schema-1.4.1.xml"), parser))


def document(stage: Usd.Stage) -> Document:
    return Document(stage, Path("made-here.usda"))


def again(made: Document, tmp_path: Path, schema: etree.XMLSchema) -> Document:
    path = tmp_path / "again.dae"
    made.save(path)
    schema.assertValid(etree.parse(str(path)))
    return open_scene(path)


def assert_same(a: Scene, b: Scene) -> None:
    """Equal bodies, lamps and cameras, up to the rounding of single precision."""
    assert [x.name for x in a.bodies] == [x.name for x in b.bodies]
    for x, y in zip(a.bodies, b.bodies, strict=True):
        np.testing.assert_allclose(
            apply(x.world_from_body, x.mesh.vertices)[x.mesh.faces],
            apply(y.world_from_body, y.mesh.vertices)[y.mesh.faces],
            atol=1e-6,
        )
        np.testing.assert_allclose(x.mesh.normals[x.mesh.faces], y.mesh.normals[y.mesh.faces], atol=1e-5)
        assert (x.mesh.uv is None) == (y.mesh.uv is None)
        if x.mesh.uv is not None and y.mesh.uv is not None:
            np.testing.assert_allclose(x.mesh.uv[x.mesh.faces], y.mesh.uv[y.mesh.faces], atol=1e-6)
        mx, my = (m.material for m in (x, y))
        assert (mx.brdf, mx.emission, mx.opacity, mx.glsl) == (my.brdf, my.emission, my.opacity, my.glsl)
        assert {k: t.file for k, t in mx.maps.items()} == {k: t.file for k, t in my.maps.items()}
    for kind in ("lights", "cameras"):
        assert [x.name for x in getattr(a, kind)] == [x.name for x in getattr(b, kind)]
        for x, y in zip(getattr(a, kind), getattr(b, kind), strict=True):
            for field in fields(x):
                u, v = getattr(x, field.name), getattr(y, field.name)
                if field.name.startswith("world_from"):
                    np.testing.assert_allclose(u, v, atol=1e-7)
                elif field.name == "clip":  # the one number here that USD keeps in single precision
                    np.testing.assert_allclose(u, v, rtol=2**-24)
                elif field.compare and field.name not in ("texture", "profile"):
                    assert u == v, (x.name, field.name)


@pytest.mark.parametrize(
    "path",
    [p for p in sorted(SAMPLES.rglob("*.[dD][aA][eE]")) if p.stem != "cube_emptyTags"],
    ids=lambda p: p.stem,
)
def test_samples_come_back_equal(path: Path, tmp_path: Path, schema: etree.XMLSchema) -> None:
    first = open_scene(path)
    second = again(first, tmp_path, schema)
    assert first.times == second.times
    for time in first.times[:: max(1, len(first.times) // 5)]:
        assert_same(first.scene(time), second.scene(time))


def test_stage_comes_back_equal(tmp_path: Path, schema: etree.XMLSchema) -> None:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(USDA)
    first = document(Usd.Stage.Open(layer))
    second = again(first, tmp_path, schema)
    assert first.times == second.times == [2.0, 3.0, 4.0, 5.0, 6.0]
    for time in first.times:
        a, b = first.scene(time), second.scene(time)
        assert_same(a, b)
    prim = second.stage.GetPrimAtPath("/Line/Arm/Plate")
    assert prim.GetAttribute("part:hardness").Get() == 62.5
    assert prim.GetAttribute("doubleSided").Get() is True
    assert second.stage.GetPrimAtPath("/Line/Arm").GetAttribute("note").Get() == "left & right"
    lost = first.save(tmp_path / "lost.dae")
    assert any("Cube is written as its triangles" in p.message and p.severity == "loss" for p in lost)
    assert any("without size or profile" in p.message and p.where.prim == "/Line/Bar" for p in lost)


def square() -> object:
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    return from_corners(corners, np.array([[0, 1, 2], [0, 2, 3]]))


FRAGMENT = "vec3 brdf(vec3 wi, vec3 wo, vec2 uv) { return wi.z < 0.5 ? vec3(0.1) : vec3(0.2); }\n"
WORN = [
    Material("matte", Lambert((0.1, 0.2, 0.3)), emission=(1.0, 2.0, 3.0)),
    Material("shiny", Phong((0.1, 0.2, 0.3), (0.5, 0.4, 0.3), 33.0), opacity=0.25),
    Material(
        "two_lobes",
        Lafortune(0.1, ((1, 1, 1), (0.5, 0.25, 0.125)), ((-1, -1, 0.9), (0.5, 0.5, 0.5)), (20, 3)),
    ),
    Material("fragment", glsl=FRAGMENT),
]


@pytest.mark.parametrize("version", ["1.4.1", "1.5.0"])
def test_materials_travel_exactly(tmp_path: Path, schema: etree.XMLSchema, version: str) -> None:
    stage = new_stage(0.001)
    for i, material in enumerate(WORN):
        prim = author_mesh(stage, f"/World/square{i}", square())  # type: ignore[arg-type]
        bind(prim, author_material(stage, f"/World/Materials/{material.name}", material))
    author_material(stage, "/World/Materials/spare", WORN[0])
    path = tmp_path / "a.dae"
    write(stage, path, version=version)
    if version == "1.4.1":
        schema.assertValid(etree.parse(str(path)))
    read = open_scene(path)
    assert_same(document(stage).scene(), read.scene())
    assert read.stage.GetPrimAtPath("/World/Materials/spare")
    text = path.read_text()
    assert "model(vec3 wi, vec3 wo" in text  # the GLSL that follows from a model's formula
    assert "wi.z &lt; 0.5" in text


def test_common_profile_is_what_the_brdf_is(tmp_path: Path) -> None:
    """Without our <extra> the materials that COLLADA has words for are still the same."""
    stage = new_stage(0.001)
    for i, material in enumerate(WORN[:2]):
        prim = author_mesh(stage, f"/World/square{i}", square())  # type: ignore[arg-type]
        bind(prim, author_material(stage, f"/World/Materials/{material.name}", material))
    path = tmp_path / "a.dae"
    write(stage, path)
    tree = etree.parse(str(path))
    for extra in tree.findall(".//{*}extra"):
        extra.getparent().remove(extra)
    tree.write(str(path))
    for body, material in zip(open_scene(path).scene().bodies, WORN, strict=False):
        np.testing.assert_allclose(body.material.brdf.flat(), material.brdf.flat(), rtol=1e-6)
        assert body.material.opacity == material.opacity
        assert body.material.emission == material.emission


def test_nearest_phong_of_a_phong_is_itself() -> None:
    """The fit finds k_d, pi k_s and n of a BRDF that is a Phong; n from its grid of 40 steps to 10^4."""
    diffuse, specular, n = nearest_phong(Phong((0.1, 0.2, 0.3), (0.5, 0.4, 0.3), 100.0))
    np.testing.assert_allclose(diffuse, (0.1, 0.2, 0.3), atol=1e-5)
    np.testing.assert_allclose(specular, np.pi * np.array((0.5, 0.4, 0.3)), rtol=1e-4)
    assert n == pytest.approx(100, rel=1e-3)


def test_lights_without_extra_have_the_same_intensity(tmp_path: Path) -> None:
    """What other programs read: quadratic attenuation and colour give the lamp's radiant intensity."""
    stage = new_stage(0.001)
    author_mesh(stage, "/World/square", square())  # type: ignore[arg-type]
    lamps = [
        Light("point", LightKind.SPHERE, (3.0, 2.0, 1.0)),
        Light("sun", LightKind.DISTANT, (3.0, 2.0, 1.0)),
        Light("sky", LightKind.DOME, (3.0, 2.0, 1.0)),
        Light("spot", LightKind.SPHERE, (3.0, 2.0, 1.0), cone_angle=np.radians(30), focus=4.0),
    ]
    for light in lamps:
        author_light(stage, f"/World/{light.name}", light)
    path = tmp_path / "a.dae"
    write(stage, path)
    tree = etree.parse(str(path))
    for extra in tree.findall(".//{*}extra"):
        extra.getparent().remove(extra)
    tree.write(str(path))
    read = {light.name.split("/")[-1].split("_")[0]: light for light in open_scene(path).scene().lights}
    for light in lamps:
        np.testing.assert_allclose(read[light.name].intensity, light.intensity, rtol=1e-5)
    assert read["spot"].cone_angle == pytest.approx(np.radians(30), rel=1e-5)
    assert read["spot"].focus == 4.0


def test_attenuation_of_a_collada_file_comes_back(tmp_path: Path) -> None:
    text = (SAMPLES / "conformance" / "foreign_extras.dae").read_text()
    path = tmp_path / "a.dae"
    path.write_text(
        text.replace(
            "<color>0 0 0.5</color>", "<color>0 0 0.5</color><linear_attenuation>2</linear_attenuation>"
        )
    )
    open_scene(path).save(tmp_path / "b.dae")
    point = etree.parse(str(tmp_path / "b.dae")).find(".//{*}point")
    assert point.findtext("{*}color") == "0.0 0.0 0.5"
    names = ("constant", "linear", "quadratic")
    assert [point.findtext(f"{{*}}{name}_attenuation") for name in names] == ["1.0", "2.0", "0.0"]


def test_other_programs_extras_come_back(tmp_path: Path) -> None:
    source = SAMPLES / "conformance" / "foreign_extras.dae"
    open_scene(source).save(tmp_path / "a.dae")

    def extras(path: Path) -> list[str]:
        found = etree.parse(str(path)).findall(".//{*}light//{*}extra")
        own = [e for e in found if e.find("{*}technique[@profile='brightfield']") is None]
        return sorted(" ".join("".join(e.itertext()).split()) for e in own)

    assert extras(tmp_path / "a.dae") == extras(source) != []


def test_several_scenes_become_visual_scenes_again(tmp_path: Path, schema: etree.XMLSchema) -> None:
    made = again(open_scene(SAMPLES / "conformance" / "several_visual_scenes.dae"), tmp_path, schema)
    scenes = etree.parse(str(made.path)).findall(".//{*}visual_scene")
    assert [s.get("id") for s in scenes] == ["VisualSceneNode1", "VisualSceneNode2", "VisualSceneNode3"]


def test_instances_are_drawn_where_they_stand(tmp_path: Path, schema: etree.XMLSchema) -> None:
    stage = new_stage(0.001)
    instancer = UsdGeom.PointInstancer.Define(stage, "/World/Screws")
    author_mesh(stage, "/World/Screws/Screw", square())  # type: ignore[arg-type]
    instancer.CreatePrototypesRel().AddTarget("/World/Screws/Screw")
    instancer.CreateProtoIndicesAttr([0, 0, 0])
    instancer.CreatePositionsAttr([(0, 0, 0), (5, 0, 0), (0, 7, 1)])
    instancer.CreateScalesAttr([(1, 1, 1), (2, 2, 2), (1, 3, 1)])
    first = document(stage)
    a, b = first.scene(), again(first, tmp_path, schema).scene()
    corners = [
        np.concatenate([apply(x.world_from_body, x.mesh.vertices)[x.mesh.faces] for x in s.bodies])
        for s in (a, b)
    ]
    np.testing.assert_allclose(corners[0], corners[1], atol=1e-9)
    tree = etree.parse(str(tmp_path / "again.dae"))
    assert len(tree.findall(".//{*}geometry")) == 1


def test_subsets_and_textures(tmp_path: Path, schema: etree.XMLSchema) -> None:
    stage = new_stage(1.0, "Y")
    prim = author_mesh(stage, "/World/square", replace(square(), uv=np.eye(4)[:, :2]))  # type: ignore[type-var]
    for k, name in enumerate(("left", "right")):
        subset = UsdGeom.Subset.CreateGeomSubset(
            prim, name, UsdGeom.Tokens.face, Vt.IntArray([k]), UsdShade.Tokens.materialBind
        )
        usd = author_material(stage, f"/World/Materials/{name}", Material(name, Lambert(0.25 * (k + 1))))
        bind(subset, usd)
    image = UsdShade.Shader.Define(stage, "/World/Materials/left/Image")
    image.CreateIdAttr("UsdUVTexture")
    checkerboard = (SAMPLES / "conformance" / "checkerboard.png").absolute()
    image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(str(checkerboard))
    brdf = UsdShade.Shader.Get(stage, "/World/Materials/left/Brdf")
    brdf.GetInput("diffuse").ConnectToSource(image.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
    first = document(stage)
    second = again(first, tmp_path, schema)
    assert_same(first.scene(), second.scene())
    assert [len(b.mesh.faces) for b in second.scene().bodies] == [1, 1]
    uri = etree.parse(str(tmp_path / "again.dae")).findtext(".//{*}image/{*}init_from")
    assert uri.startswith("../")
    assert (tmp_path / uri).samefile(checkerboard)


def test_pycollada_reads_the_same(tmp_path: Path) -> None:
    """Another reader: triangles in the world, the lamp's kind, the camera's angle, the material's terms."""
    stage = new_stage(0.001)
    pose = np.array([[0.0, -2, 0, 0.01], [1, 0, 0, 0.02], [0, 0, 1, 0.03], [0, 0, 0, 1]])
    prim = author_mesh(stage, "/World/square", square())  # type: ignore[arg-type]
    UsdGeom.Xformable(prim).AddTransformOp().Set(Gf.Matrix4d((pose @ np.diag([1, 1, 1, 1])).T.tolist()))
    bind(prim, author_material(stage, "/World/Materials/shiny", WORN[1]))
    author_light(stage, "/World/Sun", Light("sun", LightKind.DISTANT, (np.pi, np.pi, 0.0)))
    sensor = Sensor(resolution=(200, 100), pixel_pitch=(1e-5, 1e-5))
    author_camera(
        stage, "/World/Eye", Camera("eye", look_at(np.array([0, -1, 0.5]), np.zeros(3)), Lens(), sensor)
    )
    path = tmp_path / "a.dae"
    write(stage, path)
    other = collada.Collada(str(path))
    assert other.assetInfo.unitmeter == 0.001
    (bound,) = other.scene.objects("geometry")
    (polygons,) = bound.primitives()
    ours = document(stage).scene().bodies[0]
    theirs = np.asarray(polygons.triangleset().vertex)[polygons.triangleset().vertex_index] * 1e-3
    np.testing.assert_allclose(
        theirs, apply(ours.world_from_body, ours.mesh.vertices)[ours.mesh.faces], atol=1e-6
    )
    effect = polygons.material.effect
    assert effect.shadingtype == "phong"
    np.testing.assert_allclose(effect.specular[:3], np.pi * np.array([0.5, 0.4, 0.3]), rtol=1e-6)
    (sun,) = other.scene.objects("light")
    np.testing.assert_allclose(sun.color[:3], (1, 1, 0), atol=1e-6)
    (eye,) = other.scene.objects("camera")
    assert np.tan(np.radians(eye.yfov) / 2) == pytest.approx(100 * 1e-5 / (2 * Lens().focal_length), rel=1e-5)


def test_what_cannot_be_carried_is_listed(tmp_path: Path) -> None:
    stage = new_stage(1.0)
    UsdGeom.BasisCurves.Define(stage, "/World/Hair")
    UsdGeom.Xform.Define(stage, "/World/Hidden").MakeInvisible()
    UsdLux.PortalLight.Define(stage, "/World/Window")
    guide = UsdGeom.Xform.Define(stage, "/World/Guide")
    guide.CreatePurposeAttr(UsdGeom.Tokens.guide)
    lost = {p.where.prim: p.severity for p in write(stage, tmp_path / "a.dae")}
    assert lost == dict.fromkeys(["/World/Hair", "/World/Hidden", "/World/Window", "/World/Guide"], "loss")

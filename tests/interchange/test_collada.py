"""COLLADA files as scenes: the numbers of the file, and the conformance suite's pairs that must look alike."""

from pathlib import Path

import numpy as np
import pytest

from interchange.camera import Projection
from interchange.formats.document import open_scene
from interchange.frames import apply
from interchange.light import LightKind
from interchange.problems import FileError
from interchange.scene import Scene

ASSETS = Path("assets/collada")
SUITE = ASSETS / "conformance"
NAMESPACE = {
    "1.4.1": "http://www.collada.org/2005/11/COLLADASchema",
    "1.5.0": "http://www.collada.org/2008/03/COLLADASchema",
}


def source(name: str, numbers: str, params: str, offset: int = 0, stride: int | None = None) -> str:
    names = params.split()
    count, width = len(numbers.split()), stride or len(names)
    columns = "".join(
        f'<param name="{n}" type="float"/>' if n != "-" else '<param type="float"/>' for n in names
    )
    return (
        f'<source id="{name}"><float_array id="{name}-array" count="{count}">{numbers}</float_array>'
        f'<technique_common><accessor source="#{name}-array" count="{(count - offset) // width}" offset="{offset}" '
        f'stride="{width}">{columns}</accessor></technique_common></source>'
    )


SQUARE = (
    f'<geometry id="square"><mesh>{source("p", "0 0 0 1 0 0 1 1 0 0 1 0", "X Y Z")}'
    '<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
    '<polylist count="1" material="m"><input semantic="VERTEX" source="#v" offset="0"/>'
    "<vcount>4</vcount><p>0 1 2 3</p></polylist></mesh></geometry>"
)
INSTANCE = '<instance_geometry url="#square"/>'


def collada(
    tmp_path: Path,
    nodes: str = "",
    geometry: str = "",
    libraries: str = "",
    asset: str = '<unit meter="1"/><up_axis>Z_UP</up_axis>',
    version: str = "1.4.1",
) -> Path:
    path = tmp_path / "a.dae"
    path.write_text(
        f'<?xml version="1.0"?><COLLADA xmlns="{NAMESPACE[version]}" version="{version}"><asset>{asset}</asset>'
        f"<library_geometries>{geometry or SQUARE}</library_geometries>{libraries}"
        f'<library_visual_scenes><visual_scene id="s">{nodes or f"<node>{INSTANCE}</node>"}</visual_scene>'
        '</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )
    return path


def triangles(scene: Scene) -> np.ndarray:
    """(T, 3, 3) world corners."""
    return np.concatenate([apply(b.world_from_body, b.mesh.vertices)[b.mesh.faces] for b in scene.bodies])


def area(scene: Scene) -> float:
    t = triangles(scene)
    return float(np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum() / 2)


def shown(path: Path) -> Scene:
    """The scene that the file itself shows, of several."""
    document = open_scene(path)
    said = [p.message for p in document.problems if "the file shows" in p.message]
    return document.scene(float(said[0].rstrip(".").rsplit(" ", 1)[1]) if said else None)


PAIRS = [
    ("foot_15", "reference_unit"),
    ("x_up_15", "reference_up_axis"),
    ("unitandup", "reference_unitandup"),
    ("several_visual_scenes", "reference_hexagon"),
    ("node_matrix_cube2", "reference_rotate_x"),
    ("node_matrix_cube3", "reference_translate_xyz"),
    ("node_lookat4", "reference_pyramid_rotate_y"),
    ("polygons_polylist_triangles", "reference_polygons_polylist_triangles"),
    ("2insts", "reference_2insts"),
    ("external_geometry", "reference_geometry"),
]


@pytest.mark.parametrize(("case", "reference"), PAIRS)
def test_conformance_case_shows_what_its_reference_shows(case: str, reference: str) -> None:
    a, b = shown(SUITE / f"{case}.dae"), shown(SUITE / f"{reference}.dae")
    ta, tb = triangles(a), triangles(b)
    size = np.ptp(tb.reshape(-1, 3), axis=0).max()
    # the suite's decimals: five digits
    assert area(a) == pytest.approx(area(b), rel=1e-4)
    for x, y in ((ta.min((0, 1)), tb.min((0, 1))), (ta.max((0, 1)), tb.max((0, 1)))):
        np.testing.assert_allclose(x, y, atol=1e-4 * size)


DANGLING = ASSETS / "importers" / "cube_emptyTags.dae"


@pytest.mark.parametrize("path", sorted({*ASSETS.rglob("*.[dD][aA][eE]")} - {DANGLING}), ids=lambda p: p.stem)
def test_every_sample_loads(path: Path) -> None:
    assert open_scene(path).scene().source == str(path)


def test_dangling_references_are_named_all_at_once() -> None:
    with pytest.raises(FileError, match='There is no camera "#PerspCamera"') as caught:
        open_scene(DANGLING)
    assert len(caught.value.problems) == 5


@pytest.mark.parametrize(
    ("unit", "axis", "corner"),
    [("0.001", "Z_UP", (1, 1, 0)), ("0.0254", "Y_UP", (1, 0, 1)), ("1", "X_UP", (-1, 0, 1))],
)
def test_units_and_up_axis(tmp_path: Path, unit: str, axis: str, corner: tuple[float, ...]) -> None:
    """COLLADA's table: Y_UP has right x, in -z; X_UP right -y, in z; Z_UP right x, in y."""
    path = collada(tmp_path, asset=f'<unit meter="{unit}"/><up_axis>{axis}</up_axis>')
    corners = triangles(open_scene(path).scene()).reshape(-1, 3)
    far = corners[np.argmax(np.linalg.norm(corners, axis=1))]
    np.testing.assert_allclose(far, np.array(corner) * float(unit), atol=1e-9)


@pytest.mark.parametrize(
    ("element", "expected"),
    [
        ("<translate>1 2 3</translate>", [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]]),
        ("<scale>2 3 4</scale>", [[2, 0, 0, 0], [0, 3, 0, 0], [0, 0, 4, 0]]),
        ("<rotate>0 0 2 90</rotate>", [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]]),
        ("<rotate>1 1 1 120</rotate>", [[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0]]),
        ("<matrix>1 2 3 4 0 1 0 5 0 0 1 6 0 0 0 1</matrix>", [[1, 2, 3, 4], [0, 1, 0, 5], [0, 0, 1, 6]]),
        ("<skew>45 1 0 0 0 1 0</skew>", [[1, 0, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0]]),
        ("<lookat>1 2 3 1 2 0 0 1 0</lookat>", [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]]),
        (
            "<translate>1 0 0</translate><rotate>0 0 1 90</rotate><scale>2 1 1</scale><translate>0 1 0</translate>",
            [[0, -1, 0, 0], [2, 0, 0, 0], [0, 0, 1, 0]],
        ),
    ],
)
def test_node_transforms_are_a_product_in_their_order(tmp_path: Path, element: str, expected: object) -> None:
    path = collada(tmp_path, f"<node>{element}{INSTANCE}</node>")
    np.testing.assert_allclose(open_scene(path).scene().bodies[0].world_from_body[:3], expected, atol=1e-7)


HOLE = source("p", "0 0 0 4 0 0 4 4 0 0 4 0 1 1 0 3 1 0 3 3 0 1 3 0", "X Y Z")
L_SHAPE = source("p", "0 0 0 2 0 0 2 1 0 1 1 0 1 2 0 0 2 0", "X Y Z")
STRIP = source("p", "0 0 0 1 0 0 0 1 0 1 1 0 0 2 0 1 2 0", "X Y Z")
PADDED = source("p", "9 0 0 0 7 1 0 0 7 1 1 0 7 0 1 0 7", "X Y Z -", offset=1, stride=4)


@pytest.mark.parametrize(
    ("points", "primitive", "wanted"),
    [
        (HOLE, '<polygons count="1">{}<ph><p>0 1 2 3</p><h>4 5 6 7</h></ph></polygons>', 12.0),
        (HOLE, '<polygons count="2">{}<p>4 5 6 7</p><ph><p>0 1 2 3</p><h>7 6 5 4</h></ph></polygons>', 16.0),
        (L_SHAPE, '<polygons count="1">{}<p>3 4 5 0 1 2</p></polygons>', 3.0),
        (L_SHAPE, '<polylist count="1">{}<vcount>6</vcount><p>0 1 2 3 4 5</p></polylist>', 3.0),
        (STRIP, '<tristrips count="1">{}<p>0 1 2 3 4 5</p></tristrips>', 2.0),
        (STRIP, '<trifans count="2">{}<p>0 1 3 2</p><p>2 3 5 4</p></trifans>', 2.0),
        (PADDED, '<triangles count="2">{}<p>0 1 2 0 2 3</p></triangles>', 1.0),
    ],
)
def test_polygons_of_every_kind_have_their_area(
    tmp_path: Path, points: str, primitive: str, wanted: float
) -> None:
    inputs = '<input semantic="VERTEX" source="#v" offset="0"/>'
    mesh = f'{points}<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{primitive.format(inputs)}'
    path = collada(tmp_path, geometry=f'<geometry id="square"><mesh>{mesh}</mesh></geometry>')
    scene = open_scene(path).scene()
    assert area(scene) == pytest.approx(wanted, abs=1e-9)
    t = triangles(scene)
    assert (np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])[:, 2] > 0).all()


def test_lines_are_left_out_with_a_note(tmp_path: Path) -> None:
    lines = '<lines count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1</p></lines></mesh>'
    document = open_scene(collada(tmp_path, geometry=SQUARE.replace("</mesh>", lines)))
    assert len(document.scene().bodies) == 1
    assert any("<lines> have no surface" in p.message and p.severity == "loss" for p in document.problems)


def lamp(kind: str) -> tuple[str, str]:
    library = (
        f'<library_lights><light id="l"><technique_common>{kind}</technique_common></light></library_lights>'
    )
    node = '<node><translate>0.5 0.5 2</translate><instance_light url="#l"/></node>'
    return f"<node>{INSTANCE}</node>{node}", library


def test_lights_follow_the_lighting_equation(tmp_path: Path) -> None:
    """A Lambertian surface k_d under colour I shows k_d I: irradiance pi I; an ambient light I is a dome I."""
    for kind, expected, number in (
        ("<directional><color>1 0.5 0</color></directional>", LightKind.DISTANT, np.pi),
        ("<ambient><color>1 0.5 0</color></ambient>", LightKind.DOME, 1.0),
    ):
        nodes, library = lamp(kind)
        light = open_scene(collada(tmp_path, nodes, libraries=library)).scene().lights[0]
        assert light.kind is expected
        np.testing.assert_allclose(light.intensity, number * np.array([1, 0.5, 0]), rtol=1e-6)


@pytest.mark.parametrize("unit", [1.0, 0.01])
@pytest.mark.parametrize(
    ("constant", "linear", "quadratic"), [(0, 0, 1), (0, 0, 0.25), (1, 0, 0), (1, 0.5, 2)]
)
def test_attenuation_is_right_at_the_scene_centre(
    tmp_path: Path, unit: float, constant: float, linear: float, quadratic: float
) -> None:
    nodes, library = lamp(
        f"<point><color>1 1 1</color><constant_attenuation>{constant}</constant_attenuation>"
        f"<linear_attenuation>{linear}</linear_attenuation>"
        f"<quadratic_attenuation>{quadratic}</quadratic_attenuation></point>"
    )
    asset = f'<unit meter="{unit}"/><up_axis>Z_UP</up_axis>'
    document = open_scene(collada(tmp_path, nodes, libraries=library, asset=asset))
    distance = 2.0  # of the file's units
    irradiance = document.scene().lights[0].intensity[0] / (distance * unit) ** 2
    wanted = np.pi / (constant + linear * distance + quadratic * distance**2)
    assert irradiance == pytest.approx(wanted, rel=1e-5)
    lost = any("not an inverse square" in p.message and p.severity == "loss" for p in document.problems)
    assert lost == bool(constant or linear)


def test_spot_cone_and_exponent(tmp_path: Path) -> None:
    """falloff_angle is the whole cone; the exponent is a power of the cosine."""
    spot = "<spot><color>1 1 1</color><falloff_angle>60</falloff_angle><falloff_exponent>3</falloff_exponent></spot>"
    nodes, library = lamp(spot)
    light = open_scene(collada(tmp_path, nodes, libraries=library)).scene().lights[0]
    angle = np.radians([0.0, 20.0, 29.0, 31.0])
    direction = np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=1)
    np.testing.assert_allclose(
        light.shaping(direction)[:, 0], np.cos(angle) ** 3 * (angle < np.pi / 6), rtol=1e-6
    )


def test_lamps_and_cameras_take_no_scale_from_their_nodes(tmp_path: Path) -> None:
    library = (
        '<library_cameras><camera id="c"><optics><technique_common><perspective><yfov>40</yfov>'
        "<aspect_ratio>1</aspect_ratio><znear>1</znear><zfar>9</zfar></perspective></technique_common></optics>"
        "</camera></library_cameras>" + lamp("<point><color>1 1 1</color></point>")[1]
    )
    node = "<node><translate>1 2 3</translate><scale>2 3 4</scale><rotate>0 0 1 30</rotate>{}</node>"
    nodes = node.format('<instance_camera url="#c"/><instance_light url="#l"/>') + f"<node>{INSTANCE}</node>"
    scene = open_scene(collada(tmp_path, nodes, libraries=library)).scene()
    for pose in (scene.cameras[0].world_from_camera, scene.lights[0].world_from_light):
        np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-7)
        np.testing.assert_allclose(pose[:3, 3], [1, 2, 3], atol=1e-7)


@pytest.mark.parametrize(
    ("optics", "half"),
    [
        (
            "<perspective><yfov>60</yfov><aspect_ratio>1.5</aspect_ratio>{}</perspective>",
            (0.8660254, 0.5773503),
        ),
        (
            "<perspective><xfov>60</xfov><aspect_ratio>1.5</aspect_ratio>{}</perspective>",
            (0.5773503, 0.3849002),
        ),
        ("<perspective><xfov>90</xfov><yfov>60</yfov>{}</perspective>", (1.0, 0.5773503)),
        ("<orthographic><xmag>3</xmag><aspect_ratio>1.5</aspect_ratio>{}</orthographic>", (3.0, 2.0)),
        ("<orthographic><ymag>2</ymag><aspect_ratio>1.5</aspect_ratio>{}</orthographic>", (3.0, 2.0)),
    ],
)
def test_cameras_see_what_the_file_says(tmp_path: Path, optics: str, half: tuple[float, float]) -> None:
    clip = "<znear>1</znear><zfar>9</zfar>"
    library = (
        f'<library_cameras><camera id="c"><optics><technique_common>{optics.format(clip)}</technique_common></optics>'
        "</camera></library_cameras>"
    )
    nodes = '<node><translate>0 0 1</translate><instance_camera url="#c"/></node>'
    asset = '<unit meter="0.01"/><up_axis>Z_UP</up_axis>'
    camera = open_scene(collada(tmp_path, nodes, libraries=library, asset=asset)).scene().cameras[0]
    unit = 0.01 if camera.lens.projection is Projection.ORTHOGRAPHIC else 1.0
    K, (width, height) = camera.K, camera.sensor.resolution
    # half the image over the focal length, in px; height is rounded to whole pixels
    assert width / (2 * K[0, 0]) == pytest.approx(half[0] * unit, rel=1e-5)
    assert height / (2 * K[1, 1]) == pytest.approx(half[1] * unit, rel=1e-5)
    assert camera.clip == pytest.approx((0.01, 0.09))
    np.testing.assert_allclose(camera.world_from_camera[:3, 2], [0, 0, -1], atol=1e-12)


def test_several_visual_scenes_are_frames_in_their_order() -> None:
    document = open_scene(SUITE / "several_visual_scenes.dae")
    assert document.times == [0.0, 1.0, 2.0]
    names = [{b.name.split("/")[2] for b in document.scene(t).bodies} for t in document.times]
    assert names == [{"VisualSceneNode1"}, {"VisualSceneNode2"}, {"VisualSceneNode3"}]


def test_utf16_and_special_characters() -> None:
    utf8, utf16 = (
        open_scene(ASSETS / "importers" / f"cube_{name}.dae").scene() for name in ("UTF8BOM", "UTF16LE")
    )
    np.testing.assert_allclose(triangles(utf8), triangles(utf16))
    assert open_scene(ASSETS / "importers" / "cube_xmlspecialchars.dae").scene().bodies

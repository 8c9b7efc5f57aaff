"""STL, OBJ, PLY and OFF: what was written comes back, in metres; what is damaged is told."""

import re
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from interchange.brdf.blinn_phong import BlinnPhong
from interchange.brdf.lambert import Lambert
from interchange.formats.mesh_files import ALSO, UNITS, metres_per_unit
from interchange.formats.surface import CREASE_DEG, Findings, crease_mesh, describe, weld
from interchange.problems import FileError, Severity
from tests.interchange.opened import only_body, read, write

PARTS = Path(__file__).parents[2] / "assets" / "cad"
BOX = trimesh.creation.box((2.0, 3.0, 5.0))


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "ply", "ply_ascii", "off", "obj"])
@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("inch", 0.0254), ("m", 1.0), ("µm", 1e-6)])
def test_a_box_has_its_size_volume_and_outside(kind, unit, metres, tmp_path):
    path = tmp_path / f"box.{kind.split('_')[0]}"
    more = {"encoding": "ascii"} if kind == "ply_ascii" else {}
    BOX.export(path, file_type=kind.removesuffix("_ascii") if kind == "ply_ascii" else kind, **more)
    document = read(path, unit)
    body = only_body(document)
    low, high = document.scene().bounds
    np.testing.assert_allclose(high - low, np.array([2, 3, 5]) * metres, rtol=1e-6)  # float32 in most files
    solid = trimesh.Trimesh(body.mesh.vertices, body.mesh.faces, process=False)
    assert solid.volume == pytest.approx(30 * metres**3, rel=1e-5)  # positive: wound from outside
    n = body.mesh.normals[body.mesh.faces]
    np.testing.assert_allclose(
        n, np.repeat(solid.face_normals[:, None], 3, axis=1), atol=1e-6
    )  # 90° edges are hard
    assert len(body.mesh.vertices) == 24
    assert document.problems == []


@pytest.mark.parametrize("unit", [None, "furlong", "inhc", ""])
@pytest.mark.parametrize("suffix", ["stl", "ply", "off", "obj"])
def test_without_a_known_unit_the_error_says_what_would_come_out(unit, suffix, tmp_path):
    path = tmp_path / f"box.{suffix}"
    BOX.export(path)
    with pytest.raises(FileError) as error:
        read(path, unit)
    text = str(error.value)
    assert "\n" not in text
    if unit is None:
        assert "--unit mm: 5 mm, --unit in: 127 mm, --unit m: 5 m" in text
    else:
        assert f'"{unit}" is not a known unit' in text
    assert ('Did you mean "in' in text) == (unit == "inhc")


def test_units_by_their_definition():
    assert metres_per_unit("Inches") == 0.0254
    assert metres_per_unit("ft") == pytest.approx(12 * UNITS["in"])
    assert metres_per_unit("yd") == pytest.approx(36 * UNITS["in"])
    assert metres_per_unit("thou") == pytest.approx(UNITS["in"] / 1000)
    assert set(ALSO.values()) <= set(UNITS)


def test_the_part_in_inches_has_the_size_of_its_step_file():
    low, high = read(PARTS / "featuretype.STL", "in").scene().bounds
    np.testing.assert_allclose((high - low) * 1e3, [127, 63.5, 34.925], atol=2e-3)  # drawn to 2e-3 mm


def test_welding_closes_what_rounding_opened():
    """Its zeros are 1e-17 in one facet and 0 in the next."""
    assert read(PARTS / "featuretype.STL", "in").problems == []
    mesh = trimesh.load_mesh(PARTS / "featuretype.STL", process=False)
    points, faces = weld(np.array(mesh.vertices), np.array(mesh.faces))
    assert trimesh.Trimesh(points, faces, process=False).is_watertight


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_welding_keeps_every_corner_in_its_place(seed):
    rng = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(1)
    soup = np.array(ball.triangles) + rng.uniform(-1e-8, 1e-8, (len(ball.faces), 3, 3))
    points, faces = weld(soup.reshape(-1, 3), rng.permutation(np.arange(soup.size // 3).reshape(-1, 3)))
    assert len(points) == len(ball.vertices)
    assert trimesh.Trimesh(points, faces, process=False).is_watertight


@pytest.mark.parametrize(("sides", "smooth"), [(8, False), (11, False), (13, True), (48, True)])
def test_a_prism_is_smooth_where_its_sides_meet_below_the_crease_angle(sides, smooth):
    """The wall of an n-sided prism turns by 360/n degrees at each edge; the caps meet it at 90."""
    prism = trimesh.creation.cylinder(1.0, 2.0, sections=sides)
    assert (360 / sides < CREASE_DEG) == smooth
    mesh = crease_mesh(*weld(np.array(prism.vertices), np.array(prism.faces)))
    wall = np.abs(mesh.normals[:, 2]) < 0.5
    radial = mesh.vertices[wall, :2] / np.linalg.norm(mesh.vertices[wall, :2], axis=1, keepdims=True)
    off = np.degrees(np.arccos(np.sum(radial * mesh.normals[wall, :2], axis=1).clip(-1, 1)))
    np.testing.assert_allclose(off, 0 if smooth else 180 / sides, atol=1e-4)
    np.testing.assert_allclose(np.abs(mesh.normals[~wall, 2]), 1)


def test_a_finely_facetted_ball_has_the_ball_s_normals():
    ball = trimesh.creation.icosphere(3)
    mesh = crease_mesh(*weld(np.array(ball.vertices), np.array(ball.faces)))
    assert len(mesh.vertices) == len(ball.vertices)
    assert np.degrees(np.arccos(np.sum(mesh.normals * mesh.vertices, axis=1).clip(-1, 1))).max() < 0.5


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda f: f[:-1], "open: 3 edges"),
        (
            lambda f: np.vstack([f[:-1], f[-1:, ::-1]]),
            "At 3 edges neighbouring faces are wound in opposite senses",
        ),
        (lambda f: f[:, ::-1], "inside out"),
        (lambda f: np.vstack([f, f[:1]]), "3 edges belong to more than two"),
    ],
)
def test_odd_surfaces_are_noted(change, says):
    find = Findings("f.stl")
    points, faces = weld(np.array(BOX.vertices), np.array(BOX.faces))
    describe(points, change(faces), find)
    assert says in " ".join(p.message for p in find.problems)
    assert {p.severity for p in find.problems} == {Severity.NOTE}


def off(vertices, faces):
    rows = [" ".join(map(str, v)) for v in vertices] + [" ".join(map(str, [len(f), *f])) for f in faces]
    return f"OFF\n{len(vertices)} {len(faces)} 0\n" + "\n".join(rows) + "\n"


def ply(vertices, faces):
    head = f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\n"
    head += (
        f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = [" ".join(map(str, v)) for v in vertices] + [" ".join(map(str, [len(f), *f])) for f in faces]
    return head + "\n".join(rows) + "\n"


def obj(vertices, faces):
    rows = ["v " + " ".join(map(str, v)) for v in vertices]
    return "\n".join(rows + ["f " + " ".join(str(i + 1) for i in f) for f in faces]) + "\n"


TRIANGLE = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]


@pytest.mark.parametrize("form", [off, ply, obj])
@pytest.mark.parametrize(
    ("vertices", "faces", "says"),
    [
        ([*TRIANGLE, ("nan", 0, 0)], [(0, 1, 3)], "finite"),
        ([*TRIANGLE, (0, "inf", 0)], [(0, 1, 3)], "finite"),
        (TRIANGLE, [(0, 1, 7)], "3 v|outside the range"),
        (TRIANGLE, [(0, 1, 2_000_000_000)], "3 v|outside the range"),
        (TRIANGLE, [], "faces"),
        (TRIANGLE, [(0, 1, 1)], "area"),
    ],
)
def test_damaged_surfaces_are_one_line_that_names_the_file(form, vertices, faces, says, tmp_path, capfd):
    path = write(tmp_path, f"damaged.{form.__name__}", form(vertices, faces))
    with pytest.raises(FileError) as error:
        read(path)
    assert str(error.value).startswith(f"{path}: ")
    assert re.search(says, str(error.value))
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def test_triangles_without_area_are_counted(tmp_path):
    document = read(write(tmp_path, "sliver.off", off(TRIANGLE, [(0, 1, 2), (0, 1, 1), (2, 2, 2)])))
    assert len(only_body(document).mesh.faces) == 1
    assert any("2 of 3 triangles have no area" in str(p) for p in document.problems)


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        (
            "short.stl",
            b"\0" * 80 + struct.pack("<I", 2) + b"\0" * 50,
            "2 triangles, 184 bytes; it has 134 bytes",
        ),
        ("tiny.stl", b"\0" * 10, "no complete header"),
        ("cut.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n", "1 facets"),
        ("end.stl", b"solid a\n", "none"),
        ("huge.off", b"OFF\n353535235358 6 0\n0 0 0\n", "cannot hold them"),
        ("none.off", b"OFF\nhello\n", "begin with OFF"),
        (
            "huge.ply",
            ply(TRIANGLE, [(0, 1, 2)]).replace("vertex 3", "vertex 99999999999").encode(),
            "cannot hold",
        ),
        ("points.ply", ply(TRIANGLE, []).encode(), "0 faces"),
        ("face.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\nf 1 2 9\nf 1 2 -4\nv 1 x 2\nbogus 1\n", "line 4"),
    ],
)
def test_what_a_file_promises_must_be_there(name, data, says, tmp_path):
    path = write(tmp_path, name, data)
    with pytest.raises(FileError) as error:
        read(path)
    assert says in str(error.value)


def test_all_errors_of_an_obj_file_come_at_once_with_their_lines(tmp_path):
    path = write(tmp_path, "e.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\nf 1 2 9\nf 1 2 -4\nv 1 x 2\nbogus 1\n")
    with pytest.raises(FileError) as error:
        read(path)
    assert [p.where.prim for p in error.value.problems] == [f"line {n}" for n in (4, 5, 6, 7, 8)]


def test_several_solids_of_an_stl_file_are_several_parts(tmp_path):
    def solid(name, shift):
        mesh = BOX.copy().apply_translation(shift)
        return trimesh.exchange.stl.export_stl_ascii(mesh).replace("solid", f"solid {name}", 1)

    text = solid("left", (-5, 0, 0)) + "\n" + solid("right", (5, 0, 0)) + "\n"
    bodies = read(write(tmp_path, "two.stl", text)).scene().bodies
    centres = {b.name: float(b.mesh.bounds.mean(axis=0)[0]) for b in bodies}
    assert centres == pytest.approx({"/World/left": -5e-3, "/World/right": 5e-3})


def test_normals_that_a_file_gives_are_kept(tmp_path):
    ball = trimesh.creation.icosphere(1)
    path = tmp_path / "ball.ply"
    ball.export(path, vertex_normal=True)
    mesh = only_body(read(path)).mesh
    np.testing.assert_allclose(mesh.normals, mesh.vertices * 1e3, atol=1e-6)


OBJ = """mtllib paint.mtl
v 0 0 0
v 2 0 0
v 2 2 0
v 1 0.5 0
v 0 2 0
vt 0 0
vt 1 0
vt 1 1
vt 0.5 0.25
vt 0 1
o plate
usemtl red
f 1/1 2/2 3/3 4/4 5/5
usemtl shiny
f -5/1 -1/5 -2/4
o other
usemtl nowhere
f 1 2 3
l 1 2
"""
MTL = "newmtl red\nKd 0.5 0.1 0.1\nmap_Kd paint.png\nnewmtl shiny\nKd 0.2 0.2 0.2\nKs 0.3 0.3 0.3\nNs 40\nillum 2\n"


def test_obj_brings_polygons_parts_and_materials(tmp_path):
    write(tmp_path, "paint.mtl", MTL)
    Image.new("RGB", (2, 2), (255, 128, 0)).save(tmp_path / "paint.png")
    document = read(write(tmp_path, "part.obj", OBJ))
    red, shiny, other = document.scene().bodies
    assert [b.name for b in (red, shiny, other)] == ["/World/plate", "/World/plate", "/World/other"]
    p = red.mesh.vertices[red.mesh.faces] * 1e3
    area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] / 2
    assert (area > 0).all()  # a concave polygon: a fan would cover what is outside
    assert area.sum() == pytest.approx(2.5, rel=1e-6)  # the shoelace formula of its five corners
    np.testing.assert_allclose(red.mesh.uv * 2, red.mesh.vertices[:, :2] * 1e3, atol=1e-6)
    assert isinstance(red.material.brdf, Lambert)
    texture = red.material.maps["diffuse"].pixels[0, 0]
    np.testing.assert_allclose(
        texture, np.array([1, 0.21586, 0]) * [0.5, 0.1, 0.1], atol=1e-4
    )  # sRGB 128, times Kd
    assert isinstance(shiny.material.brdf, BlinnPhong)
    np.testing.assert_allclose(shiny.material.brdf.specular, 0.3 / np.pi, rtol=1e-6)
    assert shiny.material.brdf.n == 40
    losses = " ".join(str(p) for p in document.problems if p.severity is Severity.LOSS)
    assert 'material "nowhere"' in losses
    assert "1 statements with lines" in losses

"""STEP and IGES: sizes that are known, tolerances that are kept, names, colours and poses that come along."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from interchange.formats.base import Options
from interchange.formats.cad import StepFormat
from interchange.formats.gltf_buffers import Buffers, container
from interchange.formats.iges import IgesFormat, metres_per_output, square
from interchange.formats.refine import deviation, refine
from interchange.formats.surface import Findings, describe, weld
from interchange.frames import apply
from interchange.mesh import Mesh
from interchange.problems import BrightfieldError, FileError, Severity

PARTS = Path(__file__).parents[2] / "assets" / "cad"
FLOAT32 = 1e-6  # m: positions of parts below 1 m are kept in float32, 6e-8 of the largest coordinate


def read(name, **options):
    path = PARTS / name
    kind = IgesFormat() if path.suffix == ".igs" else StepFormat()
    return kind.read(path, Options(**options))


def size_mm(document):
    low, high = document.scene().bounds
    return (high - low) * 1e3


def world_mesh(scene):
    """All bodies as one set of triangles: points (V, 3) m, faces (F, 3)."""
    points, faces, start = [], [], 0
    for body in scene.bodies:
        points.append(apply(body.world_from_body, body.mesh.vertices))
        faces.append(body.mesh.faces + start)
        start += len(points[-1])
    return np.concatenate(points), np.concatenate(faces)


def inside(mesh, count=40):
    """Points all over every triangle of a mesh, (F * n, 3)."""
    weights = np.random.default_rng(1).dirichlet([1, 1, 1], count)
    weights = np.concatenate([weights, [[0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5], [1 / 3] * 3]])
    return np.einsum("wk,fkc->fwc", weights, mesh.vertices[mesh.faces]).reshape(-1, 3)


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("featuretype.STEP", (127, 63.5, 34.925)),
        ("nist_ctc_01_asme1_ap242-e1.stp", (800, 450, 150)),
        ("drilled.step", (60, 40, 8)),
        ("drilled_solid_mm.igs", (60, 40, 8)),
        ("drilled_faces_inch.igs", (60, 40, 8)),
    ],
)
def test_parts_have_the_size_that_was_drawn(name, size):
    np.testing.assert_allclose(size_mm(read(name)), size, atol=1e3 * FLOAT32)


def test_the_solid_and_its_facets_in_inches_are_one_part():
    """The same part twice: featuretype.STL has chords of its own, so the volumes differ by those of its holes."""
    points, faces = world_mesh(read("featuretype.STEP", chord_mm=0.01).scene())
    solid = trimesh.Trimesh(points, faces, process=False)
    facets = trimesh.load_mesh(PARTS / "featuretype.STL", process=False)
    facets.apply_scale(0.0254)
    np.testing.assert_allclose(solid.bounds, facets.bounds, atol=2e-6)  # the STL is drawn to 2e-6 m
    assert solid.volume == pytest.approx(facets.volume, rel=1e-3)
    assert solid.area == pytest.approx(facets.area, rel=1e-3)


@pytest.mark.parametrize("chord_mm", [0.5, 0.1, 0.02])
@pytest.mark.parametrize("name", ["drilled.step", "drilled_solid_mm.igs"])
def test_a_hole_is_as_round_as_was_asked_for(name, chord_mm):
    (body,) = read(name, chord_mm=chord_mm).scene().bodies
    p, n = body.mesh.vertices * 1e3 - [5, 0, 0], body.mesh.normals
    wall = np.abs(n[:, 2]) < 0.5
    wall &= np.abs(np.hypot(p[:, 0], p[:, 1]) - 12) < 1e-3
    outward = -p[wall, :2] / 12  # the wall faces the axis
    assert np.degrees(np.arccos(np.sum(outward * n[wall, :2], axis=1).clip(-1, 1))).max() < 0.05  # float32
    triangles = wall[body.mesh.faces].all(axis=1)
    wall_mesh = Mesh(p, body.mesh.faces[triangles], n)
    depth = 12 - np.hypot(*inside(wall_mesh)[:, :2].T)
    assert depth.max() <= chord_mm
    assert depth.min() > -1e-4
    steps = np.unique(np.degrees(np.arctan2(p[wall, 1], p[wall, 0])).round(3))
    assert np.diff(steps).max() <= 20.01  # the angle tolerance


@pytest.mark.parametrize("chord_mm", [0.5, 0.1, 0.03])
def test_a_ball_is_as_round_as_was_asked_for(chord_mm):
    """Where the kernel alone leaves 1.8 times the tolerance."""
    scene = read("fixture_mm.step", chord_mm=chord_mm).scene()
    ball = next(b for b in scene.bodies if b.name.endswith("Knob_left/Head")).mesh
    radius = np.linalg.norm(ball.vertices, axis=1) * 1e3
    np.testing.assert_allclose(radius, 6, atol=0.02 * chord_mm)
    assert 6 - np.linalg.norm(inside(ball), axis=1).min() * 1e3 <= chord_mm
    cosine = np.sum(ball.normals * ball.vertices, axis=1) / np.linalg.norm(ball.vertices, axis=1)
    assert np.degrees(np.arccos(cosine.clip(-1, 1))).max() < 0.1


@pytest.mark.parametrize("chord_mm", [0.1, 0.02])
@pytest.mark.parametrize("name", ["nist_ctc_01_asme1_ap242-e1.stp", "featuretype.STEP"])
def test_every_face_keeps_the_chord_tolerance(name, chord_mm):
    """Against the equations of the planes, cylinders, spheres and tori themselves, as the kernel knows them."""
    seen = set()
    for kind, about, mesh in analytic_faces(PARTS / name, chord_mm):
        p = inside(refine(mesh, chord_mm * 1e-3, np.radians(20)))
        away = distance(kind, about, p)
        assert np.abs(away).max() * 1e3 <= 1.02 * chord_mm, (
            kind,
            about,
        )  # second order in the tolerance's angle
        seen.add(kind)
    assert {"plane", "cylinder"} <= seen


def analytic_faces(path, chord_mm):
    import cascadio

    glb = cascadio.load(
        path.read_bytes(),
        tol_linear=chord_mm,
        tol_angular=np.radians(20),
        include_brep=True,
        use_parallel=False,
    )
    document, chunk = container(glb, "")
    buffers = Buffers(document, chunk, "", Findings(""))
    for primitive in [p for m in document["meshes"] for p in m["primitives"] if "extensions" in p]:
        about = primitive["extensions"]["TM_brep_faces"]
        p, n = (buffers.accessor(primitive["attributes"][k]).astype(float) for k in ("POSITION", "NORMAL"))
        faces = buffers.accessor(primitive["indices"]).reshape(-1, 3)
        owner = buffers.accessor(about["faceIndices"])
        for number, face in enumerate(about["faces"]):
            if face is not None and face["type"] in ("plane", "cylinder", "sphere", "torus"):
                yield face["type"], face, Mesh(p, faces[owner == number], n)


def distance(kind, about, p):
    d = p - np.array(about["origin"] if "origin" in about else about["center"])
    if kind == "plane":
        return d @ about["normal"]
    if kind == "sphere":
        return np.linalg.norm(d, axis=1) - about["radius"]
    along = d @ about["axis"]
    radius = np.linalg.norm(d - along[:, None] * about["axis"], axis=1)
    if kind == "cylinder":
        return radius - about["radius"]
    return np.hypot(radius - about["major_radius"], along) - about["minor_radius"]


@pytest.mark.parametrize("name", ["featuretype.STEP", "nist_ctc_01_asme1_ap242-e1.stp", "drilled.step"])
@pytest.mark.parametrize("chord_mm", [0.1, 0.02])
def test_solids_are_closed_and_face_outwards(name, chord_mm):
    """Refining one face must not open a crack to its neighbour."""
    points, faces = world_mesh(read(name, chord_mm=chord_mm).scene())
    find = Findings(name)
    describe(*weld(points.astype(np.float32).astype(float), faces), find)
    assert [str(p) for p in find.problems if "has no area" not in p.message] == []


@pytest.mark.parametrize("name", ["fixture_mm.step", "fixture_inch.step"])
def test_an_assembly_keeps_names_poses_and_colours(name):
    document = read(name)
    bodies = document.scene().bodies
    assert [b.name for b in bodies] == [
        "/World/Fixture/Base_plate",
        "/World/Fixture/Base_plate",  # two colours
        "/World/Fixture/Knob_left/Stem",
        "/World/Fixture/Knob_left/Head",
        "/World/Fixture/Knob_right/Stem",
        "/World/Fixture/Knob_right/Head",
    ]
    assert document.stage.GetPrimAtPath("/World/Fixture/Base_plate").GetDisplayName() == "Base plate"
    centre = bodies[5].world_from_body[:3, 3]
    turn = np.radians(30)
    np.testing.assert_allclose(
        centre, [0.020 + 0.036 * np.sin(turn), 0, 0.008 + 0.036 * np.cos(turn)], atol=1e-8
    )
    # the kernel's colours were given in sRGB; a Lambert albedo is linear (IEC 61966-2-1)
    for body, srgb in zip(bodies[:3], [(0, 0.5, 0), (0.8, 0.2, 0.1), (0.1, 0.3, 0.9)], strict=True):
        c = np.array(srgb)
        linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        np.testing.assert_allclose(body.material.brdf.diffuse, linear, atol=1e-6)
    np.testing.assert_array_equal(bodies[3].mesh.vertices, bodies[5].mesh.vertices)
    # authored once, referenced by the second
    layer = document.stage.GetRootLayer()
    assert layer.GetPrimAtPath("/World/Fixture/Knob_right/Head").attributes.get("points") is None
    assert [p for p in document.problems if p.severity is not Severity.NOTE] == []


def test_annotations_are_listed_as_left_out():
    losses = [str(p) for p in read("nist_ctc_01_asme1_ap242-e1.stp").problems]
    assert any("A set of points is left out" in text for text in losses)


def test_iges_says_that_it_loses_colours():
    document = read("fixture.igs")
    np.testing.assert_allclose(size_mm(document)[1:], [40, 50], atol=1e-3)
    assert any("colour" in p.message and p.severity is Severity.LOSS for p in document.problems)


def test_the_kernel_s_unit_for_iges_is_measured():
    assert metres_per_output() == pytest.approx(1e-3)
    assert all(len(line) == 80 for line in square(10.0).splitlines())


@pytest.mark.parametrize("options", [{"chord_mm": 0.0}, {"chord_mm": np.nan}, {"angle_deg": 200.0}])
def test_tolerances_out_of_range_are_refused(options):
    with pytest.raises(BrightfieldError, match="tolerance must lie in"):
        read("drilled.step", **options)


def damaged(name, how):
    data = (PARTS / name).read_bytes()
    return {
        "empty": b"",
        "head": data[:100],
        "half": data[: len(data) // 2],
        "noise": np.random.default_rng(0).bytes(20000),
        "no shape": b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n",
        "dangling": b"\n".join(line for line in data.split(b"\n") if not line.startswith(b"#3")),
        "wrong entity": data.replace(b"CARTESIAN_POINT", b"CARTESIAN_PLACE"),
    }[how]


@pytest.mark.parametrize(
    ("name", "how"),
    [
        *(
            ("drilled.step", how)
            for how in ("empty", "head", "half", "noise", "no shape", "dangling", "wrong entity")
        ),
        *(("drilled_solid_mm.igs", how) for how in ("empty", "head", "half", "noise", "no shape")),
    ],
)
def test_a_damaged_file_is_one_line(name, how, tmp_path, capfd):
    path = tmp_path / name
    path.write_bytes(damaged(name, how))
    with pytest.raises(FileError) as error:
        read(path)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def sphere(radius, subdivisions):
    ball = trimesh.creation.icosphere(subdivisions, radius)
    return Mesh(np.array(ball.vertices), np.array(ball.faces), np.array(ball.vertices) / radius)


@pytest.mark.parametrize("subdivisions", [0, 1, 2])
@pytest.mark.parametrize("chord", [0.02, 0.005])
def test_refining_brings_a_sphere_s_facets_onto_the_sphere(subdivisions, chord):
    coarse = sphere(1.0, subdivisions)
    fine = refine(coarse, chord, np.pi)
    radius = np.linalg.norm(fine.vertices, axis=1)
    np.testing.assert_allclose(radius, 1, atol=1e-9)  # a great circle's stand-off is exact
    assert 1 - np.linalg.norm(inside(fine), axis=1).min() <= 1.03 * chord  # the centroid's is of second order
    assert deviation(fine) <= chord
    assert trimesh.Trimesh(fine.vertices, fine.faces, process=False).is_watertight
    if deviation(coarse) > chord:
        assert len(fine.faces) > len(coarse.faces)
    else:
        assert fine is coarse


def test_refining_leaves_planes_and_creases_alone():
    box = trimesh.creation.box((1, 1, 1))
    corners = np.array(box.vertices)[box.faces].reshape(-1, 3)
    flat = Mesh(corners, np.arange(36).reshape(-1, 3), np.repeat(box.face_normals, 3, axis=0))
    assert refine(flat, 1e-6, 0.01) is flat
    assert deviation(flat) == 0

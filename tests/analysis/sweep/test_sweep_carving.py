"""Areas, volumes and normals of what was cut, against their closed forms."""

import numpy as np
import pytest

from analysis.sweep.carve import carve
from analysis.sweep.defects import MODELS
from interchange.formats.gprims import box, sphere
from interchange.frames import apply
from interchange.mesh import Mesh

SIDE = 20e-3
PLATE = {
    "scratch": {"length": 6.0, "width": 1.2, "depth": 0.1},
    "dent": {"length": 6.0, "width": 3.0, "depth": 0.4},
    "groove": {"length": 8.0, "width": 2.0, "depth": 0.3, "flank": 0.5},
    "stain": {"radius": 3.0, "irregularity": 0.3, "seed": 4.0},
}
AREA = {  # mm²
    "scratch": 6 * 1.2 + np.pi * 1.2**2 / 4,
    "dent": np.pi * 6 * 3 / 4,
    "groove": 8 * 2,
    "stain": np.pi * 9 * (1 + 0.3**2 / 2),
}
VOLUME = {  # mm³ below the plane
    "scratch": 0.1 * (6 * 1.2 / 2 + np.pi * 0.6**2 * (0.5 - 2 / np.pi**2)),
    "dent": 0.4 * np.pi * 3 * 1.5 / 3,
    "stain": 0.0,
}


def cube() -> Mesh:
    b = box(SIDE)
    return Mesh(b.vertices, b.faces, b.normals, b.uv)


def on_top(angle: float = 0.4) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    world_from_defect = np.eye(4)
    world_from_defect[:3, :3] = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    world_from_defect[:3, 3] = [1e-3, -2e-3, SIDE / 2]
    return np.linalg.inv(world_from_defect)


def area(mesh: Mesh, axes: list[int] | None = None) -> float:
    p = mesh.vertices[mesh.faces]
    if axes is not None:
        p = p * np.isin(np.arange(3), axes)
    return float(np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2)


def volume(*meshes: Mesh) -> float:
    p = np.concatenate([m.vertices[m.faces] for m in meshes])
    return float(np.sum(p[:, 0] * np.cross(p[:, 1], p[:, 2])) / 6)


@pytest.mark.parametrize("kind", PLATE)
def test_the_outline_encloses_its_closed_form(kind):
    rest, own = carve(cube(), on_top(), MODELS[kind](**PLATE[kind]).footprint())
    assert rest is not None
    assert own is not None
    # seen from above; chords of the outline are as short as ``fine``, so it errs by less than 1 %
    assert area(own, [0, 1]) * 1e6 == pytest.approx(AREA[kind], rel=0.01)
    # top and bottom of the cube together: nothing is lost or counted twice
    assert area(own, [0, 1]) + area(rest, [0, 1]) == pytest.approx(2 * SIDE**2, rel=1e-6)


@pytest.mark.parametrize("kind", VOLUME)
def test_the_hollow_holds_its_closed_form_and_the_surface_stays_closed(kind):
    rest, own = carve(cube(), on_top(), MODELS[kind](**PLATE[kind]).footprint())
    # the divergence theorem gives the solid's volume only if its surface is closed
    lost = (SIDE**3 - volume(rest, own)) * 1e9
    assert lost == pytest.approx(VOLUME[kind], rel=0.02, abs=1e-6)


@pytest.mark.parametrize("kind", PLATE)
def test_faces_are_as_many_as_needed_and_none_is_turned_over(kind):
    rest, own = carve(cube(), on_top(), MODELS[kind](**PLATE[kind]).footprint())
    for mesh in (rest, own):
        p = mesh.vertices[mesh.faces]
        n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        top = mesh.normals[mesh.faces].mean(axis=1)[:, 2] > 0.3
        assert (n[top][:, 2] > -1e-18).all()
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-9)
    assert len(own.faces) < 60_000


@pytest.mark.parametrize("kind", ["scratch", "dent", "groove"])
def test_vertices_lie_on_the_profile_and_normals_are_its_own(kind):
    shape = MODELS[kind](**PLATE[kind]).footprint()
    frame = on_top()
    _, own = carve(cube(), frame, shape)
    p = apply(frame, own.vertices)
    np.testing.assert_allclose(p[:, 2], shape.height(p[:, 0], p[:, 1]), atol=1e-12)
    assert p[:, 2].min() * 1e3 == pytest.approx(-PLATE[kind]["depth"], rel=0.03)
    g = shape.gradient(p[:, 0], p[:, 1])
    n = np.column_stack([-g, np.ones(len(g))])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    # a difference over 1e-3 of an edge, which the outline itself may halve
    np.testing.assert_allclose(own.normals @ frame[:3, :3].T, n, atol=1e-3)


def test_a_body_that_is_scaled_gets_the_same_defect():
    stretched = cube()
    stretched = Mesh(stretched.vertices / [2, 1, 4], stretched.faces, stretched.normals, stretched.uv)
    world_from_body = np.diag([2.0, 1, 4, 1])
    shape = MODELS["dent"](**PLATE["dent"]).footprint()
    rest, own = carve(stretched, on_top() @ world_from_body, shape)
    there = [Mesh(apply(world_from_body, m.vertices), m.faces, m.normals) for m in (rest, own)]
    assert (SIDE**3 - volume(*there)) * 1e9 == pytest.approx(VOLUME["dent"], rel=0.02)
    assert area(there[1], [0, 1]) * 1e6 == pytest.approx(AREA["dent"], rel=0.01)


def test_on_a_ball_the_surface_stays_closed_and_uv_go_on():
    mesh = sphere(10e-3)
    frame = np.eye(4)
    frame[2, 3] = -10e-3  # at the pole
    shape = MODELS["dent"](length=4.0, width=4.0, depth=0.3).footprint()
    before = volume(mesh)
    rest, own = carve(mesh, frame, shape)
    assert (before - volume(rest, own)) * 1e9 == pytest.approx(0.3 * np.pi * 4 / 3, rel=0.03)


def test_two_defects_may_cross():
    first, second = (MODELS["scratch"](**PLATE["scratch"]).footprint() for _ in range(2))
    rest, one = carve(cube(), on_top(0.0), first)
    left, two = carve(rest, on_top(1.5), second)
    assert two is not None
    # the second takes over where they cross: its own area is what was left of its outline
    assert area(two, [0, 1]) < 0.9 * AREA["scratch"] * 1e-6
    total = area(left, [0, 1]) + area(one, [0, 1]) + area(two, [0, 1])
    assert total == pytest.approx(2 * SIDE**2, rel=1e-6)


def test_where_nothing_is_met_the_mesh_stays_the_same_object():
    mesh = cube()
    away = on_top()
    away[0, 3] += 1.0
    rest, own = carve(mesh, away, MODELS["dent"]().footprint())
    assert rest is mesh
    assert own is None

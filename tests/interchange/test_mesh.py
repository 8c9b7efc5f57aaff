"""Meshes, polygons and solids: areas, volumes and normals against closed forms."""

import numpy as np
import pytest

from interchange.formats import gprims
from interchange.formats.polygons import ear_clip, newell, triangulate
from interchange.mesh import Mesh, face_normals, from_corners, smooth_normals


def volume(mesh: Mesh) -> float:
    p = mesh.vertices[mesh.faces]
    return float(np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6)


def area(points, triangles):
    p = points[triangles]
    return np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        (gprims.box(2.0), 8.0),
        (gprims.sphere(1.0), 4 / 3 * np.pi),
        (gprims.revolve([gprims.line((0, -1), (1, -1)), gprims.line((1, -1), (0, 1))]), 2 / 3 * np.pi),
    ],
    ids=["box", "sphere", "cone"],
)
def test_solids_are_closed_wound_outwards_and_of_the_right_size(mesh, expected):
    assert volume(mesh) == pytest.approx(
        expected, rel=2e-3
    )  # 96 segments: 1 - sinc(2 pi / 96) = 7e-4 an angle
    p = mesh.vertices[mesh.faces]
    assert (
        np.einsum("ij,ij->i", face_normals(mesh.vertices, mesh.faces), mesh.normals[mesh.faces[:, 0]]) > 0.5
    ).all()
    assert np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).min() > 0


def test_tangents_follow_u_and_lie_in_the_surface():
    mesh = gprims.revolve([gprims.line((1, -1), (1, 1))])
    assert np.abs(np.sum(mesh.tangents * mesh.normals, axis=1)).max() < 1e-12
    around = np.cross([0, 0, 1.0], mesh.normals)
    inner = slice(2, 90)  # at the seam u ends
    assert np.sum(mesh.tangents * around, axis=1)[inner] == pytest.approx(1, abs=1e-2)


def test_without_uv_the_tangent_is_the_x_axis_laid_onto_the_surface():
    mesh = from_corners(
        np.array([[0.0, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2]])
    )  # normal along x
    assert mesh.tangents == pytest.approx(np.tile([0, 1.0, 0], (3, 1)))


def test_smooth_normals_of_a_sphere_are_its_radii():
    mesh = gprims.sphere(1.0)
    keys, inverse = np.unique(np.round(mesh.vertices, 9), axis=0, return_inverse=True)  # weld the seam
    n = smooth_normals(keys, inverse.reshape(-1)[mesh.faces])
    off = np.degrees(np.arccos(np.clip(np.sum(n * keys, axis=1), -1, 1)))
    assert off.max() < 0.2  # a tenth of the 1.9 degrees between neighbouring segments' normals


def test_concave_polygon_is_cut_inside():
    arrow = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0]], np.float64)
    triangles = ear_clip(arrow)
    assert area(arrow, triangles) == pytest.approx(np.linalg.norm(newell(arrow)))


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1, -1])
def test_triangles_keep_the_winding_of_the_polygon(axis, sign):
    arrow = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0]], np.float64)[::sign]
    arrow = np.roll(arrow, axis, axis=1)
    corners, owner = triangulate(np.array([5]), arrow, np.arange(5))
    assert (owner == 0).all()
    assert area(arrow, corners) == pytest.approx(np.linalg.norm(newell(arrow)))
    n = face_normals(arrow, corners)
    assert (n @ newell(arrow) > 0).all()


def test_mixed_polygons_keep_their_order():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], np.float64)
    corners, owner = triangulate(np.array([3, 4, 2]), points, np.array([1, 4, 2, 0, 1, 2, 3, 0, 1]))
    assert owner.tolist() == [0, 1, 1]
    assert corners[0].tolist() == [0, 1, 2]


def test_corners_that_agree_become_one_vertex_and_hard_edges_stay():
    box = gprims.box(1.0)
    assert len(box.vertices) == 24

"""True edges of CAD parts: which there are, where the camera sees them, and what hides them."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.tune.features import parse
from analysis.tune.truth import straight, truth
from analysis.tune.wireframe import Wires, outline, wireframe
from interchange.camera import Camera, Lens, Sensor
from interchange.frames import look_at
from interchange.material import Material
from interchange.mesh import Mesh, from_corners
from interchange.problems import BrightfieldError, FileError
from interchange.scene import Body, Scene
from realtime.renderers.rasterizer import Rasterizer

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * 0.01
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def box(name: str = "/World/box", at: tuple[float, float, float] = (0, 0, 0), scale: float = 1.0) -> Body:
    faces = np.array([[q[i] for i in t] for q in QUADS for t in ((0, 1, 2), (0, 2, 3))])
    pose = np.eye(4)
    pose[:3, 3] = at
    return Body(name, from_corners(scale * CORNERS, faces), Material("grey"), pose)


def cylinder(n: int = 64) -> Mesh:
    t = np.linspace(0, 2 * np.pi, n, endpoint=False)
    ring = 0.01 * np.stack([np.cos(t), np.sin(t), 0 * t], -1)
    vertices = np.concatenate([ring, ring + np.array([0, 0, 0.03])])
    k = np.arange(n)
    j = (k + 1) % n
    return from_corners(
        vertices, np.concatenate([np.stack([k, j, n + j], -1), np.stack([k, n + j, n + k], -1)])
    )


CAMERA = Camera(
    "/World/Camera",
    look_at(np.array([0.08, -0.13, 0.1]), np.zeros(3)),
    Lens(3e-3),
    Sensor((160, 120), (6e-6, 6e-6)),
)


def test_a_box_has_its_twelve_edges_and_no_diagonals() -> None:
    found = wireframe([box()])
    assert found.sharp.all()
    assert len(found.ends) == 12
    assert len(np.unique(found.line)) == 12
    assert np.linalg.norm(np.diff(found.ends, axis=1), axis=-1) == pytest.approx(0.02)


def test_a_cylinder_has_two_rims_and_the_outline_that_the_camera_sees() -> None:
    wires = wireframe([Body("/World/tube", cylinder(), Material("grey"))])
    assert wires.sharp.sum() == 2 * 64  # its open ends
    eye = np.array([0.0, -0.5, 0.015])
    there = outline(wires, eye) & ~wires.sharp
    x = wires.ends[there][..., 0].mean(axis=1)
    assert len(x) == 2
    assert np.abs(x) == pytest.approx(0.01, rel=0.01)  # the sides, at right angles to the view


def test_where_materials_meet_is_an_edge_though_the_surface_goes_on() -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    left = Body("/World/a", from_corners(square, faces), Material("a"))
    right = Body("/World/b", from_corners(square + np.array([1, 0, 0]), faces), Material("b"))
    found = wireframe([left, right])
    assert len(found.ends) == 7
    same = wireframe(
        [replace(left, name="/World/c"), replace(right, name="/World/c", material=left.material)]
    )
    assert len(same.ends) == 6


def test_points_of_edges_lie_on_their_projection_and_hidden_ones_are_left_out() -> None:
    wanted = parse({"edges": ["box"]})
    with Rasterizer() as renderer:
        alone = truth(renderer, Scene((box(),)), CAMERA, wanted, Wires(wanted.angle)).edges
        front = box("/World/front", (0.025, -0.04, 0.03), 0.5)
        covered = truth(renderer, Scene((box(), front)), CAMERA, wanted, Wires(wanted.angle)).edges
    assert alone is not None
    assert covered is not None
    ends = CAMERA.project(wireframe([box()]).ends)
    seen = list(ends)
    away = np.min([_distance(alone.points, a, b) for a, b in seen], axis=0)
    assert away.max() < 0.02  # half-points of a straight line; projection keeps lines straight
    # nine of a convex box's twelve edges are seen from a corner's side
    long = [np.linalg.norm(b - a) for a, b in seen]
    hits = [(_distance(alone.points, a, b) < 0.02).sum() for a, b in seen]
    assert sum(h > 0.8 * n for h, n in zip(hits, long, strict=True)) == 9
    assert len(covered.points) < 0.95 * len(alone.points)


def _distance(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    t = np.clip(((p - a) @ (b - a)) / ((b - a) @ (b - a)), 0, 1)[:, None]
    return np.linalg.norm(p - (a + t * (b - a)), axis=1)


def test_a_bending_lens_gives_edges_where_it_images_them() -> None:
    bent = replace(CAMERA, lens=replace(CAMERA.lens, distortion=(-0.3, 0.1)))
    assert straight(bent).sensor.resolution[0] > 160
    wanted = parse({"edges": ["box"]})
    with Rasterizer() as renderer:
        found = truth(renderer, Scene((box(),)), bent, wanted, Wires(wanted.angle)).edges
    assert found is not None
    s = np.linspace(0, 1, 400)[:, None]
    ends = wireframe([box()]).ends
    curve = np.concatenate([bent.project(a + s * (b - a)) for a, b in ends])
    away = np.min(np.linalg.norm(found.points[:, None] - curve[None], axis=-1), axis=1)
    assert len(found.points) > 300
    assert away.max() < 0.3  # between the curve's own points


def test_a_moved_part_keeps_its_wireframe() -> None:
    wires = Wires(np.radians(30))
    first = box()
    pose = np.eye(4)
    pose[:3, 3] = (0.1, 0, 0)
    moved = wires.of([first]), wires.of([replace(first, world_from_body=pose)])
    assert moved[1].ends == pytest.approx(moved[0].ends + np.array([0.1, 0, 0]))
    stretched = pose @ np.diag([2.0, 1, 1, 1])
    again = wires.of([replace(first, world_from_body=stretched)])
    assert np.ptp(again.ends[..., 0]) == pytest.approx(0.04)


def test_gauged_features_are_projected_and_strange_ones_told() -> None:
    wanted = parse(
        {
            "lines": {"top": {"body": "/World/box", "start": [-10, -10, 10], "end": [10, -10, 10]}},
            "circles": {
                "bore": {"body": "/World/box", "middle": [0, 0, 10], "normal": [0, 0, 1], "diameter": 8}
            },
        }
    )
    above = replace(CAMERA, world_from_camera=look_at(np.array([0, 0, 0.11]), np.zeros(3), (0, 1, 0)))
    with Rasterizer() as renderer:
        found = truth(renderer, Scene((box(),)), above, wanted, Wires(wanted.angle))
        bad = parse({"lines": {"top": {"body": "/World/bix", "start": [0, 0, 0], "end": [1, 0, 0]}}})
        with pytest.raises(BrightfieldError, match='Did you mean "/World/box"'):
            truth(renderer, Scene((box(),)), above, bad, Wires(wanted.angle))
    # 3 mm lens, 6 µm pixels, 0.1 m away: 5 px a mm
    assert found.circles["bore"].radius == pytest.approx(20, rel=1e-6)
    assert found.circles["bore"].middle == pytest.approx((79.5, 59.5), abs=1e-6)
    assert found.lines["top"].length == pytest.approx(100, rel=1e-6)


def test_a_file_of_features_tells_all_that_is_wrong() -> None:
    with pytest.raises(FileError) as error:
        parse(
            {
                "edgs": ["a"],
                "circles": {"c": {"middle": [0, 0], "normal": [0, 0, 1], "diameter": -1}},
                "angle": 0,
            }
        )
    told = str(error.value)
    assert 'Did you mean "edges"' in told
    assert "three numbers" in told
    assert "between 0 and 180" in told

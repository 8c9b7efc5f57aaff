"""Constraints against arrangements of boxes whose answers are known."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.series.specimens import camera_above
from analysis.sweep.constraint import Moment
from analysis.sweep.constraints.in_view import InView
from analysis.sweep.constraints.no_collision import NoCollision, winding_number
from analysis.sweep.constraints.not_hidden import NotHidden
from interchange.formats.gprims import box
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.scene import Body, Scene
from realtime.renderers.rasterizer import Rasterizer

FIELD = 24e-3


def block(name, size, at):
    """Millimetres."""
    b, pose = box(1.0), np.eye(4)
    pose[:3, 3] = 1e-3 * np.array(at)
    mesh = Mesh(b.vertices * 1e-3 * np.array(size), b.faces, b.normals, b.uv)
    return Body(name, mesh, Material(), pose)


@pytest.fixture(scope="module")
def live():
    with Rasterizer() as rasterizer:
        yield lambda: rasterizer


def moment(live, *bodies):
    camera = camera_above(96, FIELD)
    return Moment(Scene(tuple(bodies), (), (camera,)), (camera,), live)


@pytest.mark.parametrize(("x", "share"), [(0, 1.0), (12, 0.5), (9.5, 0.75), (16.9, 0.01)])
def test_the_share_in_view_is_the_part_within_the_field(live, x, share):
    there = moment(live, block("/Plate", (10, 10, 1), (x, 0, 0)))  # the field ends at x = 12 mm
    assert not InView(("/Plate",), (), at_least=max(share - 0.02, 0)).breaks(there)
    if share < 0.97:
        assert InView(("/Plate",), (), at_least=share + 0.02).breaks(there)


def test_what_faces_no_camera_breaks(live):
    nothing = moment(live, block("/Other", (1, 1, 1), (0, 0, 0)))
    assert InView(("/Plate",), (), at_least=0.0).breaks(nothing)


def test_a_housing_hides_the_share_that_it_covers(live):
    plate, housing = block("/Plate", (10, 10, 1), (0, 0, 0)), block("/Housing", (6, 20, 1), (5, 0, 30))
    cable = block("/Cable", (1, 20, 1), (-4, 0, 30))
    there = moment(live, plate, housing, cable)  # 30 % and 10 % of the plate; 4 standard deviations are 0.028
    assert NotHidden(("/Plate",), ("/Housing",), at_most=0.27).breaks(there)
    assert not NotHidden(("/Plate",), ("/Housing",), at_most=0.33).breaks(there)
    assert NotHidden(("/Plate",), (), at_most=0.37).breaks(there)
    assert not NotHidden(("/Plate",), (), at_most=0.43).breaks(there)


@pytest.mark.parametrize(
    ("at", "clearance", "meets"),
    [
        ((11, 0, 0), 0.0, False),  # 1 mm between the two
        ((11, 0, 0), 0.9, False),
        ((11, 0, 0), 1.1, True),
        ((9, 0, 0), 0.0, True),
        ((9, 9, 9), 0.0, True),
        ((12, 12, 0), 2.7, False),  # sqrt(8) = 2.83 mm from edge to edge
        ((12, 12, 0), 2.9, True),
    ],
)
def test_parts_meet_where_boxes_overlap_or_come_too_near(live, at, clearance, meets):
    there = moment(live, block("/A", (10, 10, 10), (0, 0, 0)), block("/B", (10, 10, 10), at))
    assert NoCollision(("/A",), (), clearance).breaks(there) is meets
    assert NoCollision(("/B",), ("/A",), clearance).breaks(there) is meets


def test_a_part_inside_another_meets_it(live):
    there = moment(live, block("/A", (10, 10, 10), (0, 0, 0)), block("/B", (2, 2, 2), (1, 1, 1)))
    assert NoCollision(("/A",), ("/B",)).breaks(there)
    assert NoCollision(("/B",), ("/A",)).breaks(there)


def test_only_those_named_are_looked_at(live):
    there = moment(
        live, *(block(f"/{n}", (10, 10, 10), (x, 0, 0)) for n, x in (("A", 0), ("B", 5), ("C", 40)))
    )
    assert not NoCollision(("/A",), ("/C",)).breaks(there)
    assert NoCollision(("/A",), ()).breaks(there)


def test_turned_and_scaled_parts_are_where_they_are(live):
    a, b = block("/A", (10, 10, 10), (0, 0, 0)), block("/B", (10, 10, 10), (11.5, 0, 0))
    c = np.sqrt(0.5)
    turn = np.array([[c, -c, 0, 0], [c, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    turned = replace(a, world_from_body=turn)  # its corner reaches to 7.07 mm
    assert NoCollision(("/A",), ()).breaks(moment(live, turned, b))
    small = replace(a, world_from_body=turn @ np.diag([0.5, 0.5, 0.5, 1]))
    assert not NoCollision(("/A",), ()).breaks(moment(live, small, b))


def test_the_winding_number_of_a_box_is_one_inside_and_zero_outside():
    b = box(1.0)
    corners = b.vertices[b.faces]
    assert winding_number(np.array([0.1, 0.2, -0.3]), corners) == pytest.approx(1, abs=1e-12)
    assert winding_number(np.array([0.9, 0.2, -0.3]), corners) == pytest.approx(0, abs=1e-12)

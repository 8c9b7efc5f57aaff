"""What a camera sees, in closed form: field, scale, depth of field, footprints, and what stands in the way."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.sphere import ball
from analysis.view.footprint import footprint
from analysis.view.optics import depth_of_field, field_of_view
from analysis.view.visibility import named, visibility
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.effects.defocus import Defocus
from interchange.frames import look_at
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene
from realtime.renderers.rasterizer import Rasterizer

PITCH = 5e-6


@pytest.fixture(scope="module")
def rasterizer():
    with Rasterizer() as renderer:
        yield renderer


def camera(eye=(0, 0, 1.0), target=(0, 0, 0), resolution=(200, 100), **lens):
    pose = look_at(np.array(eye, float), np.array(target, float), (0, 1, 0))
    return Camera("/cam", pose, Lens(focal_length=0.025, **lens), Sensor(resolution, (PITCH, PITCH)))


def telecentric(pixel, resolution=(200, 200), eye=(0, 0, 1.0)):
    pose = look_at(np.array(eye, float), np.zeros(3), (0, 1, 0))
    return Camera("/cam", pose, Lens(projection=Projection.ORTHOGRAPHIC), Sensor(resolution, (pixel, pixel)))


def plate(width, height, z=0.0, x=0.0):
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    vertices = np.column_stack([corner * [width, height] + [x, 0], np.full(4, z)])
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.tile([0.0, 0, 1], (4, 1)))


def body(name, mesh):
    return Body(name, mesh, Material("/m"))


def test_field_of_view_of_a_pinhole():
    view = field_of_view(camera(), 2.0)
    half = np.array([200, 100, np.hypot(200, 100)]) * PITCH / 2 / 0.025
    assert view.angles == pytest.approx(2 * np.arctan(half), rel=1e-12)
    assert view.size == pytest.approx((200 * PITCH / 0.025 * 2, 100 * PITCH / 0.025 * 2), rel=1e-12)


def test_barrel_distortion_widens_the_field():
    assert field_of_view(camera(distortion=(-5.0,)), 1.0).angles[0] > field_of_view(camera(), 1.0).angles[0]


def test_at_the_limits_of_depth_of_field_the_blur_is_the_limit():
    cam = camera(f_stop=4.0, focus_distance=0.5)
    limits = depth_of_field(cam, blur=2.0)
    found = Defocus(f_stop=4.0, focus_distance=0.5).confusion(np.array([limits.near, limits.far]), cam)
    assert found == pytest.approx([-2.0, 2.0], rel=1e-9)
    far = camera(f_stop=4.0, focus_distance=limits.hyperfocal)
    assert depth_of_field(far, 2.0).near == pytest.approx(limits.hyperfocal / 2)
    assert depth_of_field(replace(far, lens=replace(far.lens, focus_distance=1e3)), 2.0).far == np.inf


def test_footprint_of_a_facing_and_of_a_slanted_plane(rasterizer):
    passes = ["depth", "position", "normal"]
    scene = Scene((body("/p", plate(2, 2)),))
    cam = camera(f_stop=4.0, focus_distance=0.9)
    sharp = replace(cam, lens=replace(cam.lens, f_stop=0.0))
    facing = footprint(rasterizer.render(scene, sharp, passes, samples=1), cam)
    scale = PITCH / 0.025
    for found in (facing.across, facing.longest, facing.shortest):
        assert found == pytest.approx(np.full(found.shape, scale), rel=2e-5)
    assert facing.blur == pytest.approx(
        np.full(facing.blur.shape, 0.1 * 0.025**2 / (4 * 0.9 * PITCH)), rel=1e-4
    )
    tilt = np.radians(60)
    slanted = replace(
        telecentric(1e-3), world_from_camera=look_at(np.array([0, -np.sin(tilt), np.cos(tilt)]), np.zeros(3))
    )
    found = footprint(rasterizer.render(scene, slanted, passes, samples=1), slanted)
    seen = np.isfinite(found.across)
    assert found.longest[seen] == pytest.approx(1e-3 / np.cos(tilt), rel=1e-4)
    assert found.shortest[seen] == pytest.approx(1e-3, rel=1e-4)
    assert found.area[seen] == pytest.approx(1e-6 / np.cos(tilt), rel=1e-4)
    assert found.slant[seen] == pytest.approx(tilt, abs=1e-4)
    assert (found.area[seen]).sum() == pytest.approx(0.2 * 0.2 / np.cos(tilt), rel=1e-3)


def test_a_housing_hides_its_share(rasterizer):
    """A plate covers the left 30 % of the workpiece in a telecentric view: 20,000 points tell 0.3 %."""
    scene = Scene((body("/part/top", plate(1.0, 1.0)), body("/housing", plate(0.3, 2.0, z=0.5, x=-0.35))))
    found = visibility(rasterizer, scene, telecentric(0.01), ["/part"])
    assert found.hidden == {"/housing": pytest.approx(0.3, abs=4e-3)}
    assert found.seen == pytest.approx(0.7, abs=4e-3)
    assert (found.outside, found.by_itself) == (0.0, 0.0)
    assert found.facing == pytest.approx(1.0)
    assert found.mask.mean() == pytest.approx(0.3 * 1.0 / 4, abs=5e-3)


def test_a_field_too_small_leaves_the_rest_outside(rasterizer):
    scene = Scene((body("/part", plate(1.0, 1.0)),))
    found = visibility(rasterizer, scene, telecentric(0.01, (60, 200)), ["part"])
    assert found.outside == pytest.approx(0.4, abs=4e-3)
    assert found.seen + found.outside == pytest.approx(1.0)


def test_a_part_hides_itself(rasterizer):
    """A smaller plate above a larger one, both one body: of 1 + 0.25 m² that face the camera 0.25 m² is covered."""
    low, high = plate(1.0, 1.0), plate(0.5, 0.5, z=0.4)
    both = Mesh(
        np.concatenate([low.vertices, high.vertices]),
        np.concatenate([low.faces, high.faces + 4]),
        np.concatenate([low.normals, high.normals]),
    )
    found = visibility(rasterizer, Scene((body("/part", both),)), telecentric(0.01), ["/part"])
    assert found.facing == pytest.approx(1.25)
    assert found.by_itself == pytest.approx(0.2, abs=5e-3)
    assert found.seen == pytest.approx(0.8, abs=5e-3)


def test_a_ball_seen_in_perspective_is_seen_wherever_it_faces(rasterizer):
    """A convex body hides nothing of itself, however steep it stands: no point is lost to the grid of depths."""
    scene = Scene((body("/ball", ball()),))
    cam = replace(camera(eye=(0, 0, 5.0), resolution=(300, 300)), lens=Lens(focal_length=0.002))
    found = visibility(rasterizer, scene, cam, ["ball"])
    assert found.outside == 0
    assert found.seen > 0.995


def test_a_body_that_is_not_there_is_one_error(rasterizer):
    scene = Scene((body("/World/part", plate(1, 1)),))
    with pytest.raises(BrightfieldError, match=r'no body "/World/prt"\. Did you mean "/World/part"'):
        named(scene, ["/World/prt"])
    with pytest.raises(BrightfieldError, match=r'no body "wheel"\. Its bodies are /World/part\.'):
        named(scene, ["wheel"])
    behind = replace(telecentric(0.01, eye=(0, 0, -1.0)))
    with pytest.raises(BrightfieldError, match="Nothing of the workpiece faces"):
        visibility(rasterizer, scene, behind, ["part"])

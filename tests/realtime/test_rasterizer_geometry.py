"""Where things appear: depth and ids against pyrender, positions and edges against cv2.projectPoints, motion, blur."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.frames import look_at
from interchange.material import Material
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene
from realtime.renderers.pyrender import Pyrender
from realtime.sampling import square

GLOW = Material("glow", Lambert(0.0), emission=(1.0, 1.0, 1.0))
BARREL = (-0.28, 0.11, 0.0012, -0.0009, 0.02, 0.03, -0.01, 0.004)


def shapes(make):
    turned = np.diag([0.2, 0.1, 0.15, 1.0])
    turned[:3, 3] = 0.1, 0.2, 0.1
    return Scene(
        (
            Body("/floor", make.plane(2, 2), Material("a")),
            Body("/ball", make.ball(radius=0.3), Material("b"), make.at(-0.3, 0, 0.3)),
            Body("/egg", make.ball(), Material("a"), turned),
            Body("/egg", make.ball(), Material("c"), make.at(0.6, -0.3, 0.2) @ np.diag([-0.1, 0.1, 0.2, 1])),
        )
    )


@pytest.mark.parametrize("projection", list(Projection))
def test_depth_and_ids_are_pyrenders(rasterizer, make, projection):
    pose = look_at(np.array([0.9, -1.6, 1.2]), np.array([0, 0, 0.2]))
    pitch = (1e-5, 1.3e-5) if projection is Projection.PERSPECTIVE else (0.015, 0.015)
    off_axis = (70.0, 65.0) if projection is Projection.PERSPECTIVE else None
    camera = Camera("c", pose, Lens(1.5e-3, projection=projection), Sensor((160, 120), pitch), off_axis)
    scene = shapes(make)
    ours = rasterizer.render(scene, camera, ["depth", "object_id", "material_id"], samples=1)
    with Pyrender() as renderer:
        theirs = renderer.render(scene, camera)
    same = ours.passes["object_id"] == theirs.passes["object_id"]
    assert same.mean() > 0.9995  # both take the pixel's centre; an edge may pass through it
    assert set(np.unique(ours.passes["object_id"])) == {-1, 0, 1, 2}
    assert set(np.unique(ours.passes["material_id"])) == {-1, 0, 1, 2}
    hit = same & (ours.passes["object_id"] >= 0)
    error = np.abs(ours.passes["depth"] - theirs.passes["depth"])[hit]
    assert np.quantile(error, 0.99) < 2e-5  # pyrender's 24 bit over 3 m
    # at 15 mm a pixel: GPUs lay vertices on a grid of 1/256 px, on which pyrender's rows run upwards
    assert np.quantile(error, 0.999) < 6e-5
    assert np.isinf(ours.passes["depth"][ours.passes["object_id"] < 0]).all()


@pytest.mark.parametrize("distortion", [(0.0,) * 8, BARREL])
def test_edges_lie_where_opencv_projects_them(rasterizer, make, distortion):
    """Glowing squares over the whole field: the light of each is its area in the image, and its centroid the area's,
    both from outlines projected by cv2.projectPoints."""
    pose = look_at(np.array([0.3, -0.4, 1.6]), np.array([0.05, 0, 0]))
    camera = Camera(
        "c", pose, Lens(2e-3, distortion=distortion), Sensor((320, 240), (8e-6, 1e-5)), (150.0, 128.0)
    )
    x, y = np.meshgrid(np.linspace(-0.75, 0.75, 9), np.linspace(-0.6, 0.6, 7))
    places = np.column_stack([x.ravel(), y.ravel()])
    side = 0.05
    bodies = [Body(f"/s{i}", make.plane(side, side), GLOW, make.at(*p, 0)) for i, p in enumerate(places)]
    image = rasterizer.render(Scene(tuple(bodies)), camera, samples=1024 if any(distortion) else 256)
    edge = np.linspace(-0.5, 0.5, 17)[:-1] * side
    half = np.full(16, side / 2)
    outline = np.concatenate([np.c_[edge, -half], np.c_[half, edge], np.c_[-edge, half], np.c_[-half, -edge]])
    rvec, _ = cv2.Rodrigues(camera.camera_from_world[:3, :3])
    column, row = np.meshgrid(np.arange(320), np.arange(240))
    errors = []
    for place in places:
        world = np.column_stack([outline + place, np.zeros(64)])
        px, _ = cv2.projectPoints(
            world, rvec, camera.camera_from_world[:3, 3], camera.K, np.array(distortion)
        )
        px = px[:, 0]
        if (px < 3).any() or (px > [316, 236]).any():
            continue
        area, centroid = polygon(px)
        low, high = np.floor(px.min(0)).astype(int) - 3, np.ceil(px.max(0)).astype(int) + 4
        part = (slice(low[1], high[1]), slice(low[0], high[0]))
        light = image.pixels[part][..., 0].astype(float)
        assert abs(light.sum() / area - 1) < 0.02
        errors.append([(light * column[part]).sum(), (light * row[part]).sum()] / light.sum() - centroid)
    assert len(errors) > 30
    assert np.abs(errors).max() < 0.02


def polygon(p):
    """Area and centroid of an outline (shoelace)."""
    q = np.roll(p, -1, axis=0)
    cross = p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]
    return abs(cross.sum()) / 2, ((p + q) * cross[:, None]).sum(0) / (3 * cross.sum())


@pytest.mark.parametrize("projection", list(Projection))
@pytest.mark.parametrize("distortion", [(0.0,) * 8, BARREL])
def test_positions_lie_on_the_surface_and_project_back(rasterizer, make, distortion, projection):
    pose = look_at(np.array([0.3, -0.4, 1.6]), np.array([0.05, 0, 0]))
    pitch = (1.2e-5, 1.6e-5) if projection is Projection.PERSPECTIVE else (0.01, 0.012)
    camera = Camera(
        "c",
        pose,
        Lens(2e-3, distortion=distortion, projection=projection),
        Sensor((160, 120), pitch),
        (75.0, 64.0),
    )
    scene = Scene((Body("/floor", make.plane(3, 3), Material("m")),))
    p = rasterizer.render(scene, camera, ["position"], samples=1).passes["position"].astype(float)
    hit = np.isfinite(p[..., 0])
    assert hit.mean() > 0.8
    assert np.abs(p[hit][:, 2]).max() < 5e-6
    column, row = np.meshgrid(np.arange(160), np.arange(120))
    assert np.abs(camera.project(p) - np.stack([column, row], -1))[hit].max() < 0.02


def test_motion(rasterizer, make):
    scene = shapes(make)
    camera = make.pinhole((0.9, -1.6, 1.2), (0, 0, 0.2), (96, 72))
    step = make.at(0.02, -0.01, 0.03)
    following = Scene(
        (
            scene.bodies[0],
            replace(scene.bodies[1], world_from_body=step @ scene.bodies[1].world_from_body),
            *scene.bodies[2:],
        ),
        cameras=(replace(camera, world_from_camera=make.at(0.01, 0, 0) @ camera.world_from_camera),),
    )
    image = rasterizer.render(
        scene, camera, ["motion", "position", "object_id"], samples=1, next_scene=following
    )
    p, ids, motion = (image.passes[k] for k in ("position", "object_id", "motion"))
    for i, moved in ((0, (0, 0, 0)), (1, (0.02, -0.01, 0.03))):
        mask = ids == i
        expected = following.cameras[0].project(p[mask] + moved) - camera.project(p[mask])
        assert mask.any()
        assert np.abs(motion[mask] - expected).max() < 1e-3
    assert np.isnan(motion[ids < 0]).all()
    with pytest.raises(BrightfieldError, match="motion"):
        rasterizer.render(scene, camera, ["motion"])


def test_thin_lens(rasterizer, make):
    """An edge in focus stays sharp; out of focus it spreads over the circle of confusion f A |z - z_f| / (z z_f)."""
    camera = make.pinhole((0, 0, 2), (0, 0, 0), (128, 32), 0.3, f_stop=0.05, focus_distance=2.0)
    f, aperture = camera.lens.focal_length, camera.lens.focal_length / 0.05
    for z, width in ((2.0, 0.0), (1.0, f * aperture * 1.0 / (1.0 * 2.0) / 1e-5)):
        edge = Scene((Body("/p", make.plane(4, 4), GLOW, make.at(2, 0, 2 - z)),))
        profile = rasterizer.render(edge, camera, samples=256).pixels[16, :, 0]
        blurred = np.count_nonzero((profile > 0.01) & (profile < 0.99))
        assert abs(blurred - width) <= 2 + 0.1 * width
    with pytest.raises(BrightfieldError, match="f_stop"):
        rasterizer.render(edge, camera, samples=1)


def test_far_from_the_origin(rasterizer, make):
    """A scene 10 km away looks as it does at home."""
    camera = make.pinhole((0.9, -1.6, 1.2), (0, 0, 0.2), (96, 72))
    scene = shapes(make)
    far = make.at(1e4, -2e4, 5e3)
    moved = Scene(tuple(replace(b, world_from_body=far @ b.world_from_body) for b in scene.bodies))
    there = replace(camera, world_from_camera=far @ camera.world_from_camera)
    a = rasterizer.render(scene, camera, ["depth", "object_id"], samples=1)
    b = rasterizer.render(moved, there, ["depth", "object_id"], samples=1)
    same = a.passes["object_id"] == b.passes["object_id"]
    assert same.mean() > 0.999
    hit = same & (a.passes["object_id"] >= 0)
    assert np.quantile(np.abs(a.passes["depth"] - b.passes["depth"])[hit], 0.99) < 1e-5


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7, 8, 16, 32, 64, 100])
def test_samples_of_a_pixel_are_centred_on_it(count):
    """Else an image would be shifted: by 0.0135 px at 32 samples before they were."""
    points = square(count)
    assert points.shape == (count, 2)
    assert points.mean(axis=0) == pytest.approx([0.5, 0.5], abs=1e-9)
    assert points.min() >= 0
    assert points.max() < 1
    if count > 1:
        gaps = np.diff(np.sort(points[:, 1]))
        assert gaps.min() > 0.3 / count  # still the lattice: no two in a place

"""What is drawn through a distorting lens lies within 0.05 px of OpenCV's projection over the whole field, live."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial import ConvexHull, Delaunay

from interchange.brdf.lambert import Lambert
from interchange.brdf.phong import Phong
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.distortion import LensModel
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material, Texture
from interchange.mesh import Mesh
from interchange.scene import Body, Scene
from realtime.frame import Frame
from realtime.through import Through

FIVE = (-0.32, 0.14, 0.0012, -0.0009, -0.03)
EIGHT = (-0.28, 0.11, 0.0012, -0.0009, 0.02, 0.03, -0.01, 0.004)
PINCUSHION = (0.25, 0.1, -0.001, 0.001, 0.05)
TWELVE = (*EIGHT, 0.01, -0.003, -0.008, 0.002)
LENSES = {
    "5 parameters": Lens(2e-3, distortion=FIVE),
    "pincushion": Lens(2e-3, distortion=PINCUSHION),
    "8 parameters": Lens(2e-3, distortion=EIGHT),
    "12 parameters": Lens(2e-3, distortion=TWELVE),
    "14 parameters, tilt": Lens(2e-3, distortion=(*TWELVE, 0.06, -0.04)),
    "fisheye": Lens(1e-3, distortion=(-0.03, 0.01, -0.004, 0.001), model=LensModel.FISHEYE),
}
SIZE, PITCH, CENTRE = (200, 150), 9.6e-6, (94.0, 80.0)
POSE = look_at(np.array([0.3, -0.4, 1.6]), np.array([0.05, 0.1, 0]))


def opencv(camera, points):
    rvec, _ = cv2.Rodrigues(camera.camera_from_world[:3, :3])
    t, d = camera.camera_from_world[:3, 3], np.array(camera.lens.distortion)
    if camera.lens.model is LensModel.FISHEYE:
        return cv2.fisheye.projectPoints(points[:, None], rvec, t, camera.K, d)[0][:, 0]
    return cv2.projectPoints(points, rvec, t, camera.K, d)[0][:, 0]


def drawn_through(rasterizer, scene, camera, samples=1):
    """Pixels; AssertionError where the bodies are not drawn through the lens, but looked up in a wide view."""
    used = []
    original = Through.split
    try:
        Through.split = lambda self, group: used.append(group) or original(self, group)
        image = rasterizer.render(scene, camera, samples=samples)
    finally:
        Through.split = original
    assert used, "not drawn through the lens"
    return image.pixels


def coordinates(side):
    """A plane of two faces that glows with its own coordinates: red along x, green along y, 0 to 1."""
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    mesh = Mesh(
        np.column_stack([(corner - 0.5) * side, np.zeros(4)]),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        np.tile([0.0, 0, 1], (4, 1)),
        corner,
    )
    ramp = np.zeros((2, 2, 3), np.float32)
    # bilinear between two texels: from 1/4 to 3/4 of the map it is linear
    ramp[:, 1, 0], ramp[0, :, 1] = 1, 1
    squeeze = np.array([[0.5, 0, 0.25], [0, 0.5, 0.25], [0, 0, 1]])
    glow = Material("ramp", Lambert(0.0), emission_map=Texture(ramp, uv_from_st=squeeze))
    return Body("/board", mesh, glow)


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_what_a_pixel_shows_lies_there(rasterizer, lens):
    """A board of 10 m in two faces that glows with its own coordinates: OpenCV projects what a pixel shows onto it."""
    camera = Camera("c", POSE, lens, Sensor(SIZE, (PITCH, 1.1 * PITCH)), CENTRE)
    side = 10.0
    pixels = drawn_through(rasterizer, Scene((coordinates(side),)), camera).astype(float)
    hit = pixels[..., :2].min(axis=-1) > 0
    assert hit.mean() > 0.9
    points = np.column_stack([(pixels[hit][:, :2] - 0.5) * side, np.zeros(hit.sum())])
    row, column = np.nonzero(hit)
    off = np.abs(opencv(camera, points) - np.column_stack([column, row]))
    assert off.max() < 0.05


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_edges_lie_there(rasterizer, make, lens):
    """Bars of 3 m by 5 cm, two faces each, over the field. One sample a pixel tells an edge to a pixel, so eight images
    are summed whose principal points lie 1/8 px apart: in each column the sum has its edges where OpenCV projects the
    bar's."""
    glow = Material("glow", Lambert(0.0), emission=(1.0, 1.0, 1.0))
    width = 0.05
    places = np.linspace(-1.4, 1.4, 9)
    bars = (Body(f"/b{i}", make.plane(3.0, width), glow, make.at(0, y, 0)) for i, y in enumerate(places))
    scene = Scene(tuple(bars))
    sensor = Sensor(SIZE, (PITCH, 1.1 * PITCH))
    total = np.zeros((SIZE[1], SIZE[0]))
    for shift in (np.arange(8) + 0.5) / 8 - 0.5:
        camera = Camera("c", POSE, lens, sensor, (CENTRE[0], CENTRE[1] + shift))
        total += drawn_through(rasterizer, scene, camera)[..., 0] / 8
    camera = replace(camera, principal_point=CENTRE)
    x = np.linspace(-1.5, 1.5, 4001)
    errors = []
    for y in places:
        lines = [
            opencv(camera, np.column_stack([x, np.full_like(x, y + e), 0 * x]))
            for e in (width / 2, -width / 2)
        ]
        left, right = max(line[:, 0].min() for line in lines), min(line[:, 0].max() for line in lines)
        for column in range(max(8, int(left) + 8), min(SIZE[0], int(right)) - 8, 2):
            low, high = sorted(np.interp(column, *line[np.argsort(line[:, 0])].T) for line in lines)
            if low < 6 or high > SIZE[1] - 6 or high - low < 2.2:
                continue
            full = round((low + high) / 2)  # a pixel that glows in all eight
            above, below = total[full - 5 : full, column].sum(), total[full + 1 : full + 6, column].sum()
            errors.append([full - 0.5 - above - low, full + 0.5 + below - high])
    assert len(errors) > 150
    errors = np.array(errors)
    # eight shifts tell an edge to 1/16 px, evenly spread: 0.036 px rms
    assert np.abs(errors).max() < 0.05 + 1 / 16
    assert np.abs(errors.mean(axis=0)).max() < 0.01
    assert np.sqrt((errors**2).mean(axis=0)).max() < 0.05


def glowing(vertices, faces):
    glow = Material("glow", Lambert(0.0), emission=(1.0, 1.0, 1.0))
    return Body(
        "/glow", Mesh(vertices, faces.astype(np.int32), np.tile([0.0, 0, 1], (len(vertices), 1))), glow
    )


@pytest.mark.parametrize("samples", [1, 16])
def test_no_gap_opens_between_faces(rasterizer, samples):
    """A board of faces of all sizes, split each in its own way, hides all that is behind it."""
    rng = np.random.default_rng(3)
    places = np.vstack(
        [
            rng.uniform(-3, 3, (40, 2)),
            rng.normal(0.2, 0.1, (200, 2)),
            np.array(np.meshgrid([-9, 9], [-9, 9])).reshape(2, -1).T,
        ]
    )
    board = glowing(np.column_stack([places, np.zeros(len(places))]), Delaunay(places).simplices)
    camera = Camera("c", POSE, LENSES["14 parameters, tilt"], Sensor(SIZE, (PITCH, PITCH)), CENTRE)
    assert (drawn_through(rasterizer, Scene((board,)), camera, samples) == 1).all()


@pytest.mark.parametrize("name", ["14 parameters, tilt", "fisheye"])
def test_a_room_around_the_camera(rasterizer, name):
    """Walls of two faces each, also beside and behind the camera, close the view."""
    corners = np.array([[x, y, z] for x in (-2, 2) for y in (-2.0, 2) for z in (-1, 3)])
    walls = ConvexHull(corners).simplices
    camera = Camera("c", POSE, LENSES[name], Sensor(SIZE, (PITCH, PITCH)), CENTRE)
    assert (drawn_through(rasterizer, Scene((glowing(corners, walls),)), camera) == 1).all()


def test_too_near_for_the_vertices_is_drawn_all_the_same(rasterizer):
    """A floor of 2 km, 1 cm below the camera, comes to too many pieces, and is looked up in a wide view."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 1000.0
    floor = glowing(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    pose = look_at(np.array([0, 0, 0.01]), np.array([0.003, 0, 0]))
    camera = Camera("c", pose, LENSES["8 parameters"], Sensor(SIZE, (PITCH, PITCH)), CENTRE)
    with pytest.raises(AssertionError, match="through"):
        drawn_through(rasterizer, Scene((floor,)), camera)
    assert (rasterizer.render(Scene((floor,)), camera, samples=1).pixels == 1).all()


BLURRED = replace(LENSES["8 parameters"], f_stop=0.02, focus_distance=1.7)
TELECENTRIC = Lens(distortion=(-0.04, 0.003, 0.002, -0.001), projection=Projection.ORTHOGRAPHIC)


@pytest.mark.parametrize(
    ("lens", "pitch", "how"),
    [
        (LENSES["5 parameters"], PITCH, {"samples": 4}),
        (LENSES["5 parameters"], PITCH, {"samples": 8, "shading": "pixel"}),
        (LENSES["fisheye"], PITCH, {"samples": 4, "shading": "pixel"}),
        (BLURRED, PITCH, {"samples": 25}),
        (TELECENTRIC, 8e-3, {"samples": 4}),
    ],
    ids=["every sample", "pixels", "fisheye", "blur", "telecentric"],
)
def test_lit_as_in_a_wide_view(rasterizer, make, monkeypatch, lens, pitch, how):
    """Lamps with shadows on bodies and a floor: what is drawn through the lens and what is looked up in a wide view
    are one image, but for the pixels at edges, whose samples lie elsewhere."""
    material = Material("m", Phong((0.3,) * 3, (0.3,) * 3, 20))
    balls = [
        Body(f"/b{i}", make.ball(radius=0.2), material, make.at(x, y, 0.25))
        for i, (x, y) in enumerate([(-0.4, 0.1), (0.3, 0.3), (0.2, -0.3)])
    ]
    floor = Body("/floor", make.plane(4, 4), Material("f", Lambert(0.6)))
    lights = (
        Light("/a", LightKind.SPHERE, (5.0,) * 3, make.facing((1, 0.5, 2), (0, 0, 0)), cone_angle=0.9),
        Light("/b", LightKind.SPHERE, (5.0,) * 3, make.facing((-1, 0.8, 1.5), (0, 0, 0)), cone_angle=0.9),
    )
    scene = Scene((*balls, floor), lights)
    camera = Camera("c", POSE, lens, Sensor(SIZE, (pitch, pitch)), CENTRE)
    through = rasterizer.render(scene, camera, **how).pixels.mean(axis=-1)
    monkeypatch.setattr(Frame, "_bend", lambda self: None)
    wide = rasterizer.render(scene, camera, **how).pixels.mean(axis=-1)
    off = np.abs(through - wide) / (wide + 0.01 * wide.max())
    assert through.mean() == pytest.approx(wide.mean(), rel=2e-3)
    assert np.quantile(off, 0.9) < 0.01
    assert np.median(off) < 1e-3

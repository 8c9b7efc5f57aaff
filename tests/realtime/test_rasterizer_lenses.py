"""Every lens model through the rasteriser: what a pixel shows projects onto it, and edges lie where OpenCV says."""

import cv2
import numpy as np
import pytest

from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.distortion import LensModel
from interchange.frames import look_at
from interchange.material import Material
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene

GLOW = Material("glow", Lambert(0.0), emission=(1.0, 1.0, 1.0))
FOURTEEN = (-0.28, 0.11, 0.0012, -0.0009, 0.02, 0.03, -0.01, 0.004, 0.01, -0.003, -0.008, 0.002, 0.06, -0.04)
FISHEYE = (-0.03, 0.01, -0.004, 0.001)
LENSES = {
    "14 parameters": Lens(2e-3, distortion=FOURTEEN),
    "fisheye": Lens(1e-3, distortion=FISHEYE, model=LensModel.FISHEYE),  # 110° over the columns
    "fisheye without coefficients": Lens(1e-3, model=LensModel.FISHEYE),
}
POSE = look_at(np.array([0.3, -0.4, 1.6]), np.array([0.05, 0, 0]))


def opencv(camera: Camera, points: np.ndarray) -> np.ndarray:
    rvec, _ = cv2.Rodrigues(camera.camera_from_world[:3, :3])
    t, d = camera.camera_from_world[:3, 3], np.array(camera.lens.distortion)
    if camera.lens.model is LensModel.FISHEYE:
        return cv2.fisheye.projectPoints(points[:, None], rvec, t, camera.K, d)[0][:, 0]
    return cv2.projectPoints(points, rvec, t, camera.K, d)[0][:, 0]


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_what_a_pixel_shows_projects_onto_it(rasterizer, make, lens):
    camera = Camera("c", POSE, lens, Sensor((160, 120), (1.2e-5, 1.6e-5)), (75.0, 64.0))
    scene = Scene((Body("/floor", make.plane(12, 12), Material("m")),))
    p = rasterizer.render(scene, camera, ["position"], samples=1).passes["position"].astype(float)
    hit = np.isfinite(p[..., 0])
    assert hit.mean() > 0.8
    column, row = np.meshgrid(np.arange(160), np.arange(120))
    off = opencv(camera, p[hit]) - np.stack([column, row], -1)[hit]
    assert np.abs(off).max() < 0.02  # positions are float32 over 6 m


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_glowing_squares_lie_where_opencv_projects_them(rasterizer, make, lens):
    camera = Camera("c", POSE, lens, Sensor((160, 120), (1.2e-5, 1.6e-5)), (75.0, 64.0))
    x, y = np.meshgrid(np.linspace(-1.2, 1.2, 7), np.linspace(-1, 1, 5))
    side = 0.12
    places = np.column_stack([x.ravel(), y.ravel()])
    bodies = [Body(f"/s{i}", make.plane(side, side), GLOW, make.at(*p, 0)) for i, p in enumerate(places)]
    light = rasterizer.render(Scene(tuple(bodies)), camera, samples=256).pixels[..., 0].astype(float)
    grid = (np.stack(np.meshgrid(np.arange(40), np.arange(40)), -1).reshape(-1, 2) + 0.5) / 40 - 0.5
    column, row = np.meshgrid(np.arange(160), np.arange(120))
    errors = []
    for place in places:
        edge = np.column_stack([grid * side + place, np.zeros(1600)])
        px = opencv(camera, edge).reshape(40, 40, 2)
        if (px < 4).any() or (px > [155, 115]).any():
            continue
        # the centroid of the area in the image: points of the square by the area that each stands for
        du, dv = np.gradient(px, axis=1), np.gradient(px, axis=0)
        area = np.abs(du[..., 0] * dv[..., 1] - du[..., 1] * dv[..., 0])
        centroid = (px * area[..., None]).sum((0, 1)) / area.sum()
        low, high = (
            np.floor(px.min((0, 1))).astype(int) - 2,
            np.ceil(px.max((0, 1))).astype(int) + 3,
        )
        part = (slice(low[1], high[1]), slice(low[0], high[0]))
        weight = light[part]
        errors.append([(weight * c[part]).sum() / weight.sum() for c in (column, row)] - centroid)
    assert len(errors) > 12
    assert np.abs(errors).max() < 0.03  # 256 samples over some 60 edge pixels: 0.02


def test_a_fisheye_of_180_degrees_is_refused(rasterizer, make):
    camera = Camera("c", POSE, Lens(1e-3, model=LensModel.FISHEYE), Sensor((160, 120), (2.5e-5, 2.5e-5)))
    with pytest.raises(BrightfieldError, match="wide pinhole view"):
        rasterizer.render(Scene((Body("/f", make.plane(), Material("m")),)), camera)

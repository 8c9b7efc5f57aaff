"""The round trip: render boards with a known camera, calibrate on the pictures, find the camera again."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from analysis.calibration.boards.april_grid import AprilGrid
from analysis.calibration.boards.asymmetric_circles import AsymmetricCircles
from analysis.calibration.boards.base import Board
from analysis.calibration.boards.charuco import Charuco
from analysis.calibration.boards.chessboard import Chessboard
from analysis.calibration.boards.circles import Circles
from analysis.calibration.body import board_body, views_of
from analysis.calibration.calibration import Calibration, calibrate
from analysis.calibration.models import MODELS
from analysis.calibration.observations import Observations, View
from interchange.camera import Camera, Lens, Sensor
from interchange.distortion import LensModel
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from realtime.renderers.rasterizer import Rasterizer

LENSES = {
    "5": Lens(1.6e-3, distortion=(-0.25, 0.09, 0.001, -0.0008, -0.01)),
    "fisheye": Lens(1.2e-3, distortion=(-0.03, 0.01, -0.004, 0.001), model=LensModel.FISHEYE),
}
NOISE = 1.0  # DN


@pytest.fixture(scope="module")
def rasterizer():
    with Rasterizer() as renderer:
        yield renderer


def camera(model: str, width: int) -> Camera:
    pitch = 1.6e-3 / width
    sensor = Sensor((width, width * 3 // 4), (pitch, pitch))
    return Camera("c", np.eye(4), LENSES[model], sensor, (0.51 * width, 0.367 * width))


def picture(radiance: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.clip(np.rint(255 * radiance[..., 0] + rng.normal(0, NOISE, radiance.shape[:2])), 0, 255).astype(
        np.uint8
    )


def calibrated(board: Board, camera: Camera, model: str, count: int, render) -> Calibration:
    rng = np.random.default_rng(0)
    body, views = board_body(board, 30, glows=True), []
    for pose in views_of(board, camera, count, rng, tilt=(15, 45)):
        seen = replace(camera, world_from_camera=pose)
        found = board.detect(picture(render(Scene((body,)), seen), rng))
        if found is not None:
            views.append(
                View(f"{len(views)}", 0, len(views), found.ids, found.pixels, np.ones(len(found.ids), bool))
            )
    assert len(views) >= count - 1
    return calibrate(Observations(board, ("c",), (camera.sensor.resolution,), tuple(views)), MODELS[model])


def is_within_uncertainty(found: Calibration, camera: Camera) -> None:
    """The whole of K and distortion at once: by chance a larger χ² than this comes once in a thousand."""
    places = found.bundle.of_camera(0)
    true = [*camera.K[[0, 1, 0, 1], [0, 1, 2, 2]], *np.array(camera.lens.distortion)[list(found.model.free)]]
    error, covariance = found.theta[places] - true, found.covariance[np.ix_(places, places)]
    assert chi2.sf(error @ np.linalg.solve(covariance, error), len(places)) > 1e-3, error / np.sqrt(
        np.diag(covariance)
    )
    assert abs(error[0] / true[0]) < 0.01


@pytest.mark.parametrize("model", ["5", "fisheye"])
def test_the_rasterisers_camera_is_found_again(rasterizer, model):
    known = camera(model, 240)
    found = calibrated(
        Chessboard(9, 6, 0.025), known, model, 6, lambda s, c: rasterizer.render(s, c, samples=64).pixels
    )
    assert found.sigma < 0.1  # px
    is_within_uncertainty(found, known)


def test_the_path_tracers_camera_is_found_again():
    known, settings = camera("5", 160), CyclesSettings(samples=8, max_bounces=0)
    with Cycles() as cycles:
        found = calibrated(
            Chessboard(6, 5, 0.025), known, "4", 5, lambda s, c: cycles.render(s, c, settings).pixels
        )
    assert found.sigma < 0.15
    truth = replace(known, lens=replace(known.lens, distortion=known.lens.distortion[:4]))
    is_within_uncertainty(found, truth)


@pytest.mark.parametrize(
    ("board", "least", "bound"),
    [
        (Charuco(8, 6, 0.025), 0.8, 0.15),
        (Circles(8, 6, 0.025), 1.0, 0.1),  # centroids, not centres: up to 0.1 px on this board
        (AsymmetricCircles(5, 9, 0.04), 1.0, 0.1),
        (AprilGrid(3, 3, 0.06), 0.7, 0.15),
        (Chessboard(9, 6, 0.025), 1.0, 0.15),
    ],
    ids=lambda x: x.name if isinstance(x, Board) else "",
)
def test_every_board_is_found_where_it_is_drawn(rasterizer, board, least, bound):
    """``bound`` px: 90 % of the points. Edges that no lens has blurred alias: corners are off by up to 0.1 px."""
    known = camera("5", 320)
    rng = np.random.default_rng(2)
    (pose,) = views_of(board, known, 1, rng, tilt=(25, 30))
    seen = replace(known, world_from_camera=pose)
    image = rasterizer.render(Scene((board_body(board, 30, glows=True),)), seen, samples=64).pixels
    found = board.detect(picture(image, rng))
    assert found is not None
    assert len(found.ids) >= least * len(board.points)
    off = np.linalg.norm(found.pixels - seen.project(board.points[found.ids]), axis=-1)
    assert np.quantile(off, 0.9) < bound
    assert board.detect(np.full((240, 320), 128, np.uint8)) is None


def test_a_printed_board_reflects_what_it_should(rasterizer):
    """Under a lamp straight above: white and black squares by rho / pi times the irradiance."""
    from interchange.light import Light, LightKind

    board = Chessboard(4, 3, 0.1)
    pose = np.eye(4)
    pose[:3, 3] = 0.15, -0.1, 5
    lamp = Light("/lamp", LightKind.DISTANT, (np.pi,) * 3, pose)
    above = np.diag([1.0, -1, -1, 1])
    above[:3, 3] = 0.15, -0.1, 1.0
    known = replace(camera("5", 160), world_from_camera=above, lens=Lens(1.6e-3))
    image = rasterizer.render(Scene((board_body(board),), (lamp,)), known, samples=4).pixels[..., 0]
    first = known.project(np.array([[0.05, -0.05, 0], [0.15, -0.05, 0]])).round().astype(int)
    assert image[first[0, 1], first[0, 0]] == pytest.approx(0.05, rel=0.01)
    assert image[first[1, 1], first[1, 0]] == pytest.approx(0.85, rel=0.01)


def test_a_camera_that_cannot_see_the_whole_board_is_told():
    tight = replace(camera("5", 160), sensor=Sensor((160, 8), (1e-5, 1e-5)))
    with pytest.raises(BrightfieldError, match="whole board in each of 1 views"):
        views_of(Chessboard(9, 6, 0.025), tight, 1, np.random.default_rng(0))


def test_a_staggered_grid_with_even_rows_is_refused():
    with pytest.raises(BrightfieldError, match="odd number of rows"):
        AsymmetricCircles(4, 10, 0.04)


@pytest.mark.parametrize("board", [Circles(7, 6, 1.0), AsymmetricCircles(4, 9, 1.0)], ids=lambda x: x.name)
def test_discs_seen_at_a_slant_are_where_they_are(board):
    """Under an affine map a disc's centroid is its centre: 0.02 px (8 bits, 8 x 8 samples a pixel), though rows are
    three times as near to each other as columns; round windows reach into the next disc or cut this one."""
    A, t = np.array([[36.0, 9.0], [-4.0, 13.0]]) * [1, -1], np.array([60.3, 60.7])
    want = board.points[:, :2] @ A.T + t
    shade = np.full((240, 400), 230.0)
    fine = (np.arange(8 * 60) + 0.5) / 8 - 0.5
    for point, (x, y) in zip(board.points, np.rint(want).astype(int) - 30, strict=True):
        places = (np.stack(np.meshgrid(fine + x, fine + y), -1) - t) @ np.linalg.inv(A).T - point[:2]
        dark = (np.hypot(places[..., 0], places[..., 1]) < board.radius).reshape(60, 8, 60, 8)
        shade[y : y + 60, x : x + 60] -= 200 * dark.mean(axis=(1, 3))
    found = board.detect(np.rint(shade).astype(np.uint8))
    assert found is not None
    apart = np.linalg.norm(found.pixels[:, None] - want[None], axis=-1).min(
        axis=1
    )  # either end may come first
    assert len(apart) == len(want)
    assert apart.max() < 0.02

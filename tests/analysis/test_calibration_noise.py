"""What a calibration says of its own errors, against errors that are known: corners with Gaussian noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from analysis.calibration.boards.chessboard import Chessboard
from analysis.calibration.boards.circles import Circles
from analysis.calibration.body import views_of
from analysis.calibration.bundle import Bundle
from analysis.calibration.calibration import calibrate
from analysis.calibration.cross_validation import cross_validate
from analysis.calibration.models import MODELS
from analysis.calibration.observations import Observations, View
from analysis.calibration.start import vector
from analysis.calibration.uncertainty import grid, projection_uncertainty
from interchange.camera import Camera, Lens, Sensor
from interchange.distortion import LensModel
from interchange.problems import BrightfieldError

BOARD = Chessboard(9, 6, 0.025)
SIGMA = 0.1
LENS = Lens(2.5e-3, distortion=(-0.25, 0.09, 0.001, -0.0008, -0.01))
CAMERA = Camera("c", np.eye(4), LENS, Sensor((640, 480), (5e-6, 5e-6)), (330.0, 236.0))


def exact(camera: Camera, count: int, seed: int = 0, board=BOARD) -> tuple[Observations, np.ndarray]:
    """Views without noise, and θ that explains them."""
    rng = np.random.default_rng(seed)
    fisheye = camera.lens.model is LensModel.FISHEYE
    bundle_model = MODELS["fisheye" if fisheye else "5"]
    views, poses = [], []
    for k, pose in enumerate(views_of(board, camera, count, rng)):
        ids = np.arange(len(board.points))
        pixels = replace(camera, world_from_camera=pose).project(board.points)
        views.append(View(f"{k}.png", 0, k, ids, pixels, np.ones(len(ids), bool)))
        poses.append(vector(np.linalg.inv(pose)))
    d = np.array(camera.lens.distortion)[list(bundle_model.free)]
    theta = np.concatenate([camera.K[[0, 1, 0, 1], [0, 1, 2, 2]], d, *poses])
    return Observations(board, ("c",), (camera.sensor.resolution,), tuple(views)), theta


def noisy(observations: Observations, rng: np.random.Generator) -> Observations:
    views = tuple(
        replace(v, pixels=v.pixels + rng.normal(0, SIGMA, v.pixels.shape)) for v in observations.views
    )
    return replace(observations, views=views)


@pytest.mark.parametrize("model", ["4", "5", "8", "12", "14", "tilt", "fisheye"])
def test_exact_corners_give_the_lens_back(model):
    """From nothing but the corners; every model that holds the truth finds the same projection."""
    lens = Lens(1.8e-3, distortion=(-0.03, 0.01, -0.004, 0.001), model=LensModel.FISHEYE)
    camera = replace(CAMERA, lens=lens) if model == "fisheye" else CAMERA
    if model == "4":
        camera = replace(camera, lens=replace(LENS, distortion=LENS.distortion[:4]))
    observations, _ = exact(camera, 8)
    found = calibrate(observations, MODELS[model])
    assert found.rms < 1e-5
    assert not found.outliers
    if model not in ("12", "14"):  # a part of their 16 and 18 parameters is told apart by noise alone
        assert pytest.approx(camera.K, abs=1e-2) == found.camera(0).K
    seen = np.concatenate([v.pixels for v in observations.views])
    inside = grid((640, 480))[
        (grid((640, 480)) > seen.min(0)).all(-1) & (grid((640, 480)) < seen.max(0)).all(-1)
    ]
    _, true = camera.rays(inside)
    _, ours = found.camera(0).rays(inside)
    angle = np.arccos(np.clip((true * ours).sum(-1), -1, 1)) * camera.K[0, 0]
    assert np.median(angle) < 0.01  # px


@pytest.mark.slow
def test_intervals_of_95_percent_hold_the_truth_95_times_in_100():
    """100 calibrations: of parameters, and of projections at nine pixels of the field. The share of one number has a
    binomial sd of 2.2 %; numbers of one calibration are correlated, so their mean is hardly better: 3 sd."""
    observations, theta = exact(CAMERA, 7)
    rng = np.random.default_rng(3)
    pixels = 0.2 * np.array([640, 480]) + 0.6 * grid(
        (640, 480), 3
    )  # where boards were; beyond it is extrapolated
    hits, field_hits, sigmas = [], [], []
    _, ray = CAMERA.rays(pixels.reshape(-1, 2))
    for _ in range(100):
        found = calibrate(noisy(observations, rng), MODELS["5"], theta)
        error = (found.theta - theta)[:9]
        hits.append(np.abs(error) < 1.96 * np.sqrt(np.diag(found.covariance)[:9]))
        sigmas.append(found.sigma)
        distance = 0.35
        covariance = projection_uncertainty(found, 0, pixels, distance).covariance.reshape(-1, 2, 2)
        moved = np.zeros_like(ray)
        for m in found.observations.moments:  # where the boards, as they were found, say that the points are
            there = found.camera_from_board(0, m) @ np.linalg.inv(_pose(theta, found.bundle, m))
            moved += (distance * ray @ there[:3, :3].T + there[:3, 3]) / len(found.observations.moments)
        off = found.camera(0).project(moved) - pixels.reshape(-1, 2)
        square = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariance), off)
        field_hits.append(square < chi2.ppf(0.95, 2))
    assert np.mean(sigmas) == pytest.approx(SIGMA, rel=0.02)
    assert np.mean(hits) == pytest.approx(0.95, abs=0.065)
    assert np.mean(field_hits) == pytest.approx(0.95, abs=0.065)


def _pose(theta: np.ndarray, bundle: Bundle, m: int) -> np.ndarray:
    from analysis.calibration.start import matrix

    return matrix(theta[bundle.of_moment(m)])


def test_uncertainty_is_least_where_boards_were_and_shrinks_with_more_images():
    few = calibrate(noisy(exact(CAMERA, 6)[0], np.random.default_rng(0)), MODELS["5"])
    many = calibrate(noisy(exact(CAMERA, 24)[0], np.random.default_rng(0)), MODELS["5"])
    a, b = projection_uncertainty(few).sigma, projection_uncertainty(many).sigma
    assert np.median(b) < 0.65 * np.median(a)  # four times the images: half
    assert b[len(b) // 2, b.shape[1] // 2] < b[0, 0]


def test_halves_that_differ_by_noise_alone_agree():
    """p is even in [0, 1]: of 16, more than 4 below 0.05 come once in a thousand; the mean has an sd of 0.072."""
    observations, theta = exact(CAMERA, 12)
    rng = np.random.default_rng(5)
    p, ratio = [], []
    for _ in range(16):
        result = cross_validate(calibrate(noisy(observations, rng), MODELS["5"], theta))
        p.append(result.probability)
        ratio.append(result.ratio)
    assert np.sum(np.array(p) < 0.05) <= 4
    assert np.mean(p) == pytest.approx(0.5, abs=0.22)
    assert 0.35 < np.median(ratio) < 1.3  # the rigid motion between the halves takes part of the difference


def test_a_lens_that_the_model_does_not_hold_makes_the_halves_disagree():
    fisheye = replace(CAMERA, lens=Lens(1.8e-3, model=LensModel.FISHEYE))
    result = cross_validate(calibrate(noisy(exact(fisheye, 12)[0], np.random.default_rng(0)), MODELS["4"]))
    assert not result.agrees


def test_a_rig_of_three_cameras_is_found_within_its_uncertainty():
    """Each camera sees the board at most moments; residuals of all poses against the truth by their covariance."""
    rng = np.random.default_rng(1)
    camera_from_rig = [np.eye(4)]
    for x, turn in ((0.12, -0.2), (-0.1, 0.15)):
        T = np.eye(4)
        T[:3, :3] = [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
        T[:3, 3] = -T[:3, :3] @ [x, 0.01, 0]
        camera_from_rig.append(T)
    views = []
    for m, pose in enumerate(views_of(BOARD, CAMERA, 16, rng)):
        for c, T in enumerate(camera_from_rig):
            pixels = replace(CAMERA, world_from_camera=pose @ np.linalg.inv(T)).project(BOARD.points)
            seen = (np.isfinite(pixels) & (pixels > 0) & (pixels < [639, 479])).all(-1)
            if seen.sum() > 20:
                ids = np.nonzero(seen)[0]
                spot = pixels[ids] + rng.normal(0, SIGMA, (len(ids), 2))
                views.append(View(f"{c}-{m}.png", c, m, ids, spot, np.ones(len(ids), bool)))
    observations = Observations(BOARD, ("a", "b", "c"), ((640, 480),) * 3, ()).only(views)
    found = calibrate(observations, MODELS["5"])
    assert found.sigma == pytest.approx(SIGMA, rel=0.05)
    for c in (1, 2):
        places = found.bundle.of_pose(c)
        error = found.theta[places] - vector(camera_from_rig[c])
        covariance = found.covariance[np.ix_(places, places)]
        assert chi2.sf(error @ np.linalg.solve(covariance, error), 6) > 1e-3
        assert found.camera(c).camera_from_world == pytest.approx(camera_from_rig[c], abs=2e-3)
    assert cross_validate(found, 1).agrees


def test_cameras_that_never_see_the_board_together_are_no_rig():
    observations, _ = exact(CAMERA, 8)
    views = [replace(v, camera=int(v.moment > 3)) for v in observations.views]
    apart = replace(observations, cameras=("a", "b"), resolutions=((640, 480),) * 2, views=tuple(views))
    with pytest.raises(BrightfieldError, match="b share none with the others"):
        calibrate(apart, MODELS["4"])


def test_centroids_of_discs_are_not_their_centres():
    """Centroids of ellipses, given exactly: without the correction the lens is off by many sigma."""
    board = Circles(8, 6, 0.025, diameter=0.7)
    observations, theta = exact(CAMERA, 8, board=board)
    bundle = Bundle(observations, MODELS["5"])
    from analysis.calibration.calibration import _centroid_shifts

    shifts = _centroid_shifts(bundle, theta)
    assert np.abs(np.concatenate(shifts)).max() > 0.1
    seen = bundle.with_pixels([v.pixels + s for v, s in zip(observations.views, shifts, strict=True)])
    found = calibrate(seen.observations, MODELS["5"])
    assert found.theta[:9] == pytest.approx(theta[:9], abs=1e-3)


def test_too_few_points_are_told():
    observations, _ = exact(CAMERA, 3)
    few = [replace(v, ids=v.ids[:6], pixels=v.pixels[:6], used=v.used[:6]) for v in observations.views]
    with pytest.raises(BrightfieldError, match="18 points in 3 images are too few for 36 parameters"):
        calibrate(observations.only(few), MODELS["14"])

"""Real pictures of a chessboard: OpenCV's own calibration, and the command line."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from analysis.calibration.boards.chessboard import Chessboard
from analysis.calibration.bundle import Bundle
from analysis.calibration.calibration import calibrate
from analysis.calibration.cross_validation import cross_validate
from analysis.calibration.models import MODELS
from analysis.calibration.observations import observe
from analysis.calibration.start import rig
from composer.cli import main
from interchange.formats.document import open_scene

PICTURES = sorted((Path(__file__).parents[2] / "assets/calibration").glob("left*.jpg"))
BOARD = Chessboard(9, 6, 0.025)


@pytest.fixture(scope="module")
def observations():
    return observe({"left": PICTURES}, BOARD)


@pytest.mark.parametrize(
    ("model", "flags", "tolerance"),
    [
        ("5", 0, 1e-3),
        ("8", cv2.CALIB_RATIONAL_MODEL, 5e-3),
        ("12", cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_THIN_PRISM_MODEL, 5e-2),
    ],
)
def test_the_least_cost_is_where_opencv_finds_it(observations, model, flags, tolerance):
    """``tolerance`` px: the more parameters, the flatter the valley in which OpenCV stops."""
    bundle, theta = rig(observations, MODELS[model])
    theta, cost = bundle.solve(theta)
    points = [BOARD.points.astype(np.float32)] * len(observations.views)
    pixels = [v.pixels.astype(np.float32) for v in observations.views]
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 500, 1e-15)
    rms, K, d, _, _ = cv2.calibrateCamera(points, pixels, (640, 480), None, None, flags=flags, criteria=stop)
    assert np.sqrt(cost / (54 * len(PICTURES))) == pytest.approx(rms, rel=1e-5)
    assert bundle.lens(theta, 0)[0] == pytest.approx(K, abs=tolerance)
    if model == "5":
        assert bundle.lens(theta, 0)[1][:5] == pytest.approx(d[0, :5], abs=1e-4)


def test_fisheye_is_where_opencv_finds_it(observations):
    bundle, theta = rig(observations, MODELS["fisheye"])
    theta, cost = bundle.solve(theta)
    points = [BOARD.points[None].astype(np.float64)] * len(observations.views)
    pixels = [v.pixels[None] for v in observations.views]
    flags = cv2.fisheye.CALIB_RECOMPUTE_EXTRINSIC | cv2.fisheye.CALIB_FIX_SKEW
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    rms, K, _, _, _ = cv2.fisheye.calibrate(
        points, pixels, (640, 480), np.eye(3), np.zeros(4), flags=flags, criteria=stop
    )
    assert np.sqrt(cost / (54 * len(PICTURES))) == pytest.approx(rms, rel=1e-3)
    assert bundle.lens(theta, 0)[0] == pytest.approx(K, abs=0.05)


def test_the_jacobian_is_the_derivative(observations):
    """Central differences of every parameter of a rig of two cameras, by every lens model."""
    for model in ("14", "fisheye"):
        both = observations.views[:2]
        pair = type(observations)(
            BOARD,
            ("a", "b"),
            ((640, 480),) * 2,
            (both[0], type(both[1])(**{**vars(both[1]), "camera": 1, "moment": 0})),
        )
        bundle = Bundle(pair, MODELS[model])
        rng = np.random.default_rng(0)
        theta = np.zeros(bundle.size)
        for c in (0, 1):
            theta[bundle.of_camera(c)] = [
                500,
                510,
                300,
                250,
                *rng.uniform(-0.02, 0.02, bundle.intrinsics - 4),
            ]
        theta[bundle.of_pose(1)] = 0.1, -0.2, 0.05, 0.1, 0.02, 0.03
        theta[bundle.of_moment(0)] = 0.3, -0.2, 0.1, -0.1, 0.05, 0.6
        for view in pair.views:
            _, J, columns = bundle.of_view(theta, view)
            for k, i in enumerate(columns):
                step = np.zeros(bundle.size)
                step[i] = 1e-6 * max(1, abs(theta[i]))
                up, down = (bundle.of_view(theta + s * step, view)[0] for s in (1, -1))
                expected = ((down - up) / (2 * step[i])).ravel()
                assert J[:, k] == pytest.approx(expected, abs=1e-4 * max(1, np.abs(expected).max())), i


def test_a_wrong_corner_is_named_and_does_no_harm(observations):
    clean = calibrate(observations, MODELS["5"])
    assert not clean.outliers
    moved = [v.pixels.copy() for v in observations.views]
    moved[3][17] += [3.0, -2.0]
    moved[7][40] += [-1.0, 1.0]
    spoiled = Bundle(observations, MODELS["5"]).with_pixels(moved).observations
    found = calibrate(spoiled, MODELS["5"])
    assert [(Path(o.image).name, o.point) for o in found.outliers] == [
        (PICTURES[3].name, 17),
        (PICTURES[7].name, 40),
    ]
    change = (found.theta - clean.theta)[:9] / np.sqrt(np.diag(clean.covariance))[:9]
    assert np.abs(change).max() < 0.3  # two of 702 points are missing


def test_halves_of_the_real_pictures_agree(observations):
    result = cross_validate(calibrate(observations, MODELS["5"]))
    assert result.agrees
    assert result.ratio < 1.5
    assert result.rms < 0.1


def test_too_few_parameters_make_the_halves_disagree(observations):
    result = cross_validate(calibrate(observations, MODELS["pinhole"]))
    assert not result.agrees


def test_the_command_writes_scene_numbers_and_report(tmp_path, capsys):
    board = ["--board", "chessboard", "--size", "9x6", "--pitch", "25"]
    pictures = [str(p) for p in PICTURES[:6]]
    scene, report = tmp_path / "scene.usda", tmp_path / "report.html"
    assert main(["calibrate", *pictures, *board, "--out", str(scene), "--report", str(report),
                 "--origin", PICTURES[0].name]) == 0  # fmt: skip
    assert "Reprojection rms" in capsys.readouterr().out
    page = report.read_text()
    assert page.count("data:image/png") == 2
    assert "http" not in page
    camera = open_scene(scene).scene().camera()
    assert camera.K[0, 0] == pytest.approx(533, abs=5)
    corners = camera.project(BOARD.points)  # the board of the first picture lies at the world's origin
    assert np.abs(corners - BOARD.detect(cv2.imread(str(PICTURES[0]), 0)).pixels).max() < 1
    numbers = tmp_path / "calib.json"
    assert main(["calibrate", *pictures, *board, "--out", str(numbers)]) == 0
    data = json.loads(numbers.read_text())
    assert data["cameras"][0]["K"][0][0] == pytest.approx(camera.K[0, 0], rel=1e-6)
    assert len(data["cameras"][0]["covariance"]) == 9
    again = open_scene(numbers).scene().camera()
    assert again.lens.distortion == pytest.approx(camera.lens.distortion, rel=1e-5)


def test_a_rig_by_the_command_goes_into_a_scene(tmp_path, capsys):
    """Two cameras with the same pictures are one camera twice; the scene's own camera of one name is replaced."""
    pictures = [str(p) for p in PICTURES[:4]]
    scene, out = tmp_path / "planned.usda", tmp_path / "out.usda"
    scene.write_text(
        '#usda 1.0\n(\n defaultPrim = "Hall"\n metersPerUnit = 1\n upAxis = "Z"\n)\ndef Xform "Hall"\n{\n'
        ' def Camera "left" {}\n def Camera "spare" {}\n def Cube "Part" {}\n}\n'
    )
    cameras = ["--camera", "left", *pictures, "--camera", "right", *pictures[::-1]]
    board = ["--board", "chessboard", "--size", "9x6", "--pitch", "25", "--model", "4"]
    assert main(["calibrate", *cameras, *board, "--scene", str(scene), "--out", str(out)]) == 0
    assert "right t_x" in capsys.readouterr().out
    found = {c.name: c for c in open_scene(out).scene().cameras}
    assert set(found) == {"/Hall/left", "/Hall/right", "/Hall/spare"}
    assert pytest.approx(found["/Hall/right"].K, rel=1e-6) == found["/Hall/left"].K
    between = found["/Hall/right"].camera_from_world @ found["/Hall/left"].world_from_camera
    assert between == pytest.approx(np.eye(4), abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--size", "7x5"], "in three images or more of each camera; camera shows the 7 x 5 chessboard"),
        (["--size", "nine"], "--size must be COLUMNSxROWS"),
        (["--size", "9x6", "--marker", "10"], "has no marker"),
        (["--size", "9x6", "--origin", "no.jpg"], "--origin must be one of the pictures"),
        (["--size", "1x6"], "2 to 500 columns and rows"),
    ],
)
def test_errors_are_one_sentence(tmp_path, capsys, arguments, message):
    pictures = [str(p) for p in PICTURES[:4]]
    words = ["calibrate", *pictures, "--board", "chessboard", "--pitch", "25", *arguments]
    assert main([*words, "--out", str(tmp_path / "a.usda")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "a.usda").exists()

"""How good a calibration is, in figures: real pictures, both renderers' pictures, and noise.

    python benchmarks/calibration.py [--out docs/calibration.md] [--views 10] [--trials 300]

Writes the tables that stand at the end of docs/calibration.md. Some ten minutes on two cores.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from scipy.stats import chi2

from analysis.calibration.boards.april_grid import AprilGrid
from analysis.calibration.boards.asymmetric_circles import AsymmetricCircles
from analysis.calibration.boards.base import Board
from analysis.calibration.boards.charuco import Charuco
from analysis.calibration.boards.chessboard import Chessboard
from analysis.calibration.boards.circles import Circles
from analysis.calibration.body import board_body, views_of
from analysis.calibration.calibration import Calibration, calibrate
from analysis.calibration.cross_validation import covered, cross_validate
from analysis.calibration.models import MODELS
from analysis.calibration.observations import Observations, View, observe
from analysis.calibration.start import rig, vector
from analysis.calibration.uncertainty import grid, projection_uncertainty
from interchange.camera import Camera, Lens, Sensor
from interchange.distortion import LensModel
from interchange.scene import Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from realtime.renderers.rasterizer import Rasterizer

PICTURES = sorted((Path(__file__).parents[1] / "assets/calibration").glob("left*.jpg"))
MARK = "<!-- figures -->"
NOISE = 1.0  # DN
BARREL = (-0.25, 0.09, 0.001, -0.0008, -0.01)
LENSES = {
    "5": Lens(3.2e-3, distortion=BARREL),
    "8": Lens(3.2e-3, distortion=(0.3, -0.02, 0.001, -0.0008, 0.01, 0.55, 0.08, 0.02)),
    "12": Lens(3.2e-3, distortion=(*BARREL, 0, 0, 0, 0.004, -0.002, -0.003, 0.001)),
    "tilt": Lens(3.2e-3, distortion=(*BARREL, 0, 0, 0, 0, 0, 0, 0, 0.05, -0.03)),
    "fisheye": Lens(2.4e-3, distortion=(-0.03, 0.01, -0.004, 0.001), model=LensModel.FISHEYE),
}
BOARDS: tuple[Board, ...] = (
    Chessboard(9, 6, 0.025), Charuco(9, 7, 0.025), Circles(9, 6, 0.025), AsymmetricCircles(5, 11, 0.04),
    AprilGrid(4, 3, 0.05),
)  # fmt: skip


def camera(lens: Lens, width: int) -> Camera:
    pitch = 3.2e-3 / width
    sensor = Sensor((width, width * 3 // 4), (pitch, pitch))
    return Camera("c", np.eye(4), lens, sensor, (0.51 * width, 0.367 * width))


def pictured(
    board: Board, known: Camera, count: int, render: Callable[[Scene, Camera], np.ndarray]
) -> tuple[Observations, list[np.ndarray]]:
    """What is seen of a board, and the true camera_from_board of each view."""
    rng = np.random.default_rng(0)
    body, views, poses = board_body(board, 40, glows=True), [], []
    for pose in views_of(board, known, count, rng):
        radiance = render(Scene((body,)), replace(known, world_from_camera=pose))[..., 0]
        image = np.clip(np.rint(255 * radiance + rng.normal(0, NOISE, radiance.shape)), 0, 255).astype(
            np.uint8
        )
        found = board.detect(image)
        if found is not None:
            used = np.ones(len(found.ids), bool)
            views.append(View(f"{len(views)}", 0, len(views), found.ids, found.pixels, used))
            poses.append(np.linalg.inv(pose))
    return Observations(board, ("c",), (known.sensor.resolution,), tuple(views)), poses


def chance(found: Calibration, known: Camera) -> float:
    """p of the χ² of K and distortion."""
    places = found.bundle.of_camera(0)
    d = np.array((*known.lens.distortion, *(0.0,) * 14))[list(found.model.free)]
    error = found.theta[places] - [*known.K[[0, 1, 0, 1], [0, 1, 2, 2]], *d]
    covariance = found.covariance[np.ix_(places, places)]
    return float(chi2.sf(error @ np.linalg.solve(covariance, error), len(places)))


def field_error(found: Calibration, known: Camera, poses: list[np.ndarray]) -> tuple[float, float]:
    """rms px of the projection's error where boards were seen, and the rms that the uncertainty predicts."""
    pixels = grid(known.sensor.resolution)
    inside = covered(found, 0, pixels)
    field = projection_uncertainty(found, 0, pixels)
    _, ray = known.rays(pixels[inside])
    moved = np.zeros_like(ray)
    middle = found.observations.board.points.mean(axis=0)
    half_turn = np.diag([-1.0, -1, 1, 1])
    half_turn[:3, 3] = 2 * middle
    told = [m for m, view in enumerate(found.observations.views) if view.used.any()]  # others have no pose
    for m in told:
        pose, ours = poses[m], found.camera_from_board(0, m)
        if np.trace(ours[:3, :3].T @ pose[:3, :3]) < 1:  # a grid of discs looks the same from its other end
            pose = pose @ half_turn
        there = ours @ np.linalg.inv(pose)
        moved += (field.distance * ray @ there[:3, :3].T + there[:3, 3]) / len(told)
    off = found.camera(0).project(moved) - pixels[inside]
    return float(np.sqrt((off**2).sum(-1).mean())), float(np.sqrt((field.rms[inside] ** 2).mean()))


def real() -> list[str]:
    board = Chessboard(9, 6, 0.025)
    seen = observe({"left": PICTURES}, board)
    rows = []
    flags = {
        "5": 0,
        "8": cv2.CALIB_RATIONAL_MODEL,
        "12": cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_THIN_PRISM_MODEL,
    }
    for name in ("pinhole", "4", "5", "8", "12", "tilt", "fisheye"):
        found = calibrate(seen, MODELS[name])
        halves = cross_validate(found)
        field = projection_uncertainty(found)
        inside = covered(found, 0, field.pixels)
        opencv = ""
        if name in flags:
            bundle, theta = rig(seen, MODELS[name])
            theta, _ = bundle.solve(theta)
            points = [board.points.astype(np.float32)] * len(seen.views)
            stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 500, 1e-15)
            _, K, _, _, _ = cv2.calibrateCamera(
                points, [v.pixels.astype(np.float32) for v in seen.views], (640, 480), None, None,
                flags=flags[name], criteria=stop,
            )  # fmt: skip
            opencv = f"{np.abs(bundle.lens(theta, 0)[0] - K).max():.1e}"
        rows.append(
            f"| {name} | {found.rms:.4f} | {len(found.outliers)} | {np.median(field.sigma[inside]):.3f} | "
            f"{halves.rms:.3f} | {halves.ratio:.2f} | {halves.probability:.1g} | {opencv} |"
        )
    return [
        "## Real pictures",
        "",
        "13 pictures of a chessboard (`assets/calibration`). σ of projection: median where boards were seen. The last "
        "column is the largest difference of K from cv2.calibrateCamera's, on the same corners.",
        "",
        "| model | rms px | outliers | σ of projection px | halves differ px | over expected | p | K - OpenCV's px |",
        "|---|---|---|---|---|---|---|---|",
        *rows,
        "",
    ]


def round_trip(views: int) -> list[str]:
    rows = []

    def row(
        renderer: str, board: Board, name: str, width: int, render: Callable[[Scene, Camera], np.ndarray]
    ) -> None:
        known = camera(LENSES[name], width)
        seen, poses = pictured(board, known, views, render)
        found = calibrate(seen, MODELS[name])
        off, expected = field_error(found, known, poses)
        p = f"{chance(found, known):.2g}" if name in ("5", "tilt", "fisheye") else ""
        error = 100 * (found.theta[0] / known.K[0, 0] - 1)
        sigma = 100 * np.sqrt(found.covariance[0, 0]) / known.K[0, 0]
        rows.append(
            f"| {renderer} {width} px | {board.name} | {name} | {len(seen.views)} of {views} | {found.used_points} | "
            f"{len(found.outliers)} | {found.sigma:.4f} | {error:+.3f} ± {sigma:.3f} | {off:.3f} | "
            f"{expected:.3f} | {p} |"
        )
        print(rows[-1], flush=True)

    with Rasterizer() as live:
        for name in LENSES:
            row("rasteriser", BOARDS[0], name, 640, lambda s, c: live.render(s, c, samples=64).pixels)
        for board in BOARDS[1:]:
            row("rasteriser", board, "5", 640, lambda s, c: live.render(s, c, samples=64).pixels)
    settings = CyclesSettings(samples=32, max_bounces=0)
    with Cycles() as cycles:
        for name in ("5", "tilt", "fisheye"):
            row("path tracer", BOARDS[0], name, 320, lambda s, c: cycles.render(s, c, settings).pixels)
        for board in BOARDS[1:]:
            row("path tracer", board, "5", 320, lambda s, c: cycles.render(s, c, settings).pixels)
    return [
        "## Round trip",
        "",
        "Boards rendered with a known camera, 1 DN of noise, calibrated on. f: error of the focal length and its "
        "reported σ. Field: rms error of projection where boards were seen, and what the uncertainty predicts. p: of a "
        "χ² of K and distortion as large by chance; none for models whose numbers trade with each other along a curved "
        "valley (8, 12), where the projection tells alone.",
        "",
        "| pictures | board | model | found | points | outliers | σ px | f % | field px | predicted px | p |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
        *rows,
        "",
    ]


def coverage(trials: int) -> list[str]:
    board, known = BOARDS[0], camera(LENSES["5"], 640)
    rng = np.random.default_rng(1)
    views, poses = [], []
    for k, pose in enumerate(views_of(board, known, 10, rng)):
        pixels = replace(known, world_from_camera=pose).project(board.points)
        views.append(View(f"{k}", 0, k, np.arange(54), pixels, np.ones(54, bool)))
        poses.append(vector(np.linalg.inv(pose)))
    theta = np.concatenate([known.K[[0, 1, 0, 1], [0, 1, 2, 2]], BARREL, *poses])
    exact = Observations(board, ("c",), ((640, 480),), tuple(views))
    inside, p = [], []
    for _ in range(trials):
        noisy = tuple(replace(v, pixels=v.pixels + rng.normal(0, 0.1, v.pixels.shape)) for v in views)
        found = calibrate(replace(exact, views=noisy), MODELS["5"], theta)
        inside.append(np.abs(found.theta - theta)[:9] < 1.96 * np.sqrt(np.diag(found.covariance))[:9])
        p.append(cross_validate(found).probability)
    names = "".join(f" {n} |" for n in MODELS["5"].names)
    shares = "".join(f" {100 * s:.1f} |" for s in np.mean(inside, axis=0))
    return [
        "## Coverage",
        "",
        f"{trials} calibrations of ten views with 0.1 px of noise on the corners. Intervals of 95 % hold the truth in "
        f"per cent of them (binomial sd {100 * np.sqrt(0.05 * 0.95 / trials):.1f}):",
        "",
        f"|{names} mean |",
        "|" + "---|" * 10,
        f"|{shares} {100 * np.mean(inside):.1f} |",
        "",
        f"The halves of the images disagree (p < 0.01) in {100 * np.mean(np.array(p) < 0.01):.1f} % of them, and have "
        f"p < 0.05 in {100 * np.mean(np.array(p) < 0.05):.1f} %.",
        "",
    ]


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--out", type=Path)
    arguments.add_argument("--views", type=int, default=10)
    arguments.add_argument("--trials", type=int, default=300)
    args = arguments.parse_args()
    parts = []
    for part in (real, lambda: coverage(args.trials), lambda: round_trip(args.views)):
        parts += part()
        print("\n".join(parts), flush=True)
    text = "\n".join(parts).rstrip() + "\n"
    if args.out:
        head = args.out.read_text(encoding="utf-8").split(MARK)[0]
        args.out.write_text(f"{head}{MARK}\n{text}", encoding="utf-8")


if __name__ == "__main__":
    main()

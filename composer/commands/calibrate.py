"""`brightfield calibrate IMAGES...`: cameras from pictures of a board, with what is uncertain about them."""

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from analysis.calibration.boards import boards
from analysis.calibration.boards.base import Board
from analysis.calibration.calibration import Calibration, calibrate_images
from analysis.calibration.cross_validation import CrossValidation, cross_validate
from analysis.calibration.models import MODELS
from analysis.calibration.record import record, write
from analysis.calibration.report import summary_lines, write_report
from interchange.formats.calibrated import write_cameras
from interchange.problems import BrightfieldError

HELP = "calibrate cameras from pictures of a board: lens, poses, uncertainty, outliers"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("images", nargs="*", metavar="IMAGE", help="pictures of one camera")
    parser.add_argument(
        "--camera", nargs="+", action="append", default=[], metavar="NAME IMAGE", dest="cameras",
        help="a camera of a rig and its pictures; once a camera. Pictures of one moment have the same number",
    )  # fmt: skip
    parser.add_argument("--board", required=True, choices=sorted(boards()))
    parser.add_argument(
        "--size", required=True, metavar="COLUMNSxROWS", help="inner corners, squares, discs or tags"
    )
    parser.add_argument(
        "--pitch", required=True, type=float, metavar="MM", help="side of a square or tag, or disc to disc"
    )
    parser.add_argument("--marker", type=float, metavar="MM", help="charuco: side of a marker")
    parser.add_argument("--dictionary", help="charuco, apriltag: one of OpenCV's, DICT_4X4_250 say")
    parser.add_argument("--diameter", type=float, metavar="MM", help="circles: diameter of a disc")
    parser.add_argument("--spacing", type=float, help="apriltag: gap between tags over their side, 0.3 say")
    parser.add_argument("--border", type=int, help="apriltag: width of the tags' black border, bits")
    parser.add_argument("--model", default="5", choices=list(MODELS), help="lens model (default %(default)s)")
    parser.add_argument(
        "--out", required=True, metavar="FILE", help="scene.usda, or calib.json with all numbers"
    )
    parser.add_argument("--report", metavar="HTML", help="a page with pictures")
    parser.add_argument("--scene", metavar="USD", help="put the cameras into a copy of this scene")
    parser.add_argument(
        "--origin",
        metavar="IMAGE",
        help="the board as this picture shows it lies in the world's z = 0, facing up",
    )
    parser.add_argument(
        "--pixel", type=float, default=3.45, metavar="UM", help="pixel pitch (default %(default)s µm)"
    )


def run(args: argparse.Namespace) -> int:
    board = _board(args)
    out = Path(args.out)
    if out.suffix.lower() not in (".json", ".usda", ".usd", ".usdc"):
        raise BrightfieldError(f"A calibration is written as .json, .usda, .usd or .usdc; got {out.name}.")
    if args.scene and out.suffix.lower() == ".json":
        raise BrightfieldError("--scene puts cameras into a scene; --out must then be a USD file.")
    calibration = calibrate_images(_images(args), board, args.model)
    validations = _validations(calibration)
    for text, _ in summary_lines(calibration, validations):
        print(text)
    for c, name in enumerate(calibration.observations.cameras):
        for parameter, value, sigma in calibration.parameters(c):
            print(f"  {name} {parameter:6} {value:14.6g} ± {sigma:.2g}")
    for outlier in calibration.outliers:
        x, y = outlier.pixel
        print(
            f"  outlier: {outlier.image} point {outlier.point} at ({x:.1f}, {y:.1f}), {outlier.residual:.2f} px off"
        )
    if out.suffix.lower() == ".json":
        write(out, record(calibration, validations))
    else:
        world = _world_from_rig(calibration, args.origin)
        names = range(len(calibration.observations.cameras))
        cameras = [calibration.camera(c, world, args.pixel * 1e-6) for c in names]
        write_cameras(cameras, out, Path(args.scene) if args.scene else None)
    print(f"{out} written.")
    if args.report:
        write_report(Path(args.report), calibration, validations)
        print(f"{args.report} written.")
    return 0


def _validations(calibration: Calibration) -> dict[str, CrossValidation]:
    o = calibration.observations
    halves = [
        sum(v.camera == c and v.moment % 2 == half for v in o.views)
        for c in range(len(o.cameras))
        for half in (0, 1)
    ]
    if min(halves) < 3:
        return {}
    return {name: cross_validate(calibration, c) for c, name in enumerate(o.cameras)}


def _images(args: argparse.Namespace) -> dict[str, Sequence[Path]]:
    if bool(args.images) == bool(args.cameras):
        raise BrightfieldError("Name the pictures of one camera, or each camera's by --camera NAME IMAGE ...")
    if args.images:
        return {"camera": [Path(p) for p in args.images]}
    found: dict[str, Sequence[Path]] = {}
    for name, *paths in args.cameras:
        if name in found:
            raise BrightfieldError(f"Cameras must have different names; {name} is there twice.")
        found[name] = [Path(p) for p in paths]
    return found


def _board(args: argparse.Namespace) -> Board:
    try:
        columns, rows = (int(n) for n in args.size.lower().split("x"))
    except ValueError:
        raise BrightfieldError(f"--size must be COLUMNSxROWS, 9x6 say; got {args.size}.") from None
    kind = boards()[args.board]
    ratio = {name: getattr(args, name) / args.pitch for name in ("marker", "diameter") if getattr(args, name)}
    given = {
        **ratio,
        **{n: getattr(args, n) for n in ("dictionary", "spacing", "border") if getattr(args, n)},
    }
    known = {f.name for f in dataclasses.fields(kind)}
    if strange := sorted(given.keys() - known):
        raise BrightfieldError(f"A board of kind {args.board} has no {', '.join(strange)}.")
    return kind(columns, rows, args.pitch * 1e-3, **given)


def _world_from_rig(calibration: Calibration, origin: str | None) -> np.ndarray | None:
    """The board's frame is the world's: x along its rows, y up the board, z out of it."""
    if origin is None:
        return None
    for view in calibration.observations.views:
        if Path(view.image) == Path(origin) or Path(view.image).name == origin:
            return np.asarray(np.linalg.inv(calibration.rig_from_board(view.moment)))
    raise BrightfieldError(
        f"--origin must be one of the pictures in which the board was found; got {origin}."
    )

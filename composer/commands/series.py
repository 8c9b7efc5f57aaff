"""`brightfield series ACTION`: illumination series, from capture to defects, materials, normals and the best lamps.

Every action but ``capture`` reads a folder with ``series.json`` and writes maps (EXR), pictures (PNG) and numbers
(JSON) into ``--out``.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from interchange.problems import BrightfieldError

HELP = (
    "illumination series: capture them, find defects, materials and normals, choose lamps, fuse to one image"
)


@dataclass(frozen=True)
class Action:
    help: str
    options: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], dict[str, Any]]


def configure(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, action in ACTIONS.items():
        one = actions.add_parser(name, help=action.help, description=action.help)
        if name != "capture":
            one.add_argument("series", type=Path, metavar="SERIES", help="a folder with series.json")
            one.add_argument(
                "--without-missing", action="store_true", help="leave out images whose files are missing"
            )
            one.add_argument(
                "--skip-registration", action="store_true", help="do not check that no image has moved"
            )
        one.add_argument("--out", type=Path, required=True, metavar="DIR")
        action.options(one)


def run(args: argparse.Namespace) -> int:
    args.out.mkdir(parents=True, exist_ok=True)
    began = time.perf_counter()
    about = ACTIONS[args.action].run(args)
    about["seconds"] = round(time.perf_counter() - began, 3)
    from analysis.series.folder import write_json

    if args.action != "capture":
        write_json(args.out / f"{args.action}.json", about)
    print(json.dumps(about, indent=1, default=float))
    return 0


def _read(args: argparse.Namespace) -> Any:
    from analysis.series.folder import read
    from analysis.series.registration import check_registered

    series = read(args.series, args.without_missing)
    if not args.skip_registration:
        check_registered(series)
    return series


def _capture_options(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "scene", metavar="SCENE", help="a scene file, or plastic, board, coin: made here, truth known"
    )
    p.add_argument("--camera", default="", metavar="PRIM")
    p.add_argument("--time", type=float, default=0.0, help="time code")
    p.add_argument("--size", type=int, default=128, metavar="PX", help="of plastic, board and coin")
    p.add_argument("--seed", type=int, default=0, help="of plastic, board and coin, and of the noise")
    p.add_argument("--lamps", choices=("reflector", "dome", "distant"), default="reflector")
    p.add_argument("--azimuths", type=int, default=24)
    p.add_argument("--polar", type=int, default=6, help="circles of lamps, from near the axis outwards")
    p.add_argument("--polar-range", type=float, nargs=2, metavar="DEG", help="of dome and distant (15 75)")
    p.add_argument("--radius", type=float, default=250.0, metavar="MM", help="of the dome")
    p.add_argument(
        "--at", type=float, nargs=3, metavar="MM", help="where the lamps aim (the bodies' top middle)"
    )
    p.add_argument("--offline", action="store_true", help="path tracing instead of the rasteriser")
    p.add_argument("--samples", type=int, default=4)
    p.add_argument(
        "--dn", action="store_true", help="PNG as the sensor gives them instead of radiance as EXR"
    )
    p.add_argument("--exposure", type=float, metavar="S", help="(default: what fills the sensor)")
    p.add_argument("--noise-free", action="store_true")


def _capture(args: argparse.Namespace) -> dict[str, Any]:
    from analysis.gap.renderers import renderer
    from analysis.series.capture import capture
    from analysis.series.specimens import SPECIMENS
    from composer.progress import progress_line
    from interchange.formats import images
    from interchange.formats.document import open_scene

    if args.scene in SPECIMENS:
        specimen = SPECIMENS[args.scene](args.size, args.seed)
        scene, camera = specimen.scene, specimen.camera
        images.write(args.out / "truth.png", specimen.truth.astype(np.uint8))
    else:
        scene = open_scene(args.scene).scene(args.time)
        camera = scene.camera(args.camera)
    low, high = scene.bounds
    at = np.array([*(low + high)[:2] / 2, high[2]]) if args.at is None else np.array(args.at) * 1e-3
    with renderer("offline" if args.offline else "realtime", args.samples) as (render, settings):
        series = capture(
            scene,
            camera,
            _lightings(args, at),
            args.out,
            lambda scene, camera: render(scene, camera, (), False),
            settings,
            digital=args.dn,
            exposure=args.exposure,
            seed=None if args.noise_free else args.seed,
            plane=float(at[2]),
            told=progress_line,
        )
    height, width = series.shape
    return {
        "images": len(series),
        "size_px": [width, height],
        "saturated_share": float(1 - series.usable.mean()),
        "written": str(args.out / "series.json"),
    }


def _lightings(args: argparse.Namespace, at: np.ndarray) -> Any:
    from analysis.series import lightings
    from interchange.lamps.reflector import ReflectorDevice

    pose = np.eye(4)
    pose[:3, 3] = at
    if args.azimuths < 1 or args.polar < 1:
        raise BrightfieldError("--azimuths and --polar must be 1 or more.")
    if args.lamps == "reflector":
        device = ReflectorDevice(world_from_device=pose)
        return lightings.reflector(device, args.azimuths, args.polar)
    low, high = np.radians(args.polar_range or (15.0, 75.0))
    angles = lightings.hemisphere(np.linspace(low, high, args.polar), args.azimuths)
    if args.lamps == "dome":
        return lightings.dome(angles, args.radius * 1e-3, at=at)
    return lightings.distant(angles)


def _anomaly_options(p: argparse.ArgumentParser) -> None:
    p.add_argument("--gamma", type=float, default=0.95, help="share of the sound surface below the threshold")
    p.add_argument("--covariance", choices=("sample", "trimmed", "mcd", "shrunk"), default="sample")
    p.add_argument("--law", choices=("chi2", "beta", "empirical"), default="chi2", help="of the threshold")
    p.add_argument("--least-area", type=int, default=1, metavar="PX", help="drop smaller groups")
    p.add_argument("--truth", type=Path, metavar="PNG", help="0 is sound: precision, recall, AUC")


def _anomalies(args: argparse.Namespace) -> dict[str, Any]:
    from analysis.series.anomalies import Law, find_anomalies
    from analysis.series.covariance import Estimator
    from analysis.series.scores import detection

    series = _read(args)
    found = find_anomalies(series, args.gamma, Estimator(args.covariance), Law(args.law), args.least_area)
    _map(args.out / "delta.exr", found.delta)
    _mask(args.out / "mask.png", found.mask)
    _picture(args.out / "delta.png", np.log(np.maximum(found.delta, 1e-6)))
    about = {
        "gamma": args.gamma,
        "threshold": found.threshold,
        "anomalous_share": float(found.mask.mean()),
        "background_pixels": found.background.used,
    }
    if args.truth is not None:
        score = detection(_labels(args.truth, series.shape) > 0, found.delta, found.mask)
        about |= {"precision": score.precision, "recall": score.recall, "auc": score.auc}
    return about


def _cluster_options(p: argparse.ArgumentParser) -> None:
    p.add_argument("--classes", type=int, required=True, metavar="K")
    p.add_argument(
        "--features",
        choices=("lafortune", "lafortune-raw", "raw"),
        default="lafortune",
        help="lafortune: k_d, height and albedo of the lobe; lafortune-raw: C_z, k_d, n; raw: the images themselves",
    )
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--truth", type=Path, metavar="PNG", help="labels: adjusted Rand index")


def _cluster(args: argparse.Namespace) -> dict[str, Any]:
    from analysis.series.clusters import adjusted_rand, k_means

    series = _read(args)
    x, names = _features(series, args.features)
    found = k_means(x, args.classes, args.seed)
    _labelled(args.out, found.labels)
    about: dict[str, Any] = {
        "features": names,
        "pixels": [int((found.labels == k).sum()) for k in range(args.classes)],
        "centers": found.centers.tolist(),
    }
    if args.truth is not None:
        about["adjusted_rand_index"] = adjusted_rand(found.labels, _labels(args.truth, series.shape))
    return about


def _features(series: Any, kind: str) -> tuple[np.ndarray, list[str]]:
    """(H, W, F) and their names."""
    if kind.startswith("lafortune"):
        from analysis.series.lafortune_features import lafortune_features

        found = lafortune_features(series)
        if kind == "lafortune-raw":
            return found.features, ["C_z", "k_d", "n"]
        return found.additive, ["k_d", "lobe height 1/sr", "lobe albedo"]
    return np.moveaxis(series.grey, 0, -1), list(series.names)


def _mask(path: Path, mask: np.ndarray) -> None:
    from interchange.formats import images

    images.write(path, (255 * mask).astype(np.uint8))


def _map(path: Path, values: np.ndarray) -> None:
    """(H, W) or (H, W, 3) as EXR."""
    from interchange.formats import exr
    from interchange.image import Image

    values = np.asarray(values, np.float32)
    exr.write(path, Image(values[..., None] if values.ndim == 2 else values))


def _picture(path: Path, values: np.ndarray) -> None:
    """(H, W) stretched between its 0.5th and 99.5th percentile, for looking at."""
    from interchange.formats import images

    low, high = np.nanpercentile(values, [0.5, 99.5])
    shown = np.clip((values - low) / max(high - low, 1e-12), 0, 1)
    images.write(path, np.rint(255 * np.nan_to_num(shown)).astype(np.uint8))


# red, blue, green, turquoise as in the chapter's Fig. 10, then others
COLORS = np.array(
    [
        [214, 60, 50],
        [60, 90, 210],
        [70, 170, 80],
        [64, 200, 200],
        [230, 170, 50],
        [150, 80, 180],
        [120, 120, 120],
    ]
)


def _labelled(out: Path, labels: np.ndarray) -> None:
    """labels.png: class numbers from 0, 255 for none; classes.png: in colours."""
    from interchange.formats import images

    images.write(out / "labels.png", np.where(labels < 0, 255, labels).astype(np.uint8))
    colors = np.where((labels < 0)[..., None], 0, COLORS[np.maximum(labels, 0) % len(COLORS)])
    images.write(out / "classes.png", colors.astype(np.uint8))


def _labels(path: Path, shape: tuple[int, int]) -> np.ndarray:
    """(H, W) int of an image of class numbers; 255 is -1, no class."""
    from interchange.formats import images

    labels = images.read(path)[..., 0].astype(np.int64)
    if labels.shape != shape:
        raise BrightfieldError(
            f"Labels must have the images' size, {shape[1]} x {shape[0]} px; got {labels.shape[1]} x "
            f"{labels.shape[0]} px. ({path})"
        )
    return np.where(labels == 255, -1, labels)


ACTIONS = {
    "capture": Action("render a series of a scene, one lamp after the other", _capture_options, _capture),
    "anomalies": Action("find defects: pixels unlike the others (RX)", _anomaly_options, _anomalies),
    "cluster": Action("tell materials apart without labels (k-means)", _cluster_options, _cluster),
}

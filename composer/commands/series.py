"""`brightfield series ACTION`: illumination series, from capture to defects, materials, normals and the best lamps.

Every action but ``capture`` and ``focus`` reads a folder with ``series.json``; maps (EXR), pictures (PNG) and numbers
(JSON) are written into ``--out``.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from composer import series_focus
from composer.series_files import (
    read_labels,
    write_colors,
    write_labels,
    write_map,
    write_mask,
    write_picture,
)
from interchange.problems import BrightfieldError

HELP = "illumination series: capture, defects, materials, normals, choice of lamps, fusion to one image"


@dataclass(frozen=True)
class Action:
    help: str
    options: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], dict[str, Any]]


def configure(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, action in ACTIONS.items():
        one = actions.add_parser(name, help=action.help, description=action.help)
        if name not in ("capture", "focus"):
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
    p.add_argument("--width", type=int, metavar="PX", help="of the images (default: the camera's; 128)")
    p.add_argument("--ambient", action="store_true", help="leave the scene's own lamps on")
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
    from analysis.gap.light.radiance import Paths
    from analysis.gap.renderers import renderer
    from analysis.series.capture import capture
    from analysis.series.specimens import SPECIMENS
    from composer.progress import progress_line
    from interchange.formats import images
    from interchange.formats.document import open_scene

    if args.width is not None and not 8 <= args.width <= 32768:
        raise BrightfieldError(f"--width must lie in [8, 32768] px; got {args.width}.")
    if args.scene in SPECIMENS:
        specimen = SPECIMENS[args.scene](128 if args.width is None else args.width, args.seed)
        scene, camera = specimen.scene, specimen.camera
        images.write(args.out / "truth.png", specimen.truth.astype(np.uint8))
    else:
        scene = open_scene(args.scene).scene(args.time)
        camera = scene.camera(args.camera)
        camera = camera if args.width is None else camera.resized(args.width)
    if not args.ambient:
        scene = replace(scene, lights=())
    low, high = scene.bounds
    at = np.array([*(low + high)[:2] / 2, high[2]]) if args.at is None else np.array(args.at) * 1e-3
    with renderer("offline" if args.offline else "realtime", args.samples) as (render, settings):
        series = capture(
            scene,
            camera,
            _lightings(args, at),
            args.out,
            lambda scene, camera: render(scene, camera, (), False, 1, Paths.ALL),
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
        return lightings.reflector(ReflectorDevice(world_from_device=pose), args.azimuths, args.polar)
    low, high = args.polar_range or (15.0, 75.0)
    angles = lightings.hemisphere(np.radians(np.linspace(low, high, args.polar)), args.azimuths)
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
    write_map(args.out / "delta.exr", found.delta)
    write_mask(args.out / "mask.png", found.mask)
    write_picture(args.out / "delta.png", np.log(np.maximum(found.delta, 1e-6)))
    about = {
        "gamma": args.gamma,
        "threshold": found.threshold,
        "anomalous_share": float(found.mask.mean()),
        "background_pixels": found.background.used,
    }
    if args.truth is not None:
        score = detection(read_labels(args.truth, series.shape) > 0, found.delta, found.mask)
        about |= {"precision": score.precision, "recall": score.recall, "auc": score.auc}
    return about


def _cluster_options(p: argparse.ArgumentParser) -> None:
    p.add_argument("--classes", type=int, required=True, metavar="K")
    p.add_argument(
        "--features",
        choices=("lafortune", "lafortune-raw", "raw", "azimuth", "harmonics", "rotation"),
        default="lafortune",
        help="lafortune: k_d, albedo and height of the lobe; lafortune-raw: C_z, k_d, n; raw: the images themselves",
    )
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--truth", type=Path, metavar="PNG", help="labels: adjusted Rand index")


def _cluster(args: argparse.Namespace) -> dict[str, Any]:
    from analysis.series.clusters import adjusted_rand, k_means
    from analysis.series.features import features

    series = _read(args)
    x, names = features(series, args.features)
    found = k_means(x, args.classes, args.seed)
    write_labels(args.out, found.labels)
    about: dict[str, Any] = {
        "features": names,
        "pixels": [int((found.labels == k).sum()) for k in range(args.classes)],
        "centers": found.centers.tolist(),
    }
    if args.truth is not None:
        about["adjusted_rand_index"] = adjusted_rand(found.labels, read_labels(args.truth, series.shape))
    return about


def _normal_options(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "--method",
        choices=("least-squares", "ranks", "l1", "ransac", "specular"),
        default="least-squares",
        help="ranks, l1 and ransac stand highlights and shadows; specular: by the highlight's direction",
    )
    p.add_argument(
        "--shadow", type=float, default=0.0, metavar="SHARE", help="of the brightest; below is shadow"
    )
    p.add_argument("--near", action="store_true", help="solve for heights under near lamps")


def _normals(args: argparse.Namespace) -> dict[str, Any]:
    from analysis.series.integration import heights
    from analysis.series.near_stereo import near_photometric_stereo
    from analysis.series.photometric_stereo import Method, photometric_stereo
    from analysis.series.specular_direction import specular_normals
    from interchange.camera import Projection

    series = _read(args)
    about: dict[str, Any] = {"method": args.method, "lamps": len(series)}
    z = None
    if args.method == "specular":
        n = specular_normals(series)
    else:
        method = Method(args.method)
        if args.near:
            near = near_photometric_stereo(series, method=method, shadow=args.shadow)
            found, z = near.normals, near.heights
            about |= {"steps": near.steps, "last_change_m": near.change}
        else:
            found = photometric_stereo(series, method, args.shadow)
        n = found.n
        write_map(args.out / "albedo.exr", found.rho)
        write_picture(args.out / "albedo.png", found.rho)
        about["residual_median"] = float(np.nanmedian(found.residual))
    write_map(args.out / "normals.exr", n)
    write_colors(args.out / "normals.png", np.nan_to_num(0.5 + 0.5 * n))
    camera = series.camera
    if z is None and camera is not None and camera.lens.projection is Projection.ORTHOGRAPHIC:
        z = heights(n, camera.sensor.pixel_pitch[0])
    if z is not None:
        write_map(args.out / "heights.exr", z)
        write_picture(args.out / "heights.png", z)
        about["height_range_mm"] = float(np.ptp(z) * 1e3)
    about["pixels_without_normal"] = int(np.isnan(n).any(axis=-1).sum())
    about["median_tilt_deg"] = float(np.degrees(np.nanmedian(np.arccos(np.clip(n[..., 2], -1, 1)))))
    return about


def _classify_options(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "--labels", type=Path, required=True, metavar="PNG", help="class numbers, 255 where unknown"
    )
    p.add_argument("--features", choices=("harmonics", "lafortune", "raw"), default="harmonics")
    p.add_argument(
        "--own-frame", action="store_true", help="turn lamps into each pixel's frame by its normal"
    )


def _classify(args: argparse.Namespace) -> dict[str, Any]:
    from analysis.series.features import features
    from analysis.series.hemispherical_harmonics import classify, harmonic_features
    from analysis.series.photometric_stereo import Method, photometric_stereo

    series = _read(args)
    if args.own_frame and args.features == "harmonics":
        x = harmonic_features(series, photometric_stereo(series, Method.RANKS).n)
    else:
        x, _ = features(series, args.features)
    found = classify(x, read_labels(args.labels, series.shape))
    write_labels(args.out, found.labels)
    return {"accuracy_cross_validated": found.accuracy[0], "sd_over_folds": found.accuracy[1]}


def _choose_options(p: argparse.ArgumentParser) -> None:
    p.add_argument("--count", type=int, required=True, metavar="N", help="how many lamps")
    p.add_argument(
        "--labels", type=Path, metavar="PNG", help="classes to tell apart; without, what explains the rest"
    )


def _choose(args: argparse.Namespace) -> dict[str, Any]:
    from analysis.series.choice import choose_by_forest, choose_unsupervised

    series = _read(args)
    if args.labels is not None:
        found = choose_by_forest(series, read_labels(args.labels, series.shape), args.count)
    else:
        found = choose_unsupervised(series, args.count)
    w = series.directions[found.lamps]
    return {
        "score": "accuracy on unseen samples" if args.labels else "share of variance explained",
        "lamps": [
            {
                "image": series.names[k],
                "azimuth_deg": float(np.degrees(np.arctan2(v[1], v[0])) % 360),
                "polar_deg": float(np.degrees(np.arccos(np.clip(v[2], -1, 1)))),
                "score_so_far": float(s),
            }
            for k, v, s in zip(found.lamps, w, found.score, strict=True)
        ],
    }


def _fuse_options(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "--smoothness", type=float, default=1.0, help="0: each pixel's best lamp; large: one for all"
    )
    p.add_argument("--window", type=float, default=2.0, metavar="PX", help="of the local contrast")


def _fuse(args: argparse.Namespace) -> dict[str, Any]:
    from analysis.series.fusion import fuse, local_contrast

    if args.smoothness < 0 or args.window <= 0:
        raise BrightfieldError("--smoothness must be 0 or more, --window greater than 0.")
    series = _read(args)
    found = fuse(series, args.smoothness, args.window)
    write_map(args.out / "fused.exr", found.image)
    write_picture(args.out / "fused.png", found.image)
    w = series.directions[found.lamp]
    write_colors(args.out / "directions.png", 0.5 + 0.5 * w)
    single = local_contrast(series, args.window)[found.best_single]
    return {
        "best_single_image": series.names[found.best_single],
        "mean_contrast_of_best_single": float(single.mean()),
        "mean_contrast_of_places_chosen": float(found.contrast.mean()),
        "lamps_used": len(np.unique(found.lamp)),
    }


def _lights_options(p: argparse.ArgumentParser) -> None:
    p.add_argument("--radius", type=float, required=True, metavar="MM", help="of the mirror sphere")
    p.add_argument("--mask", type=Path, required=True, metavar="PNG", help="255 on the sphere, 0 beside it")
    p.add_argument("--plane", type=float, default=0.0, metavar="MM", help="height z that the sphere lies on")
    p.add_argument("--apply", type=Path, metavar="SERIES", help="write calibrated.json of this series")


def _lights(args: argparse.Namespace) -> dict[str, Any]:
    from analysis.series.folder import read, write_with_directions
    from analysis.series.mirror_sphere import highlights, lights_of_sphere, outline_of, sphere_of_outline
    from interchange.formats import images

    series = read(args.series, args.without_missing, lamps_unknown=True)
    if series.camera is None:
        raise BrightfieldError("Directions from a mirror sphere need the camera of the series.")
    mask = images.read(args.mask)[..., 0].astype(np.float64)
    mask = mask / max(float(mask.max()), 1.0)
    sphere = sphere_of_outline(series.camera, outline_of(mask), args.radius * 1e-3, args.plane * 1e-3)
    seen = lights_of_sphere(series.camera, sphere, highlights(series.grey, mask > 0.5))
    if args.apply is not None:
        print(f"{write_with_directions(args.apply, seen.wi)} written.")
    return {
        "center_mm": (sphere.center * 1e3).tolist(),
        "images": [
            {"image": name, "direction": w.tolist(), "highlight_px": p.tolist()}
            for name, w, p in zip(series.names, seen.wi, seen.pixels, strict=True)
        ],
    }


ACTIONS = {
    "capture": Action("render a series of a scene, one lamp after the other", _capture_options, _capture),
    "anomalies": Action("find defects: pixels unlike the others (RX)", _anomaly_options, _anomalies),
    "cluster": Action("tell materials apart without labels (k-means)", _cluster_options, _cluster),
    "classify": Action("tell materials apart by examples (SVM)", _classify_options, _classify),
    "normals": Action("normals, albedo and heights (photometric stereo)", _normal_options, _normals),
    "choose": Action("the few lamps that say nearly as much as all", _choose_options, _choose),
    "fuse": Action("one image of best contrast", _fuse_options, _fuse),
    "focus": Action("a focus bracket as one sharp image", series_focus.options, series_focus.run),
    "lights": Action("directions to the lamps from images of a mirror sphere", _lights_options, _lights),
}

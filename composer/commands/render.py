"""`brightfield render SCENE`: one frame or many, real-time or path-traced, to OpenEXR in linear radiance or as DN."""

import argparse
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from composer.beside import split_lamps, write_preview
from composer.exposing import SUFFIXES, add_exposure_options, digital, shutter, write_digital
from composer.frames import choose_cameras, file_name, parse_frames
from composer.progress import progress_line
from composer.reading import add_reading_options, options_from
from interchange.camera import Camera
from interchange.formats import exr
from interchange.formats.document import Document, open_scene
from interchange.image import check_passes
from interchange.moments import MOST
from interchange.problems import BrightfieldError

HELP = "render frames to OpenEXR or, as the camera gives them, PNG and TIFF: real-time, or path-traced with --offline"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE")
    parser.add_argument(
        "--offline", action="store_true", help="path-trace with Cycles instead of rasterising"
    )
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        help="FILE.exr (radiance), .png or .tiff (DN) for one frame, a folder for more",
    )
    view = parser.add_argument_group("what is seen")
    view.add_argument(
        "--camera", "--cameras", nargs="+", default=[], metavar="PRIM", help='camera prims, or "all"'
    )
    view.add_argument("--time", type=float, help="time code of the one frame (default: the scene's first)")
    view.add_argument("--frames", help='"0:99" with both ends, "0:99:10", "3,7", or "all"')
    view.add_argument("--width", type=int, default=0, metavar="PX", help="columns; the field of view stays")
    how = parser.add_argument_group("how well")
    how.add_argument("--samples", type=int, help="samples a pixel (default: 16 real-time, 64 path-traced)")
    how.add_argument(
        "--noise", type=float, default=0.0, help="path-traced: relative noise at which a pixel is done"
    )
    how.add_argument("--seed", type=int, default=0, help="path-traced: start of the random numbers")
    how.add_argument(
        "--bounces", type=int, default=6, help="path-traced: reflections after the first (default 6)"
    )
    how.add_argument(
        "--moments",
        type=int,
        default=1,
        metavar="N",
        help="renderings over the exposure, joined row by row: what moves or flashes is exact (default 1)",
    )
    more = parser.add_argument_group("what is written")
    more.add_argument(
        "--passes", nargs="+", default=[], metavar="PASS", help="depth normal object_id ... or all"
    )
    more.add_argument("--per-light", action="store_true", help="also one image a lamp: FILE.LAMP.exr")
    more.add_argument("--preview", action="store_true", help="also a PNG to look at")
    more.add_argument("--dn", choices=("png", "tiff"), help="also the camera's image in DN beside each frame")
    add_exposure_options(parser)
    where = parser.add_argument_group("where it runs (path-traced)")
    where.add_argument("--workers", type=int, default=0, help="worker processes on this machine")
    where.add_argument(
        "--scheduler", metavar="ADDRESS", help="a running Dask scheduler, when one machine is not enough"
    )
    where.add_argument("--timeout", type=float, help="seconds that one frame may take")
    add_reading_options(parser)


def run(args: argparse.Namespace) -> int:
    if args.samples is not None and args.samples < 1:
        raise BrightfieldError(f"--samples must be at least 1; got {args.samples}.")
    if not 0 <= args.width <= 65536:
        raise BrightfieldError(f"--width must lie in [1, 65536] px; got {args.width}.")
    if not 1 <= args.moments <= MOST:
        raise BrightfieldError(f"--moments must lie in [1, {MOST}]; got {args.moments}.")
    if args.moments > 1 and args.per_light:
        raise BrightfieldError(
            "Give --per-light or --moments, not both: an image of several moments has no lamps."
        )
    if args.time is not None and args.frames:
        raise BrightfieldError("Give --time for one frame or --frames for several, not both.")
    passes = check_passes(args.passes)
    document = open_scene(args.scene, options_from(args))
    times = parse_frames(args.frames, document.times) if args.frames else [args.time or document.times[0]]
    if args.time is not None:
        times = [args.time]
    cameras = choose_cameras(document.scene(times[0]), args.camera)
    one = len(times) == 1 and len(cameras) == 1 and not args.frames
    as_dn = one and args.out.suffix.lower() in SUFFIXES
    if one and args.out.suffix.lower() != ".exr" and not as_dn:
        known = ", ".join((".exr", *SUFFIXES))
        raise BrightfieldError(f"One frame is written to a file that ends in {known}; got {args.out}.")
    if args.dn == "png" and args.preview:
        raise BrightfieldError("Give --dn tiff beside --preview: both would be the frame's .png.")
    if as_dn and (args.dn or args.preview or args.per_light):
        raise BrightfieldError("A frame in DN stands alone; give --out FILE.exr for files beside it.")
    by_pass = args.moments == 1 and len(document.times) > 1 and any(c.sensor.frame_rate for c in cameras)
    if by_pass and (args.dn or as_dn):
        args.passes = [*args.passes, "motion"]  # what moves is blurred, or slanted by a rolling shutter
        passes = check_passes(args.passes)
    if not one and args.out.suffix:
        raise BrightfieldError(f"Several frames are written to a folder; got {args.out}.")

    def name(camera: str, time: float) -> Path:
        if as_dn:
            return radiance
        return args.out if one else args.out / file_name(camera, time)

    with tempfile.TemporaryDirectory() as folder:
        radiance = Path(folder) / "radiance.exr"
        failed = _render(args, document, cameras, times, name, passes)
        if as_dn and radiance.is_file():
            write_digital(args.out, digital(exr.read(radiance), args, file_name(cameras[0].name, times[0])))
    _beside(args, [] if as_dn else [name(c.name, t) for c in cameras for t in times])
    return 2 if failed else 0


def _render(
    args: argparse.Namespace,
    document: Document,
    cameras: list[Camera],
    times: list[float],
    name: Callable[[str, float], Path],
    passes: tuple[str, ...],
) -> int:
    """Write the frames as OpenEXR; returns how many failed."""
    if args.offline:
        return _offline(args, [c.name for c in cameras], times, name, passes)
    from composer.rendering import render_live

    samples = args.samples or 16
    render_live(
        document, cameras, times, name, samples, args.passes, args.per_light, args.width, shutter(args), progress_line
    )  # fmt: skip
    return 0


def _offline(
    args: argparse.Namespace,
    cameras: list[str],
    times: list[float],
    name: Callable[[str, float], Path],
    passes: tuple[str, ...],
) -> int:
    """Path-trace what is not finished yet; returns how many frames failed."""
    from offline.batch import frame_jobs, run
    from offline.job import is_done, work
    from offline.settings import CyclesSettings

    settings = CyclesSettings(
        samples=args.samples or 64, noise=args.noise, seed=args.seed, max_bounces=args.bounces
    )
    jobs = frame_jobs(
        args.scene,
        cameras,
        times,
        settings,
        lambda camera, time: str(name(camera, time)),
        passes,
        args.per_light,
        args.width,
        options_from(args),
    )
    jobs = [replace(job, timeout=args.timeout, shutter=shutter(args)) for job in jobs]
    print(
        "Every BRDF is path-traced by its own formula: no closure is fitted, the residual is 0.",
        file=sys.stderr,
    )
    if len(jobs) == 1 and not args.scheduler:  # no cluster for one frame
        if not is_done(jobs[0]):
            work(jobs[0])
        return 0
    report = run(
        jobs, args.scheduler, args.workers, lambda p: progress_line(p.done, p.total, p.left, p.failed)
    )
    if report.skipped:
        print(f"{len(report.skipped)} frames were there already.", file=sys.stderr)
    for file, reason in report.failed:
        print(f"brightfield: {file}: {reason}", file=sys.stderr)
    return len(report.failed)


def _beside(args: argparse.Namespace, files: list[Path]) -> None:
    for file in files:
        if not file.is_file():
            continue  # failed, and told
        if args.per_light:
            split_lamps(file)
        if args.preview:
            write_preview(file)
        if args.dn:
            write_digital(file.with_suffix(f".{args.dn}"), digital(exr.read(file), args, file.stem))

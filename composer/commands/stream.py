"""`brightfield stream SCENE`: cameras of a scene, live, as if they were on the network."""

import argparse
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from types import FrameType
from typing import TYPE_CHECKING

from composer.frames import choose_cameras
from composer.reading import add_reading_options, options_from
from interchange.formats.document import Document, open_scene
from interchange.problems import BrightfieldError

if TYPE_CHECKING:
    from realtime.virtual_camera.moving_scene import MovingScene
    from realtime.virtual_camera.publisher import Publisher
    from realtime.virtual_camera.transports.base import Transport

HELP = "a scene's cameras, live: Motion JPEG, RTSP, GigE Vision, V4L2 or shared memory"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE")
    parser.add_argument(
        "--camera", "--cameras", nargs="+", default=[], metavar="PRIM", help='prims, or "all"'
    )
    parser.add_argument(
        "--as",
        dest="kinds",
        nargs="+",
        default=["mjpeg"],
        metavar="KIND",
        help="mjpeg (default), rtsp, shm, gige, v4l2; several at once",
    )
    where = parser.add_argument_group("where")
    where.add_argument("--address", default="127.0.0.1", help="to bind to (default: this machine alone)")
    where.add_argument(
        "--port",
        type=int,
        help="of the first KIND (default: the one that its clients expect); 0 is a free one",
    )
    where.add_argument(
        "--http", type=int, default=0, metavar="PORT", help="where the truth is told if mjpeg is no KIND"
    )
    how = parser.add_argument_group("the camera")
    how.add_argument(
        "--fps", type=float, help="frames a second (default: the camera's sensor:frameRate, or 30)"
    )
    how.add_argument(
        "--format", help="Mono8, Mono12, BayerRG8, RGB8, ... (default: RGB8, or what its sensor has)"
    )
    how.add_argument("--exposure", type=float, metavar="S", help="exposure time (default: the camera's)")
    how.add_argument("--gain", type=float, metavar="DB", help="gain (default: the camera's)")
    how.add_argument(
        "--trigger",
        type=float,
        nargs="?",
        const=0.0,
        metavar="S",
        help="a frame a trigger, not a frame rate: every S seconds, or, without S, by software",
    )
    how.add_argument("--width", type=int, default=0, metavar="PX", help="columns; the field of view stays")
    how.add_argument("--samples", type=int, default=4, help="a pixel (default %(default)s)")
    how.add_argument(
        "--noise-seed", type=int, default=0, metavar="N", help="another N is another run of noise"
    )
    how.add_argument("--noise-free", action="store_true", help="the mean of many frames instead of one")
    how.add_argument(
        "--maps", nargs="+", default=[], metavar="MAP", help="that frames carry: object_id, depth, ..."
    )
    motion = parser.add_argument_group("what moves")
    motion.add_argument("--still", action="store_true", help="stay at the scene's first frame")
    motion.add_argument("--once", action="store_true", help="stop the time line at its end, not start again")
    motion.add_argument(
        "--conveyor", nargs="+", default=[], metavar="PRIM", help="bodies that a belt carries"
    )
    motion.add_argument(
        "--speed", type=float, default=0.1, metavar="M/S", help="of the belt (default %(default)s)"
    )
    motion.add_argument(
        "--direction",
        type=float,
        nargs=3,
        default=(1.0, 0.0, 0.0),
        metavar=("X", "Y", "Z"),
        help="of the belt",
    )
    motion.add_argument(
        "--length", type=float, default=0.0, metavar="M", help="after which a body comes in again; 0: never"
    )
    motion.add_argument(
        "--pulses",
        type=float,
        default=1000.0,
        metavar="N",
        help="of the belt's encoder a metre (default 1000)",
    )
    motion.add_argument(
        "--moments",
        type=int,
        default=8,
        metavar="N",
        help="renderings of an exposure in which things move, at most (default %(default)s; 1: no motion blur)",
    )
    parser.add_argument(
        "--frames", type=int, default=0, metavar="N", help="end after N frames of each camera"
    )
    add_reading_options(parser)


def run(args: argparse.Namespace) -> int:
    from realtime.virtual_camera.camera import VirtualCamera
    from realtime.virtual_camera.publisher import Publisher
    from realtime.virtual_camera.transports import transport

    kinds = [transport(k) for k in dict.fromkeys(args.kinds)]
    if args.frames < 0:
        raise BrightfieldError(f"--frames must not be negative; got {args.frames}.")
    for name, port in (("--port", args.port), ("--http", args.http)):
        if port is not None and not 0 <= port <= 65535:
            raise BrightfieldError(f"{name} must lie in [0, 65535]; got {port}.")
    document = open_scene(args.scene, options_from(args))
    names = [c.name for c in choose_cameras(document.scene(document.times[0]), args.camera)]
    settings = {
        "frame_rate": args.fps,
        "format": args.format,
        "t_exp": args.exposure,
        "gain_dB": args.gain,
        "triggered": None if args.trigger is None else True,
        "trigger_period": args.trigger,
    }
    asked = {k: v for k, v in settings.items() if v is not None}
    scene = moving(document, args)
    with ExitStack() as stack, interrupted() as stop:
        publishers = []
        for name in names:
            camera = VirtualCamera(
                scene, name, samples=args.samples, noise=not args.noise_free, seed=args.noise_seed,
                maps=args.maps, moments=args.moments, **asked,
            )  # fmt: skip
            publishers.append(stack.enter_context(Publisher(camera, args.frames)))
        serving = [k(publishers, args.address, k.port) for k in kinds]
        if args.port is not None:
            serving[0].asked_port = args.port
        if "mjpeg" not in args.kinds:
            serving.append(transport("mjpeg")(publishers, args.address, args.http))
        stack.callback(summary, publishers, serving)  # before the transports stop, after the cameras did
        for publisher in publishers:  # an error of the scene is told before anything is served
            publisher.camera.prepare()
            told(publisher)
        for one in serving:
            stack.callback(one.stop)
            for line in one.start():
                print(line, flush=True)
        for publisher in publishers:
            stack.callback(publisher.stop)
        for publisher in publishers:
            publisher.start()
        while not stop.is_set() and not all(p.done.is_set() for p in publishers):
            stop.wait(0.1)
        for publisher in publishers:
            if publisher.error is not None:
                raise publisher.error
    return 0


def moving(document: Document, args: argparse.Namespace) -> "MovingScene":
    """The scene by its time line, with the belt that was asked for."""
    from dataclasses import replace

    from interchange.scene import Scene
    from realtime.virtual_camera.joint import Conveyor
    from realtime.virtual_camera.moving_scene import MovingScene, TimeLine

    if not 0 <= args.width <= 65536:
        raise BrightfieldError(f"--width must lie in [1, 65536] px; got {args.width}.")

    def scene_at(code: float) -> Scene:
        scene = document.scene(code)
        if not args.width:
            return scene
        return replace(scene, cameras=tuple(c.resized(args.width) for c in scene.cameras))

    times = document.times
    rate = document.codes_per_second
    line = TimeLine(scene_at, times[0], times[0] if args.still else times[-1], rate, not args.once)
    belts = []
    if args.conveyor:
        direction = (args.direction[0], args.direction[1], args.direction[2])
        belts.append(
            Conveyor("conveyor", tuple(args.conveyor), direction, args.speed, args.length, args.pulses)
        )
    return MovingScene(line, conveyors=belts, live=True)


def told(publisher: "Publisher") -> None:
    """What of the camera a person would wonder at."""
    settings = publisher.camera.settings
    if settings.period > 1.001 / settings.frame_rate and not settings.triggered:
        print(
            f"{publisher.name}: exposing takes {settings.t_exp:g} s, so there are {1 / settings.period:.3g} frames/s, "
            f"not {settings.frame_rate:g}; --exposure gives another.",
            file=sys.stderr,
        )


def summary(publishers: "Sequence[Publisher]", serving: "Sequence[Transport]") -> None:
    for p in publishers:
        t = p.camera.timing
        if not t.frames:
            continue
        print(
            f"{p.name}: {t.frames} frames, {t.rate:.2f} frames/s, jitter {t.jitter_rms * 1e3:.2f} ms rms, late by "
            f"{t.late_median * 1e3:.2f} ms (95 %: {t.late_p95 * 1e3:.2f} ms), {t.missed} periods without a frame",
            file=sys.stderr,
        )
    if not any(p.camera.timing.frames for p in publishers):
        return
    for one in serving:
        for client in one.clients():
            print(
                f"{client['client']}: {client['got']} frames of {client['camera']}, {client['lost']} lost",
                file=sys.stderr,
            )


@contextmanager
def interrupted() -> Iterator[threading.Event]:
    """Set by Ctrl-C and by a request to end: a stream that is stopped has not failed."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def end(number: int, frame: FrameType | None) -> None:
        stop.set()

    before = {s: signal.signal(s, end) for s in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for s, handler in before.items():
            signal.signal(s, handler)

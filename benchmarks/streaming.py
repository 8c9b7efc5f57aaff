"""Live cameras: latency and jitter of each transport, and frames/s against pyrender's offscreen loop.

    python benchmarks/streaming.py [--width 320] [--fps 20] [--changes 60] [--triangles 100000]
    python benchmarks/streaming.py --soak 108000      # memory, stalls, torn frames: benchmarks/streaming_soak.py

Latency: a body jumps in or out of the picture's middle at a random time; a consumer in another process notes when its
pixels show it. Of that, ``camera`` is from the jump to the frame that is ready to be sent (waiting for the next
exposure, which is half a period on average, drawing, exposing) and ``transport`` the rest, compression included.
Clients are unmodified: cv2.VideoCapture for MJPEG and RTSP, Aravis for GigE Vision (left out where it is not
installed). Jitter: rms of the start of exposures about their time.
"""

import argparse
import ctypes.util
import random
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from rasterizer import camera as circling
from rasterizer import paired, processor, pyrender_view, turned
from rasterizer import scene as bumpy
from streaming_scene import PART, pose, scene

from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.frame import Frame
from realtime.virtual_camera.moving_scene import MovingScene
from realtime.virtual_camera.publisher import Publisher
from realtime.virtual_camera.transports import transport

CLIENTS = Path(__file__).with_name("streaming_clients.py")
AWAY = pose(0.3, 0)
KINDS = ("shm", "gige", "mjpeg", "rtsp")


def place(kind: str, served) -> str:
    match kind:
        case "shm":
            return next(iter(served.rings.values())).name
        case "gige":
            return served.address
        case "mjpeg":
            return f"{served.url}/Top.mjpg"
        case _:
            return f"{served.url}/Top"


def latencies(kind: str, width: int, fps: float, changes: int) -> str:
    """A row of the table."""
    moving = MovingScene(scene((width, width * 3 // 4)), live=True)
    camera = VirtualCamera(moving, samples=1, format="Mono8", frame_rate=fps)
    publisher = Publisher(camera)
    served = transport(kind)([publisher], port=transport(kind).port if kind == "gige" else 0)
    ready: list[tuple[bool, int]] = []

    def note(frame: Frame) -> None:
        ready.append((bool(frame.truth.pose(PART)[0, 3] == 0), time.time_ns()))

    publisher.each(note)  # before a transport is called
    served.start()
    publisher.start()
    client = subprocess.Popen(
        [sys.executable, str(CLIENTS), kind, place(kind, served)], stdout=subprocess.PIPE, text=True
    )
    seen: list[tuple[bool, int]] = []
    threading.Thread(
        target=lambda: seen.extend((line[0] == "1", int(line[2:])) for line in client.stdout), daemon=True
    ).start()
    while not seen:
        time.sleep(0.1)
        if client.poll() is not None:
            raise SystemExit(f"the client of {kind} ended before it saw a picture")
    time.sleep(2.0)  # what it had stored while it opened the stream
    choice, jumps, state = random.Random(0), [], True
    for _ in range(changes):
        state = not state
        moving.set_body_pose(PART, pose(0, 0) if state else AWAY)
        jumps.append((state, time.time_ns()))
        time.sleep(10 / fps + choice.uniform(0, 2 / fps))
    publisher.stop()
    served.stop()
    client.terminate()
    client.wait()
    t = camera.timing
    rows = []
    for k, (state, jumped) in enumerate(jumps):
        until = jumps[k + 1][1] if k + 1 < len(jumps) else jumped + int(10e9 / fps)
        sent = next((when for what, when in ready if what == state and when > jumped), None)
        arrived = next((when for what, when in seen if what == state and jumped < when < until), None)
        if sent and arrived:
            rows.append(((arrived - jumped) / 1e6, (sent - jumped) / 1e6, (arrived - sent) / 1e6))
    if not rows:
        return f"| {kind} | no change was seen within ten periods |"
    cells = [f"{np.median(c):.1f} / {np.percentile(c, 95):.1f}" for c in np.transpose(rows)]
    return (
        f"| {kind} | {' | '.join(cells)} | {len(rows)} of {changes} | {t.rate:.1f} | {t.jitter_rms * 1e3:.2f} | "
        f"{t.missed} |"
    )


def against_pyrender(triangles: int, frames: int) -> None:
    """Frames of a turning body: exposed with noise by a live camera, and drawn by pyrender, one after the other."""
    size = (640, 480)
    still = bumpy(triangles)
    fitted = replace(circling(size, 0), name="/camera", t_exp=1e-3)
    fitted = replace(
        fitted, sensor=replace(fitted.sensor, responsivity=1e6, read_noise=7.0, black_level=64.0)
    )
    still = replace(still, cameras=(fitted,))
    moving = MovingScene(still)
    for samples in (1, 4):
        with VirtualCamera(moving, samples=samples, format="Mono8") as camera:

            def ours(step: int, camera: VirtualCamera = camera) -> object:
                moving.set_body_pose("/sphere", turned(still, step).bodies[0].world_from_body)
                moving.set_camera_pose("/camera", circling(size, step).world_from_camera)
                return camera.read()

            ours(0)
            for shadows in (True, False):
                with pyrender_view(still, size, shadows) as draw:
                    wall, cpu = paired(ours, draw, frames)
                print(
                    f"{samples} samples a pixel, as fast as pyrender (MSAA 4, shadows {'on' if shadows else 'off'}): "
                    f"{wall:.2f} times by the clock, {cpu:.2f} by CPU time", flush=True,
                )  # fmt: skip
        start = time.perf_counter()
        with VirtualCamera(moving, samples=samples, format="Mono8") as camera:
            camera.read()
            start = time.perf_counter()
            for step in range(frames):
                ours(step, camera)
        print(f"{samples} samples a pixel: {frames / (time.perf_counter() - start):.1f} frames/s", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--fps", type=float, default=20.0)
    parser.add_argument("--changes", type=int, default=60)
    parser.add_argument("--kinds", nargs="+", default=KINDS)
    parser.add_argument("--triangles", type=int, default=100_000, help="against pyrender; 0 leaves that out")
    parser.add_argument("--frames", type=int, default=8, help="pairs of frames against pyrender")
    parser.add_argument(
        "--soak", type=int, default=0, metavar="FRAMES", help="soak for so many frames instead"
    )
    a = parser.parse_args()
    if a.soak:
        soak = [sys.executable, str(CLIENTS.with_name("streaming_soak.py")), "--frames", str(a.soak)]
        sys.exit(subprocess.call([*soak, "--fps", str(a.fps)]))
    print(processor())
    print(
        f"{a.width} x {a.width * 3 // 4} px, Mono8 with noise, {a.fps:g} frames/s asked for, ms: median / 95 %"
    )
    print(
        "| | jump to pixels | camera | transport | changes seen | frames/s | jitter, ms rms | periods missed |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for kind in a.kinds:
        if kind == "gige" and not ctypes.util.find_library("aravis-0.8"):
            print("| gige | libaravis-0.8-0 is not installed: no client |")
            continue
        print(latencies(kind, a.width, a.fps, a.changes), flush=True)
    if a.triangles:
        against_pyrender(a.triangles, a.frames)


if __name__ == "__main__":
    main()

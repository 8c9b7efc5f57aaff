"""Many frames at full rate, clients that come and go, one that hangs: memory, stalls and torn frames.

    python benchmarks/streaming_soak.py [--frames 108000] [--fps 100] [--width 96]

108,000 frames are an hour at 30 frames/s. A child process reads Motion JPEG and shared memory; each of its two clients
stays for some hundred frames, goes, and comes again. A third connection never reads. Every frame that a client takes
is compared, by its checksum, with what the camera made of that number.
"""

import argparse
import os
import random
import re
import socket
import subprocess
import sys
import threading
import time
import urllib.request
import zlib
from collections import OrderedDict
from pathlib import Path

from streaming_scene import PART, scene

from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.frame import Frame
from realtime.virtual_camera.joint import Conveyor
from realtime.virtual_camera.moving_scene import MovingScene
from realtime.virtual_camera.publisher import Publisher
from realtime.virtual_camera.reader import SharedReader
from realtime.virtual_camera.transports.mjpeg import Mjpeg
from realtime.virtual_camera.transports.rtsp import Rtsp
from realtime.virtual_camera.transports.shm import Shm, ring_name

KEPT = 3000  # checksums of the latest frames


def resident() -> float:
    """MB of memory that this process holds (Linux)."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def tell(*words: object) -> None:
    """A line in one piece: two clients share the way out."""
    sys.stdout.write(" ".join(map(str, words)) + "\n")
    sys.stdout.flush()


def read_http(url: str, count: int) -> None:
    """Some parts of a multipart stream, a line each."""
    with urllib.request.urlopen(url, timeout=30) as stream:
        while count and stream.readline().startswith(b"--"):
            headers = {}
            while line := stream.readline().strip():
                name, _, value = line.decode().partition(": ")
                headers[name] = value
            jpeg = stream.read(int(headers["Content-Length"]))
            stream.readline()
            tell("jpeg", headers["X-Frame-Number"], zlib.crc32(jpeg), headers["X-Frames-Lost"])
            count -= 1


def read_ring(name: str, count: int) -> None:
    with SharedReader(name, timeout=30) as reader:
        for frame in reader:
            pixels = frame.copy()
            if pixels is not None:
                tell("raw", frame.number, zlib.crc32(pixels), reader.lost)
            count -= 1
            if not count:
                return


def clients(url: str) -> None:
    """Both come and go until the camera has gone."""
    name = url.rsplit("/", 1)[1].removesuffix(".mjpg")

    def again(read, place: str, seed: int) -> None:
        choice = random.Random(seed)
        while True:
            try:
                read(place, choice.randint(50, 500))
            except Exception:  # the camera has gone
                return
            time.sleep(choice.uniform(0, 0.5))

    threads = [
        threading.Thread(target=again, args=(read_http, url, 1)),
        threading.Thread(target=again, args=(read_ring, ring_name(name), 2)),
    ]
    for t in threads:
        t.start()
    for t in threads:
        t.join()


def hang(url: str, stopped: threading.Event, counted: list[int]) -> None:
    """A connection that never reads, again and again: the server lets go of it."""
    host, port, path = re.fullmatch(r"http://(.+):(\d+)(/.+)", url).groups()
    while not stopped.is_set():
        with socket.create_connection((host, int(port))) as place:
            place.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            place.sendall(f"GET {path} HTTP/1.0\r\n\r\n".encode())
            counted[0] += 1
            stopped.wait(60)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--frames", type=int, default=108_000)
    parser.add_argument("--fps", type=float, default=100.0)
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument("--clients", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.clients:
        clients(arguments.clients)
        return
    resolution = (arguments.width, arguments.width * 3 // 4)
    belt = Conveyor("belt", (PART,), (1, 0, 0), 0.05, 0.2, start=-0.1)
    moving = MovingScene(scene(resolution, "Soak"), conveyors=(belt,), live=True)
    camera = VirtualCamera(moving, samples=1, format="Mono8", frame_rate=arguments.fps)
    publisher = Publisher(camera, arguments.frames)
    mjpeg = Mjpeg([publisher])
    made: dict[str, OrderedDict[int, int]] = {"jpeg": OrderedDict(), "raw": OrderedDict()}
    longest = [0.0, 0.0]  # s between frames, when the last one was

    def remember(frame: Frame) -> None:
        now = time.monotonic()
        longest[0] = max(longest[0], now - longest[1]) if longest[1] else 0.0
        longest[1] = now
        made["jpeg"][frame.number] = zlib.crc32(mjpeg.compress[publisher.name](frame))
        made["raw"][frame.number] = zlib.crc32(frame.pixels)
        for sums in made.values():
            while len(sums) > KEPT:
                sums.popitem(last=False)

    publisher.each(remember)  # before a transport is called: a client cannot ask sooner
    served = [mjpeg, Shm([publisher]), Rtsp([publisher])]
    for one in served:
        for line in one.start():
            print(line, flush=True)
    url = f"{mjpeg.url}/{publisher.name}.mjpg"
    read = {"jpeg": 0, "raw": 0}
    lost, wrong, hung, stopped = {"jpeg": 0, "raw": 0}, [], [0], threading.Event()
    began = time.monotonic()
    publisher.start()
    child = subprocess.Popen([sys.executable, __file__, "--clients", url], stdout=subprocess.PIPE, text=True)
    threading.Thread(target=hang, args=(url, stopped, hung), daemon=True).start()

    def compare() -> None:
        last = {"jpeg": (0, 0), "raw": (0, 0)}
        for line in child.stdout:
            kind, number, checksum, gone = line.split()
            expected = made[kind].get(int(number))
            if expected is None or expected != int(checksum):
                wrong.append((kind, int(number), "unknown" if expected is None else "torn"))
            read[kind] += 1
            before = last[kind][1] if int(gone) >= last[kind][1] else 0
            lost[kind] += int(gone) - before
            last[kind] = int(number), int(gone)

    comparing = threading.Thread(target=compare, daemon=True)
    comparing.start()
    steps = [arguments.frames * k // 10 for k in range(1, 11)]
    for step in steps:
        while camera.position[0] < step and not publisher.done.is_set():
            time.sleep(0.2)
        print(
            f"{camera.position[0]} frames, {time.monotonic() - began:.0f} s, {time.process_time():.0f} CPU s, "
            f"{resident():.1f} MB, {threading.active_count()} threads, {len(publisher.subscriptions)} readers, "
            f"longest wait {longest[0] * 1e3:.0f} ms, load {os.getloadavg()[0]:.1f}; "
            f"compared {sum(read.values())}, lost {sum(lost.values())}, wrong or torn {len(wrong)}", flush=True,
        )  # fmt: skip
    publisher.done.wait()
    stopped.set()
    t = camera.timing
    print(f"{t.frames} frames in {time.monotonic() - began:.0f} s, {publisher.error or 'no error'}")
    print(f"last {min(t.frames, 10_000)}: {t.rate:.2f} frames/s, jitter {t.jitter_rms * 1e3:.2f} ms rms")
    print(f"longest time between two frames {longest[0] * 1e3:.0f} ms; {t.missed} periods without a frame")
    publisher.stop()
    for one in served:
        one.stop()
    child.wait()
    comparing.join()
    connections = len({c["client"] for c in mjpeg.clients()})
    print(
        f"read and compared: {read['jpeg']} JPEG (lost {lost['jpeg']}), {read['raw']} raw (lost {lost['raw']})"
    )
    print(f"hung {hung[0]} times; {connections} HTTP connections; wrong or torn: {len(wrong)} {wrong[:5]}")
    if wrong or publisher.error:
        sys.exit(1)


if __name__ == "__main__":
    main()

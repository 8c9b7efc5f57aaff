"""Laws of the transports: no frame is torn, numbers go up, who is slow is told so and slows nobody else."""

import io
import json
import os
import re
import socket
import subprocess
import sys
import threading
import urllib.error
import urllib.request
from multiprocessing import shared_memory

import cv2
import numpy as np
import pytest

from interchange.problems import BrightfieldError
from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.reader import SharedReader
from realtime.virtual_camera.ring import Layout
from realtime.virtual_camera.transports.mjpeg import Mjpeg
from realtime.virtual_camera.transports.shm import Ring, Shm


def parts(url):
    """(headers, JPEG) of a multipart stream."""
    with urllib.request.urlopen(url, timeout=20) as stream:
        boundary = re.search("boundary=(.+)", stream.headers["Content-Type"])[1].encode()
        while stream.readline().strip() == b"--" + boundary:
            headers = {}
            while line := stream.readline().strip():
                key, _, value = line.decode().partition(": ")
                headers[key] = value
            yield headers, stream.read(int(headers["Content-Length"]))
            stream.readline()


def get(url):
    with urllib.request.urlopen(url, timeout=20) as answer:
        return answer.read()


def post(url, body, kind="application/json"):
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    request = urllib.request.Request(url, data=data, headers={"Content-Type": kind})
    with urllib.request.urlopen(request, timeout=20) as answer:
        return json.loads(answer.read())


def refusal(call, *arguments):
    with pytest.raises(urllib.error.HTTPError) as caught:
        call(*arguments)
    return caught.value.code, json.loads(caught.value.read())["error"]


# MJPEG


def test_parts_are_whole_numbered_and_hold_the_frame_that_they_say(empty, live):
    with live.streaming(empty, live.Flat(), frame_rate=200) as (_, served):
        numbers = []
        for headers, jpeg in parts(f"{served.url}/Top.mjpg"):
            picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED)
            number = int(headers["X-Frame-Number"])
            assert np.abs(picture - live.level(number + 1)).max() <= 1  # the first call was to prepare
            numbers.append(number)
            if len(numbers) == 25:
                break
    assert numbers == sorted(set(numbers))
    assert int(headers["X-Frames-Lost"]) == numbers[-1] - numbers[0] + 1 - 25


def test_opencv_opens_the_stream(empty, live):
    with live.streaming(empty, live.Flat(), frame_rate=100) as (_, served):
        capture = cv2.VideoCapture(f"{served.url}/Top.mjpg", cv2.CAP_FFMPEG)
        assert capture.isOpened()
        pictures = [capture.read()[1] for _ in range(8)]
        capture.release()
    assert {p.shape for p in pictures} == {(48, 64, 3)}
    for p in pictures:
        assert np.ptp(p) <= 2  # flat: of one frame alone
        assert min(abs(p.mean() - live.level(k)) for k in range(8)) <= 1.5


def test_a_client_that_hangs_loses_frames_and_slows_nobody(empty, live):
    """It never reads: its buffers fill, and the camera and another client go on."""
    wide = live.camera_above("/World/Top", sensor=live.UNIT.__class__(
        resolution=(640, 480), responsivity=1000.0, full_well=255.0, bit_depth=8
    ))  # fmt: skip
    scene = empty.__class__(empty.bodies, (), (wide,))
    with live.streaming(scene, live.Flat(rich=True), frame_rate=200) as (publisher, served):
        hung = socket.create_connection(served.url.removeprefix("http://").split(":"))
        hung.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
        hung.sendall(b"GET /Top.mjpg HTTP/1.0\r\n\r\n")
        first = None
        for count, (headers, _) in enumerate(parts(f"{served.url}/Top.mjpg"), 1):
            first = first or int(headers["X-Frame-Number"])
            if count == 40:
                break
        clients = {c["client"]: c for c in json.loads(get(f"{served.url}/clients.json"))}
        stuck = clients.pop("{}:{}".format(*hung.getsockname()))
        (alive,) = clients.values()
        assert alive["got"] >= 40
        assert stuck["got"] < 25  # some 250 kB a frame: what fits into the buffers
        while publisher.latest.number < int(headers["X-Frame-Number"]) + 20:
            publisher.after(publisher.latest.number, 5.0)  # the camera goes on
        hung.settimeout(20)
        received = b""
        while not re.search(rb"X-Frames-Lost: [1-9]", received):
            received = received[-40:] + hung.recv(1 << 16)  # it wakes up, and is told
        hung.close()


def test_the_truth_of_every_frame_can_be_asked_for(empty, live):
    with live.streaming(empty, live.Flat(), frame_rate=100) as (publisher, served):
        publisher.after(4, 10.0)
        told = json.loads(get(f"{served.url}/Top/truth.json?number=3"))
        assert told["number"] == 3
        assert told["bodies"]["/World/Part"] == np.eye(4).tolist()
        assert told["stamp_ns"] == publisher.truth(3).stamp_ns
        assert post(f"{served.url}/scene", {"bodies": {"/World/Part": live.at(1, 2).tolist()}}) == {
            "done": True
        }
        seen = publisher.latest.number + 1
        publisher.after(seen, 10.0)
        later = json.loads(get(f"{served.url}/Top/truth.json"))
        assert later["bodies"]["/World/Part"] == live.at(1, 2).tolist()
        exact = np.load(io.BytesIO(get(f"{served.url}/Top.npy")))
        assert np.ptp(exact) == 0
        assert exact.shape == (48, 64)
        assert refusal(get, f"{served.url}/Top/truth.json?number=99999999")[0] == 404


def test_a_trigger_over_http_gives_one_frame(empty, live):
    with live.streaming(empty, live.Flat(), triggered=True) as (publisher, served):
        assert publisher.latest is None
        for number in (1, 2):
            post(f"{served.url}/Top/trigger", {})
            assert publisher.after(number - 1, 10.0).number == number
        assert publisher.after(2, 0.1) is None
        told = post(
            f"{served.url}/Top/settings", {"gain_dB": 6, "exposure_s": 0.002, "region": [0, 0, 32, 16]}
        )
        assert told["gain_dB"] == 6
        post(f"{served.url}/Top/trigger", {})
        frame = publisher.after(2, 10.0)
        assert frame.pixels.shape == (16, 32)
        assert frame.truth.camera.t_exp == 0.002


def test_a_server_refuses_what_is_not_meant_for_it(empty, live):
    with live.streaming(empty, live.Flat(), triggered=True) as (publisher, served):
        url = served.url
        assert refusal(get, f"{url}/Topp.mjpg")[0] == 404
        assert refusal(get, f"{url}/../etc/passwd")[0] == 404
        assert refusal(get, f"{url}/Top.jpg") == (503, "There is no frame yet.")
        assert refusal(post, f"{url}/Top/trigger", {}, "text/plain")[0] == 415
        assert refusal(post, f"{url}/Top/settings", b"{")[0] == 400
        assert refusal(post, f"{url}/Top/settings", [1])[1] == "A request must be a JSON object; got list."
        assert 'Did you mean "gain_dB"' in refusal(post, f"{url}/Top/settings", {"gain_db": 1})[1]
        assert "must be numbers" in refusal(post, f"{url}/Top/settings", {"gain_dB": "loud"})[1]
        assert "must be a number" in refusal(post, f"{url}/scene", {"joints": {"a": "b"}})[1]
        assert "No body" in refusal(post, f"{url}/scene", {"bodies": {"/x": None}})[1]
        request = urllib.request.Request(f"{url}/clients.json", headers={"Host": "evil.example:80"})
        assert refusal(urllib.request.urlopen, request)[0] == 403
        assert publisher.latest is None


def test_an_occupied_port_is_one_clear_error(empty, live):
    with live.streaming(empty, live.Flat()) as (publisher, served):
        port = int(served.url.rsplit(":", 1)[1])
        with pytest.raises(BrightfieldError, match=f"Nothing can be served at 127.0.0.1:{port}"):
            Mjpeg([publisher], port=port).start()


# shared memory


def ring_of(empty):
    return f"test-{os.getpid()}-{id(empty)}"


def frame_of(empty, live, number=1):
    with VirtualCamera(empty, "Top", draw=live.Pattern(), noise=False, format="Mono8") as camera:
        for _ in range(number):
            frame = camera.take()
    return frame


def test_a_ring_gives_back_what_was_written_and_says_when_it_was_overwritten(empty, live):
    camera = VirtualCamera(empty, "Top", draw=live.Pattern(), noise=False, format="Mono8")
    frames = [camera.take() for _ in range(12)]
    ring = Ring(ring_of(empty), frames[0], slots=4)
    try:
        reader = SharedReader(ring.name)
        assert reader.newest == 0
        ring.put(frames[0])
        first = reader.next()
        np.testing.assert_array_equal(first.pixels, live.pattern(1))
        assert not first.pixels.flags.writeable
        assert first.truth()["number"] == 1
        assert first.stamp_ns == frames[0].stamp_ns
        for frame in frames[1:4]:
            ring.put(frame)
        assert first.whole
        ring.put(frames[4])  # the fifth of four slots
        assert not first.whole
        assert first.copy() is None
        assert first.truth() is None
        assert reader.next().number == 5
        assert (reader.got, reader.lost) == (2, 3)
        assert reader.next(timeout=0.01) is None
    finally:
        ring.close()
    assert reader.ended
    assert reader.next() is None


def test_a_reader_never_takes_a_frame_that_is_being_written(empty, live):
    """A writer at full speed, a reader at full speed: every frame that it calls whole is the pattern of its number."""
    camera = VirtualCamera(empty, "Top", draw=live.Pattern(), noise=False, format="Mono8")
    frames = [camera.take() for _ in range(400)]
    ring = Ring(ring_of(empty), frames[0], slots=2)
    reader = SharedReader(ring.name)

    def write():
        for frame in frames:
            ring.put(frame)

    writer = threading.Thread(target=write)
    writer.start()
    numbers = []
    while writer.is_alive() or reader.newest > reader.latest:
        frame = reader.next(timeout=0.05)
        pixels = frame.copy() if frame is not None else None
        if pixels is not None:
            np.testing.assert_array_equal(pixels, live.pattern(frame.number))
            numbers.append(frame.number)
    writer.join()
    ring.close()
    assert numbers == sorted(set(numbers))
    assert numbers[-1] == 400
    assert reader.got + reader.lost == 400 - (numbers[0] - 1)


CHILD = """
import json, sys
import numpy as np
from realtime.virtual_camera.reader import SharedReader
with SharedReader(sys.argv[1], timeout=30) as reader:
    seen = []
    for frame in reader:
        pixels = frame.copy()
        if pixels is not None:
            seen.append((frame.number, int(pixels[0, 0]), int(np.ptp(pixels))))
        if len(seen) == 10:
            break
print(json.dumps(seen))
"""


def test_another_process_reads_a_camera_and_its_end_takes_nothing_away(empty, live):
    with live.streaming(empty, live.Flat(), Shm, "Side", frame_rate=100) as (_, served):
        (name,) = (r.name for r in served.rings.values())
        assert name == "brightfield-Side"
        for _ in range(2):  # the second finds the ring still there
            child = subprocess.run(
                [sys.executable, "-c", CHILD, name], capture_output=True, check=True, timeout=60, text=True
            )
            seen = json.loads(child.stdout)
            assert child.stderr == ""
            numbers = [n for n, _, _ in seen]
            assert numbers == sorted(set(numbers))
            assert len(numbers) == 10
            for number, value, spread in seen:
                assert spread == 0
                assert value == live.level(number + 2)  # two calls were to prepare
    with pytest.raises(BrightfieldError, match='No camera streams to the shared memory "brightfield-Side"'):
        SharedReader(name)


WRITER = """
import sys
from interchange.problems import BrightfieldError
from realtime.virtual_camera.transports.shm import _create
try:
    _create(sys.argv[1], 8192)
except BrightfieldError as error:
    print(error)
"""


def test_a_writer_that_is_refused_leaves_the_ring_to_whom_it_belongs(empty, live):
    ring = Ring(ring_of(empty), frame_of(empty, live))
    try:
        refused = subprocess.run(
            [sys.executable, "-c", WRITER, ring.name], capture_output=True, check=True, timeout=60, text=True
        )
        assert f"Process {os.getpid()} streams" in refused.stdout
        assert refused.stderr == ""
        SharedReader(ring.name).close()
    finally:
        ring.close()


def test_a_ring_whose_writer_is_gone_is_replaced_and_a_living_one_is_not(empty, live):
    frame = frame_of(empty, live)
    name = ring_of(empty)
    left = shared_memory.SharedMemory(name, create=True, size=8192)
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    Layout(gone.pid, 1, 1, 1, 1, 1, 8, "Mono8", 0).write(left.buf)
    left.close()
    ring = Ring(name, frame)
    try:
        with pytest.raises(BrightfieldError, match=f"Process {os.getpid()} streams"):
            Ring(name, frame)
        with VirtualCamera(empty, "Top", draw=live.Pattern(), region=(0, 0, 8, 8)) as other:
            small = other.take()
        with pytest.raises(BrightfieldError, match="must stay 64 x 48 px of Mono8"):
            ring.put(small)
    finally:
        ring.close()

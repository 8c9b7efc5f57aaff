"""RTSP by RFC 2326, JPEG in RTP by RFC 2435: read by ffmpeg through OpenCV, and packet by packet."""

import os
import socket
import struct
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest

from interchange.problems import BrightfieldError
from realtime.virtual_camera import rtp_jpeg
from realtime.virtual_camera.transports.rtsp import Rtsp

SMOOTH = cv2.GaussianBlur(np.random.default_rng(1).uniform(0, 255, (48, 64, 3)), (0, 0), 3).astype(np.uint8)


def jpeg(picture, sampling=cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420):
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, sampling])[1].tobytes()


def test_packets_hold_the_whole_scan_in_order():
    picture = np.random.default_rng(0).integers(0, 255, (96, 128, 3), np.uint8)
    scan = rtp_jpeg.scan_of(jpeg(picture))
    packets = list(rtp_jpeg.packets(scan, 65_530, 1 << 32, 7))
    assert len(packets) > 8
    data, tables = b"", b""
    for k, packet in enumerate(packets):
        first, kind, sequence, stamp, source = struct.unpack_from(">BBHII", packet)
        assert (first, kind & 127, stamp, source) == (0x80, 26, 0, 7)
        assert sequence == (65_530 + k) % 65_536
        assert kind >> 7 == (k == len(packets) - 1)  # the marker
        offset = int.from_bytes(packet[13:16])
        assert offset == len(data)
        assert tuple(packet[16:20]) == (1, 255, 128 // 8, 96 // 8)
        tables += packet[24:152] if k == 0 else b""
        data += packet[152 if k == 0 else 20 :]
        assert len(packet) <= 1412
    assert (data, tables) == (scan.data, scan.tables)


@pytest.mark.parametrize(
    ("file", "message"),
    [
        (jpeg(SMOOTH, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444), "4:2:0 or 4:2:2"),
        (jpeg(SMOOTH[..., 0]), "three channels"),
        (jpeg(SMOOTH[:40, :60]), "multiples of 8"),
        (b"\xff\xd8", "baseline JPEG"),
    ],
)
def test_what_rtp_cannot_carry_is_one_clear_error(file, message):
    with pytest.raises(BrightfieldError, match=message):
        rtp_jpeg.scan_of(file)


def test_a_senders_report_gives_utc():
    report = rtp_jpeg.sender_report(1_500_000_000_250_000_000, 9, 3, 4)
    seconds, fraction, stamp = struct.unpack_from(">III", report, 8)
    assert seconds - 2_208_988_800 == 1_500_000_000
    assert fraction == 1 << 30
    assert stamp == (1_500_000_000_250_000_000 * 9 // 100_000) % (1 << 32)


@pytest.mark.parametrize("way", ["tcp", "udp"])
def test_opencv_opens_the_stream(empty, live, monkeypatch, way):
    monkeypatch.setitem(os.environ, "OPENCV_FFMPEG_CAPTURE_OPTIONS", f"rtsp_transport;{way}")
    with live.streaming(empty, live.Flat(), Rtsp, frame_rate=50) as (_, served):
        capture = cv2.VideoCapture(f"{served.url}/camera", cv2.CAP_FFMPEG)
        assert capture.isOpened()
        pictures = [capture.read()[1] for _ in range(10)]
        capture.release()
    assert {p.shape for p in pictures} == {(48, 64, 3)}
    levels = [p.mean() for p in pictures]
    for p, mean in zip(pictures, levels, strict=True):
        assert np.ptp(p) <= 2
        assert min(abs(mean - live.level(k)) for k in range(8)) <= 1.5


class Client:
    def __init__(self, url):
        host, port = url.removeprefix("rtsp://").split(":")
        self.socket = socket.create_connection((host, int(port)), 20)
        self.file, self.url, self.sequence = self.socket.makefile("rb"), f"{url}/Top", 0

    def ask(self, method, path="", **headers):
        self.sequence += 1
        lines = [f"{method} {self.url}{path} RTSP/1.0", f"CSeq: {self.sequence}"]
        lines += [f"{k}: {v}" for k, v in headers.items()]
        self.socket.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        return self.reply()

    def reply(self):
        while (first := self.file.read(1)) == b"$":  # packets come in between
            self.file.read(struct.unpack(">BH", self.file.read(3))[1])
        status = int((first + self.file.readline()).split()[1])
        headers = {}
        while line := self.file.readline().strip():
            key, _, value = line.decode().partition(": ")
            headers[key] = value
        return status, headers, self.file.read(int(headers.get("Content-Length", 0)))

    def packet(self):
        assert self.file.read(1) == b"$"
        channel, length = struct.unpack(">BH", self.file.read(3))
        return channel, self.file.read(length)


def test_the_conversation_of_rfc_2326(empty, live):
    with live.streaming(empty, live.Flat(), Rtsp, frame_rate=100) as (publisher, served):
        client = Client(served.url)
        assert "DESCRIBE" in client.ask("OPTIONS")[1]["Public"]
        status, headers, body = client.ask("DESCRIBE")
        assert status == 200
        assert headers["Content-Type"] == "application/sdp"
        assert b"m=video 0 RTP/AVP 26" in body
        assert client.ask("PLAY")[0] == 454
        assert client.ask("RECORD")[0] == 501
        assert client.ask("SETUP", Transport="RTP/AVP;multicast")[0] == 461
        status, headers, _ = client.ask("SETUP", "/track1", Transport="RTP/AVP/TCP;unicast;interleaved=2-3")
        assert status == 200
        assert "interleaved=2-3" in headers["Transport"]
        session = headers["Session"].split(";")[0]
        assert client.ask("PLAY", Session="wrong")[0] == 454
        assert client.ask("PLAY", Session=session)[0] == 200
        channel, report = client.packet()
        assert (channel, report[1]) == (3, 200)  # RTCP first
        stamps = [struct.unpack_from(">I", client.packet()[1], 4)[0] for _ in range(5)]
        assert stamps == sorted(set(stamps))  # a flat frame is one packet
        assert client.ask("PAUSE", Session=session)[0] == 200
        assert client.ask("TEARDOWN", Session=session)[0] == 200
        assert client.file.read() == b""
        assert publisher.subscriptions == [] or publisher.subscriptions[0].got >= 5
        bad = Client(served.url)
        bad.socket.sendall(b"GET / HTTP/1.1\r\n\r\n")
        assert bad.file.read() == b""


def test_no_packet_follows_the_answer_to_pause(empty, live, monkeypatch):
    whole = rtp_jpeg.packets

    def slow(*frame):
        for packet in whole(*frame):
            yield packet
            time.sleep(0.1)  # the request comes in the middle of a frame
            yield packet

    monkeypatch.setattr(rtp_jpeg, "packets", slow)
    with live.streaming(empty, live.Flat(), Rtsp, frame_rate=100) as (_, served):
        client = Client(served.url)
        way = client.ask("SETUP", "/track1", Transport="RTP/AVP/TCP;unicast;interleaved=0-1")[1]
        session = way["Session"].split(";")[0]
        assert client.ask("PLAY", Session=session)[0] == 200
        assert client.packet()[0] == 1  # RTCP
        assert client.packet()[0] == 0
        assert client.ask("PAUSE", Session=session)[0] == 200
        client.socket.settimeout(0.3)
        with pytest.raises(TimeoutError):
            client.file.read1(1)


def test_sizes_that_rfc_2435_cannot_say_are_refused_before_streaming(empty, live):
    wide = replace(empty, cameras=(live.camera_above(sensor=replace(live.UNIT, resolution=(60, 48))),))
    with pytest.raises(BrightfieldError, match="got 60 x 48"), live.streaming(wide, live.Flat(), Rtsp):
        pass

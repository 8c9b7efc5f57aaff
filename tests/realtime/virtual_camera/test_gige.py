"""GigE Vision by the protocol itself, packet by packet."""

import json
import re
import socket
import struct
import xml.etree.ElementTree as ElementTree
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from interchange.problems import BrightfieldError
from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.moving_scene import MovingScene
from realtime.virtual_camera.publisher import Publisher
from realtime.virtual_camera.transports.gige import Gige

CCP, HEARTBEAT, PORT, SIZE, DESTINATION = 0x0A00, 0x0938, 0x0D00, 0x0D04, 0x0D18
NAMESPACE = "{http://www.genicam.org/GenApi/Version_1_1}"
DENIED, INVALID, WRITE_PROTECT, ADDRESS = 0x8006, 0x8002, 0x8004, 0x8003


@contextmanager
def device(scene, draw, port=0, address="127.0.0.1", **settings):
    """Streams every camera of the scene; the transport."""
    moving = MovingScene(scene, live=True)
    publishers = [
        Publisher(VirtualCamera(moving, c.name, draw=draw, noise=False, **settings)) for c in scene.cameras
    ]
    served = Gige(publishers, address, port)
    try:
        served.start()
        for p in publishers:
            p.start()
        yield served
    finally:
        for p in publishers:
            p.stop()
        served.stop()


@pytest.fixture
def scene(empty, live):
    """One camera of 12 bits, on which a DN of 8 bits is 16 of 12."""
    sensor = replace(live.UNIT, bit_depth=12)
    return replace(empty, cameras=(live.camera_above(sensor=sensor),))


class Client:
    """GVCP by hand. ``register[name]`` is a feature's address and length, by the device's own XML."""

    def __init__(self, place):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(place)
        self.socket.settimeout(10)
        self.stream = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.stream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self.stream.bind(("127.0.0.1", 0))
        self.stream.settimeout(10)
        self.number = 0

    def ask(self, command, body=b"", flags=1):
        self.number += 1
        self.socket.send(struct.pack(">BBHHH", 0x42, flags, command, len(body), self.number) + body)
        answer = self.socket.recv(2048)
        status, told, length, number = struct.unpack_from(">HHHH", answer)
        assert (told, number, length) == (command + 1, self.number, len(answer) - 8)
        return status, answer[8:]

    def read(self, address, count=4):
        status, body = self.ask(0x84, struct.pack(">IHH", address, 0, count))
        assert status == 0
        return body[4:]

    def write(self, address, value):
        return self.ask(0x82, struct.pack(">II", address, value))[0]

    def write_float(self, address, value):
        return self.ask(0x86, struct.pack(">Id", address, value))[0]

    def describe(self):
        url = self.read(0x200, 512).rstrip(b"\0").decode()
        at, size = (int(x, 16) for x in re.fullmatch(r"Local:[\w.]+;(\w+);(\w+)", url).groups())
        text = b"".join(
            self.read(at + k, 512 if size - k >= 512 else -(-(size - k) // 4) * 4)
            for k in range(0, size, 512)
        )
        self.xml = ElementTree.fromstring(text.rstrip(b"\0"))
        self.register = {}
        for node in self.xml:
            place = node.find(f"{NAMESPACE}Address")
            if place is not None:
                self.register[node.get("Name").removesuffix("Reg")] = int(place.text, 16)
        return self

    def control(self):
        assert self.write(CCP, 2) == 0
        assert self.write(HEARTBEAT, 60_000) == 0  # ms: a busy machine may keep a test waiting
        assert self.write(DESTINATION, struct.unpack(">I", socket.inet_aton("127.0.0.1"))[0]) == 0
        assert self.write(PORT, self.stream.getsockname()[1]) == 0
        return self

    def feature(self, name, value):
        if isinstance(value, float):
            return self.write_float(self.register[name], value)
        return self.write(self.register[name], value)

    def drain(self):
        """Take what is under way, until there is nothing more."""
        self.stream.settimeout(0.2)
        while True:
            try:
                self.stream.recv(1 << 16)
            except TimeoutError:
                break
        self.stream.settimeout(10)

    def block(self):
        """Leader, payload and number of the next frame."""
        leader, payload = None, b""
        while True:
            packet = self.stream.recv(1 << 16)
            _, block, head = struct.unpack_from(">HHI", packet)
            kind, number = head >> 24, head & 0xFFFFFF
            if kind == 1:
                leader, payload, expected = packet[8:], b"", 1
            elif kind == 3:
                assert number == expected  # the loopback network keeps the order
                payload, expected = payload + packet[8:], expected + 1
            elif leader is not None:
                return leader, payload, block


def frame_at(publisher, stamp_ns):
    """The truth of the frame that was stamped so."""
    number = publisher.truth().number
    while (truth := publisher.truth(number)).stamp_ns != stamp_ns:
        number -= 1
    return truth


def test_a_device_is_discovered_with_its_name_and_address(scene, live):
    with device(scene, live.Flat()) as served:
        status, found = Client(served.places[0]).ask(0x0002, flags=0x11)
        assert status == 0
        assert len(found) == 0xF8
        assert socket.inet_ntoa(found[0x24:0x28]) == "127.0.0.1"
        assert found[0x48:0x68].rstrip(b"\0") == b"Brightfield"
        assert found[0xE8:0xF8].rstrip(b"\0") == b"Top"


def test_frames_are_whole_numbered_and_act_by_their_features(scene, live):
    with device(scene, live.Flat(), frame_rate=100, format="Mono8") as served:
        client = Client(served.places[0]).describe().control()
        entries = client.xml.find(f"{NAMESPACE}Enumeration[@Name='PixelFormat']")
        codes = {
            e.get("Name"): int(e.find(f"{NAMESPACE}Value").text)
            for e in entries.iter(f"{NAMESPACE}EnumEntry")
        }
        assert set(codes) == {"Mono8", "Mono10", "Mono12", "BayerRG8", "RGB8"}
        for name, gain, region in (
            ("Mono8", 0.0, (64, 48)),
            ("Mono12", 6.0, (32, 16)),
            ("RGB8", -6.0, (64, 48)),
        ):
            assert client.feature("PixelFormat", codes[name]) == 0
            assert client.feature("Width", region[0]) == client.feature("Height", region[1]) == 0
            assert client.feature("Gain", gain) == 0
            assert client.feature("AcquisitionStart", 1) == 0
            numbers = []
            for _ in range(4):
                leader, payload, block = client.block()
                numbers.append(block)
                _, kind, high, low, code, width, height = struct.unpack_from(">HHIIIII", leader)
                assert (kind, code, width, height) == (1, codes[name], *region)
                samples = np.frombuffer(payload, "<u2" if name == "Mono12" else np.uint8)
                assert len(samples) == width * height * (3 if name == "RGB8" else 1)
                assert np.ptp(samples) == 0  # of one frame alone
                truth = frame_at(served.devices[0].publisher, high << 32 | low)
                # full scale is 255 W m⁻² sr⁻¹ (1 ms); the first call was to prepare, a second the device's
                scale = 10 ** (gain / 20) * (4095 / 255 if name == "Mono12" else 1)
                expected = min(live.level(truth.number + 2) * scale, 4095 if name == "Mono12" else 255)
                assert samples[0] == pytest.approx(expected, abs=0.51)
                assert truth.camera.sensor.gain_dB == gain
            assert numbers == sorted(set(numbers))
            assert client.feature("Width", 8) == WRITE_PROTECT
            assert client.feature("AcquisitionStop", 1) == 0
            client.drain()


def test_one_software_trigger_gives_one_frame(scene, live):
    with device(scene, live.Flat(), format="Mono8") as served:
        client = Client(served.places[0]).describe().control()
        assert client.feature("TriggerMode", 1) == 0
        assert client.feature("TriggerSoftware", 1) == 0  # before the start: without effect
        client.feature("AcquisitionStart", 1)
        blocks = []
        for _ in range(3):
            client.feature("TriggerSoftware", 1)
            blocks.append(client.block()[2])
        client.stream.settimeout(0.3)
        with pytest.raises(TimeoutError):
            client.stream.recv(1 << 16)
        assert len(set(blocks)) == 3


def test_a_timer_triggers_periodically(scene, live):
    with device(scene, live.Flat(), format="Mono8", frame_rate=50) as served:
        client = Client(served.places[0]).describe().control()
        assert client.feature("TimerDuration", 80_000.0) == 0  # us
        assert client.feature("TriggerSource", 1) == 0
        assert client.feature("TriggerMode", 1) == 0
        client.feature("AcquisitionStart", 1)
        seconds = []
        for _ in range(4):
            _, _, high, low = struct.unpack_from(">HHII", client.block()[0])
            seconds.append(frame_at(served.devices[0].publisher, high << 32 | low).seconds)
        periods = np.diff(seconds) / 0.08
        np.testing.assert_allclose(periods, np.round(periods), atol=1e-6)
        assert periods.min() > 0.5
        assert client.feature("TriggerSource", 0) == 0
        assert served.devices[0].camera.settings.waits, "for software again"


def test_the_truth_is_a_chunk_of_the_frame(scene, live):
    with device(scene, live.Flat(), format="Mono8", frame_rate=50) as served:
        served.devices[0].camera.scene.set_body_pose("/World/Part", live.at(0.1, 0.2))
        client = Client(served.places[0]).describe().control()
        assert client.feature("ChunkModeActive", 1) == 0
        client.feature("AcquisitionStart", 1)
        leader, payload, _ = client.block()
        assert struct.unpack_from(">H", leader, 2) == (0x4001,)
        assert len(payload) == struct.unpack(">I", client.read(client.register["PayloadSize"]))[0]
        chunks = {}
        while payload:
            kind, length = struct.unpack(">II", payload[-8:])
            chunks[kind], payload = payload[-8 - length : -8], payload[: -8 - length]
        assert len(chunks[1]) == 64 * 48
        truth = json.loads(chunks[3].rstrip(b"\0"))
        assert truth["number"] == struct.unpack(">Q", chunks[2])[0]
        assert truth["bodies"]["/World/Part"] == live.at(0.1, 0.2).tolist()


def test_a_lost_packet_is_sent_again_and_one_that_is_gone_is_told(scene, live):
    with device(scene, live.Flat(), format="Mono8", triggered=True) as served:
        client = Client(served.places[0]).describe().control()
        assert client.write(SIZE, 1036) == 0
        client.feature("AcquisitionStart", 1)
        client.feature("TriggerSoftware", 1)
        _, payload, block = client.block()

        def again(number):
            body = struct.pack(">HHII", 0, number[0], number[1], number[1])
            client.socket.send(struct.pack(">BBHHH", 0x42, 0, 0x40, len(body), 9) + body)
            return client.stream.recv(1 << 16)

        packet = again((block, 2))
        assert packet[:2] == b"\x01\x00"
        assert packet[8:] == payload[1000:2000]
        assert again((block + 7, 2))[:2] == b"\x80\x0c"


def test_only_who_controls_the_device_may_write_and_silence_gives_control_back(scene, live):
    with device(scene, live.Flat(), format="Mono8", frame_rate=50) as served:
        first = Client(served.places[0]).describe()
        second = Client(served.places[0]).describe()
        assert first.feature("Gain", 3.0) == DENIED  # nobody controls it yet
        first.control()
        assert first.feature("Gain", 3.0) == 0
        assert second.feature("Gain", 6.0) == DENIED
        assert second.write(CCP, 2) == DENIED
        assert struct.unpack(">d", second.read(second.register["Gain"], 8)) == (3.0,)
        first.feature("AcquisitionStart", 1)
        first.write(HEARTBEAT, 500)  # ms; and then it says nothing any more
        while second.write(CCP, 2) == DENIED:
            second.stream.settimeout(0.1)
            with pytest.raises(TimeoutError):
                second.stream.recv(1)
        assert not served.devices[0].acquiring


def test_what_a_device_cannot_do_is_refused(scene, live):
    with device(scene, live.Flat(), format="Mono8") as served:
        client = Client(served.places[0]).describe().control()
        assert client.feature("ExposureTime", -1.0) == INVALID
        assert client.feature("ExposureTime", float("nan")) == INVALID
        assert client.feature("Width", 65) == INVALID
        assert client.feature("PixelFormat", 7) == INVALID
        assert client.feature("SensorWidth", 7) == WRITE_PROTECT
        assert client.write(0x0024, 7) == WRITE_PROTECT
        assert client.write(0x9000, 7) == ADDRESS
        assert client.write(SIZE, 20) == INVALID
        assert client.ask(0x84, struct.pack(">IHH", 0x9000, 0, 4))[0] == ADDRESS
        assert client.ask(0x84, struct.pack(">IHH", 2, 0, 4))[0] == 0x8005
        assert client.ask(0x0099)[0] == 0x8001
        assert client.ask(0x0080, b"12")[0] == INVALID
        for rubbish in (b"", b"x", b"\x42\x01\x00\x80\xff\xff\x00\x01", bytes(40)):
            client.socket.send(rubbish)  # no answer, and no harm
        assert client.ask(0x0002)[0] == 0
        assert served.devices[0].camera.settings.t_exp == 1e-3


@pytest.mark.parametrize(
    ("address", "message"), [("192.0.2.7", "one camera can be"), ("::1", "needs an IPv4 address")]
)
def test_what_cannot_be_a_device_is_one_clear_error(empty, live, address, message):
    with pytest.raises(BrightfieldError, match=message), device(empty, live.Flat(), address=address):
        pass


# Aravis

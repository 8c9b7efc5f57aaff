"""A GigE Vision device: registers, who controls them, and the frames that it sends.

AIA: GigE Vision 2.0, 2011: part 2, bootstrap registers and GVCP.
"""

import json
import socket
import struct
import threading
import time
import zlib
from collections import OrderedDict

from interchange.problems import BrightfieldError
from realtime.virtual_camera import genicam, gvsp
from realtime.virtual_camera.frame import Frame
from realtime.virtual_camera.publisher import Publisher

XML_AT = 0x100000
CCP, HEARTBEAT, LATCH, STREAM_PORT, PACKET_SIZE, PACKET_DELAY, DESTINATION = (
    0x0A00, 0x0938, 0x0944, 0x0D00, 0x0D04, 0x0D08, 0x0D18,
)  # fmt: skip
WRITABLE = {CCP, HEARTBEAT, LATCH, STREAM_PORT, PACKET_SIZE, PACKET_DELAY, DESTINATION}
FIRE_TEST_PACKET = 0x80000000
SMALLEST, LARGEST = 128, 16_000  # bytes of a packet
BURST = 1 << 17  # bytes after which a receiver's buffer gets a moment to be emptied
KEPT = 4  # blocks whose packets can be asked for again
GONE, INVALID, WRITE_PROTECT, ADDRESS, ALIGNMENT, DENIED = 0x800C, 0x8002, 0x8004, 0x8003, 0x8005, 0x8006


class Refused(Exception):
    """With GVCP's status."""

    def __init__(self, status: int) -> None:
        super().__init__(hex(status))
        self.status = status


class GigeDevice:
    """``address``: IPv4 that the device has. Its methods are called by the thread of the control channel alone; the
    frames are sent by another from ``start`` to ``stop``."""

    def __init__(self, publisher: Publisher, address: str) -> None:
        self.publisher, self.camera, self.address = publisher, publisher.camera, address
        self.serial = self.camera.sensor.serial_number or f"{zlib.crc32(self.camera.name.encode()):08X}"
        self.mode, self.locked, self.chunks = 0, 0, False
        self.timer = self.camera.settings.trigger_period or 0.1  # s, of TriggerSource Timer0End
        told = len(json.dumps(self.camera.prepare().truth.record()))
        self.truth_bytes = -(-(told + told // 2 + 4096) // 4) * 4
        self.placed = genicam.addresses(genicam.features(self))
        self.xml = genicam.description(self.placed, self.truth_bytes)
        self.memory = bytearray(0x1000)
        self._fill()
        self.controller: tuple[str, int] | None = None
        self.heard = 0.0
        self.acquiring = False
        self.since = 0  # frames up to this number were begun before the acquisition was
        self.reader = publisher.subscribe(f"{address}:gige")
        self.sent: OrderedDict[int, list[bytes]] = OrderedDict()
        self._stopped = threading.Event()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((address, 0))
        self._thread = threading.Thread(target=self._send_frames, name="gvsp", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopped.set()
        self.reader.close()
        if self._thread.is_alive():
            self._thread.join()
        self._socket.close()

    # what features do

    @property
    def payload(self) -> int:
        """Bytes of a frame."""
        _, _, width, height = self.camera.settings.region
        pixels = width * height * self.camera.settings.format.bytes_per_pixel
        return pixels + (3 * 8 + 8 + self.truth_bytes if self.chunks else 0)

    def begin(self) -> None:
        self.since = self.camera.begun
        self.acquiring = True

    def end(self) -> None:
        self.acquiring = False

    def trigger(self) -> None:
        """Without effect where nothing is acquired, as on a camera."""
        if self.acquiring and self.camera.settings.waits:
            self.camera.trigger()

    def set_trigger(self, timed: bool, timer: float) -> None:
        """Triggers every ``timer`` s, or from software."""
        self.camera.configure(trigger_period=timer if timed else 0.0)
        self.timer = timer

    def set_mode(self, mode: int) -> None:
        self.mode = mode

    def set_chunks(self, on: bool) -> None:
        self.chunks = on

    def lock(self, value: int) -> None:
        self.locked = value

    # the control channel

    def control(self, client: tuple[str, int], command: int, body: bytes) -> bytes | None:
        """The answer's body to a command of GVCP; None where there is none. Raises Refused."""
        if client == self.controller:
            self.heard = time.monotonic()
        match command:
            case 0x0002:  # DISCOVERY
                return bytes(self.memory[:0xF8])
            case 0x0040:  # PACKETRESEND
                self._resend(body)
                return None
            case 0x0080:  # READREG
                if len(body) % 4 or not body:
                    raise Refused(INVALID)
                return b"".join(self.read(a, 4) for (a,) in struct.iter_unpack(">I", body))
            case 0x0082:  # WRITEREG
                if len(body) % 8 or not body:
                    raise Refused(INVALID)
                for address, value in struct.iter_unpack(">II", body):
                    self.write(client, address, struct.pack(">I", value))
                return struct.pack(">HH", 0, len(body) // 8)
            case 0x0084 if len(body) == 8:  # READMEM
                address, _, count = struct.unpack(">IHH", body)
                return body[:4] + self.read(address, count)
            case 0x0086 if len(body) >= 8:  # WRITEMEM
                (address,) = struct.unpack_from(">I", body)
                self.write(client, address, body[4:])
                return struct.pack(">HH", 0, len(body) - 4)
        raise Refused(0x8001)  # not implemented

    def check_heartbeat(self) -> None:
        """A controller that fell silent has lost its privilege."""
        (patience,) = struct.unpack_from(">I", self.memory, HEARTBEAT)
        if self.controller is not None and time.monotonic() - self.heard > patience / 1000:
            self._let_go()

    def read(self, address: int, count: int) -> bytes:
        if address % 4 or count % 4:
            raise Refused(ALIGNMENT)
        if address >= XML_AT:
            at = address - XML_AT
            if at >= len(self.xml) + 4:
                raise Refused(ADDRESS)
            return self.xml[at : at + count].ljust(count, b"\0")
        if address + count <= len(self.memory):
            return bytes(self.memory[address : address + count])
        for place, feature in self.placed.items():
            if place <= address and address + count <= place + feature.length:
                return feature.encode(feature.get(self))[address - place : address - place + count]
        raise Refused(ADDRESS)

    def write(self, client: tuple[str, int], address: int, data: bytes) -> None:
        if self.controller is not None and client != self.controller:
            raise Refused(DENIED)
        if address == CCP and len(data) == 4:
            self._claim(client, data)
            return
        if client != self.controller:
            raise Refused(DENIED)
        if address < len(self.memory):
            self._write_bootstrap(address, data)
            return
        feature = self.placed.get(address)
        if feature is None or len(data) != feature.length:
            raise Refused(ADDRESS)
        if feature.put is None or (feature.locked and self.acquiring):
            raise Refused(WRITE_PROTECT)
        value = feature.decode(data)
        if feature.entries and value not in feature.entries.values():
            raise Refused(INVALID)
        try:
            feature.put(self, value)
        except (BrightfieldError, OverflowError, ValueError):
            raise Refused(INVALID) from None

    def _claim(self, client: tuple[str, int], data: bytes) -> None:
        if struct.unpack(">I", data)[0] & 3:
            self.controller, self.heard = client, time.monotonic()
            self.memory[CCP : CCP + 4] = data
        else:
            self._let_go()

    def _let_go(self) -> None:
        self.controller = None
        self.end()
        self.memory[CCP : CCP + 4] = self.memory[STREAM_PORT : STREAM_PORT + 4] = bytes(4)

    def _write_bootstrap(self, address: int, data: bytes) -> None:
        if address not in WRITABLE:
            raise Refused(WRITE_PROTECT)
        if len(data) != 4:
            raise Refused(INVALID)
        (value,) = struct.unpack(">I", data)
        if address == LATCH:
            if value & 2:
                struct.pack_into(">Q", self.memory, 0x0948, time.time_ns())
            return
        if address == PACKET_SIZE:
            size = value & 0xFFFF
            if not SMALLEST <= size <= LARGEST:
                raise Refused(INVALID)
            struct.pack_into(">I", self.memory, address, value & ~FIRE_TEST_PACKET)
            if value & FIRE_TEST_PACKET:
                self._send(bytes(size - 28), self._destination)
            return
        self.memory[address : address + 4] = data

    # the stream

    @property
    def _destination(self) -> tuple[str, int]:
        (port,) = struct.unpack_from(">I", self.memory, STREAM_PORT)
        return socket.inet_ntoa(bytes(self.memory[DESTINATION : DESTINATION + 4])), port & 0xFFFF

    def _send_frames(self) -> None:
        while not self._stopped.is_set() and not self.publisher.done.is_set():
            frame = self.reader.next(0.2)
            if frame is None or not self.acquiring or frame.number <= self.since:
                continue
            self._send_frame(frame)
            if self.mode == 1:  # SingleFrame
                self.acquiring = False

    def _send_frame(self, frame: Frame) -> None:
        """Frames that were lost on the way to this thread leave a gap in the blocks' numbers."""
        truth = None
        if self.chunks:
            text = json.dumps(frame.truth.record()).encode()
            if len(text) > self.truth_bytes:
                text = json.dumps(frame.truth.record(bodies=False)).encode()
            truth = text[: self.truth_bytes].ljust(self.truth_bytes, b"\0")
        data = gvsp.payload(frame, truth)
        if len(data) != self.payload:
            return  # taken before a setting that now holds
        block = (frame.number - self.since - 1) % 0xFFFF + 1
        size, delay = struct.unpack_from(">II", self.memory, PACKET_SIZE)
        packets = gvsp.packets(frame, data, block, size & 0xFFFF, self.chunks)
        self.sent[block] = packets
        while len(self.sent) > KEPT:
            self.sent.popitem(last=False)
        to, gone = self._destination, 0
        for packet in packets:
            self._send(packet, to)
            gone += len(packet)
            if delay or gone > BURST:
                time.sleep(max(delay * 1e-9, 2e-4 if gone > BURST else 0))
                gone = 0 if gone > BURST else gone

    def _send(self, packet: bytes, to: tuple[str, int]) -> None:
        if not to[1]:
            return
        try:
            self._socket.sendto(packet, to)
        except OSError:  # a datagram that cannot be sent is a lost one; who misses it asks again
            return

    def _resend(self, body: bytes) -> None:
        if len(body) < 12:
            raise Refused(INVALID)
        _, block, first, last = struct.unpack_from(">HHII", body)
        packets, to = self.sent.get(block), self._destination
        for number in range(first & 0xFFFFFF, (last & 0xFFFFFF) + 1):
            if packets is None or number >= len(packets):
                self._send(gvsp.gone(block, number), to)
                return
            self._send(gvsp.again(packets[number]), to)

    def _fill(self) -> None:
        """The bootstrap registers."""

        def number(address: int, value: int) -> None:
            struct.pack_into(">I", self.memory, address, value)

        def text(address: int, size: int, words: str) -> None:
            self.memory[address : address + size] = words.encode()[: size - 1].ljust(size, b"\0")

        number(0x0000, 0x00020000)  # GigE Vision 2.0
        number(0x0004, 0x80000001)  # big-endian, UTF-8
        mac = 0x020000000000 | zlib.crc32(
            f"{self.address}{self.camera.name}".encode()
        )  # locally administered
        number(0x0008, mac >> 32)
        number(0x000C, mac & 0xFFFFFFFF)
        number(0x0010, 0x80000007)
        number(0x0014, 0x00000005)  # by the host's own address
        self.memory[0x0024:0x0028] = socket.inet_aton(self.address)
        number(0x0034, 0xFF000000 if self.address.startswith("127.") else 0xFFFFFF00)
        text(0x0048, 32, "Brightfield")
        text(0x0068, 32, "VirtualCamera")
        text(0x0088, 32, "1")
        text(0x00A8, 48, "A camera of a simulated scene")
        text(0x00D8, 16, self.serial)
        text(0x00E8, 16, self.publisher.name)
        text(0x0200, 512, f"Local:brightfield.xml;{XML_AT:x};{len(self.xml):x}")
        number(0x0600, 1)  # network interfaces
        number(0x0904, 1)  # stream channels
        number(
            0x0934, 0xC0000007
        )  # user's name, serial number; resend, write memory, several registers at once
        number(HEARTBEAT, 3000)
        number(0x0940, 1_000_000_000)  # ticks a second
        number(PACKET_SIZE, 1400)

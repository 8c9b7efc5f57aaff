"""GigE Vision: each camera a device with GenICam features, found and read by unmodified clients.

A device has an IP address of its own: further cameras have the next ones of the loopback network (127.0.0.2, ...).
The truth is a chunk of every frame (ChunkModeActive, ChunkTruth), and told over HTTP.
"""

import ipaddress
import selectors
import socket
import struct
import threading
from collections.abc import Sequence

import psutil

from interchange.problems import BrightfieldError
from realtime.virtual_camera.gige_device import GigeDevice, Refused
from realtime.virtual_camera.publisher import Publisher
from realtime.virtual_camera.transports.base import Transport, cannot_bind, is_loopback

KEY, ACKNOWLEDGE = 0x42, 0x01


class Gige(Transport):
    meaning = "GigE Vision with GenICam features"
    port = 3956

    def __init__(self, publishers: Sequence[Publisher], address: str = "127.0.0.1", port: int = 0) -> None:
        super().__init__(publishers, address, port)
        try:
            self.first = ipaddress.IPv4Address("127.0.0.1" if address == "localhost" else address)
        except ValueError:
            raise BrightfieldError(f"GigE Vision needs an IPv4 address; got {address}.") from None
        if len(publishers) > 1 and not self.first.is_loopback:
            raise BrightfieldError(
                f"At {address} one camera can be a GigE Vision device; got {len(publishers)}. Loopback addresses have "
                "room for more."
            )
        self.devices: list[GigeDevice] = []
        self._own: dict[GigeDevice, socket.socket] = {}
        self._for_all: list[socket.socket] = []
        self._selector = selectors.DefaultSelector()
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="gvcp", daemon=True)

    def start(self) -> list[str]:
        lines = []
        for k, publisher in enumerate(self.cameras.values()):
            address = str(self.first + k)
            try:
                own = _socket(address, self.asked_port)
                device = GigeDevice(publisher, address)
            except OSError as error:
                raise cannot_bind(error, address, self.asked_port, "address") from None
            self.devices.append(device)
            self._own[device] = own
            self._selector.register(own, selectors.EVENT_READ, device)
            lines.append(
                f"gige: Brightfield-VirtualCamera-{device.serial} ({publisher.name}) at {address}:"
                f"{own.getsockname()[1]}"
            )
        for address in ("255.255.255.255", _broadcast(str(self.first))):
            try:
                self._for_all.append(_socket(address, self.asked_port))
            except OSError:
                continue  # another program looks there; who knows the address still finds the device
            self._selector.register(self._for_all[-1], selectors.EVENT_READ, None)
        for device in self.devices:
            device.start()
        self._thread.start()
        return lines

    @property
    def places(self) -> list[tuple[str, int]]:
        """Where the devices' control channels are."""
        return [own.getsockname() for own in self._own.values()]

    def stop(self) -> None:
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join()
        for device in self.devices:
            device.stop()
        self._selector.close()
        for one in (*self._own.values(), *self._for_all):
            one.close()

    def clients(self) -> list[dict[str, object]]:
        return [
            {"client": "gige", "camera": d.publisher.name, "got": d.reader.got, "lost": d.reader.lost}
            for d in self.devices
        ]

    def _serve(self) -> None:
        while not self._stopped.is_set():
            for key, _ in self._selector.select(0.2):
                listening = key.fileobj
                assert isinstance(listening, socket.socket)
                try:
                    packet, client = listening.recvfrom(2048)
                except OSError:
                    continue  # a datagram that could not be delivered came back
                self._answer(packet, client, key.data)
            for device in self.devices:
                device.check_heartbeat()

    def _answer(self, packet: bytes, client: tuple[str, int], device: GigeDevice | None) -> None:
        """``device``: None where the packet was for all."""
        if len(packet) < 8:
            return
        key, flags, command, length, number = struct.unpack_from(">BBHHH", packet)
        body = packet[8 : 8 + length]
        outside = self.first.is_loopback and not is_loopback(client[0])
        if key != KEY or number == 0 or len(body) < length or outside:
            return
        if device is None:
            if command == 0x0002:
                for each in self.devices:
                    self._reply(each, client, 0, command, number, bytes(each.memory[:0xF8]))
            return
        try:
            answer, status = device.control(client, command, body), 0
        except Refused as refused:
            answer, status = b"", refused.status
        if answer is not None and (flags & ACKNOWLEDGE or status):
            self._reply(device, client, status, command, number, answer)

    def _reply(
        self, device: GigeDevice, client: tuple[str, int], status: int, command: int, number: int, body: bytes
    ) -> None:
        try:
            self._own[device].sendto(
                struct.pack(">HHHH", status, command + 1, len(body), number) + body, client
            )
        except OSError:
            return  # who asked is not there any more


def _socket(address: str, port: int) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
    if not address.endswith("255"):
        made.bind((address, port))
        return made
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # every device hears what is for all
    made.bind((address, port))
    return made


def _broadcast(address: str) -> str:
    """The broadcast address of the network that ``address`` is in."""
    for rows in psutil.net_if_addrs().values():
        for row in rows:
            if row.family == socket.AF_INET and row.netmask:
                net = ipaddress.IPv4Interface(f"{row.address}/{row.netmask}").network
                if ipaddress.IPv4Address(address) in net:
                    return str(net.broadcast_address)
    return "255.255.255.255"

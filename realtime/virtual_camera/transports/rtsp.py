"""RTSP with JPEG over RTP, interleaved in TCP or by UDP: what ``cv2.VideoCapture("rtsp://...")`` and ffmpeg open.

Schulzrinne, Rao, Lanphier: Real Time Streaming Protocol (RTSP). RFC 2326, 1998. A camera is at ``/NAME``; where there
is one camera, at every path. RTP's time is UTC; the sender's reports (RTCP) say so. The truth is told over HTTP.
"""

import contextlib
import secrets
import socket
import socketserver
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from urllib.parse import unquote, urlsplit

from interchange.problems import BrightfieldError
from realtime.virtual_camera import rtp_jpeg
from realtime.virtual_camera.compressed import Compressor
from realtime.virtual_camera.publisher import Publisher, Subscription
from realtime.virtual_camera.transports.base import Transport, cannot_bind

PATIENCE = 20.0  # s that a client may take for a packet
WAITING = 1 << 18  # bytes on their way to a client
REPORT = 5.0  # s between sender's reports
LONGEST = 8192  # bytes of a request
METHODS = "OPTIONS, DESCRIBE, SETUP, PLAY, PAUSE, TEARDOWN, GET_PARAMETER"
REASONS = {
    200: "OK",
    400: "Bad Request",
    404: "Not Found",
    454: "Session Not Found",
    461: "Unsupported Transport",
    501: "Not Implemented",
}


class Rtsp(Transport):
    meaning = "RTSP with JPEG over RTP, by TCP or UDP"
    port = 8554

    def __init__(self, publishers: Sequence[Publisher], address: str = "127.0.0.1", port: int = 0) -> None:
        super().__init__(publishers, address, port)
        self.compress = {
            name: Compressor(p.camera.jpeg_quality or 90, color=True) for name, p in self.cameras.items()
        }
        self.readers: deque[Subscription] = deque(maxlen=1000)
        self.stopped = threading.Event()
        self._server: _Server | None = None

    def start(self) -> list[str]:
        for publisher in self.cameras.values():
            rtp_jpeg.check_size(*publisher.camera.settings.region[2:])
        try:
            self._server = _Server(self, self.address, self.asked_port)
        except OSError as error:
            raise cannot_bind(error, self.address, self.asked_port, "port") from None
        threading.Thread(target=self._server.serve_forever, args=(0.1,), name="rtsp", daemon=True).start()
        return [f"{self.url}/{name}" for name in self.cameras]

    @property
    def url(self) -> str:
        assert self._server is not None
        host = f"[{self.address}]" if ":" in self.address else self.address
        return f"rtsp://{host}:{self._server.server_address[1]}"

    def stop(self) -> None:
        self.stopped.set()
        if self._server is not None:
            self._server.shutdown()
            self._server.server_close()

    def clients(self) -> list[dict[str, object]]:
        return [
            {"client": r.name, "camera": r.publisher.name, "got": r.got, "lost": r.lost} for r in self.readers
        ]


class _Server(socketserver.ThreadingTCPServer):
    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True

    def __init__(self, transport: Rtsp, address: str, port: int) -> None:
        self.transport = transport
        self.address_family = socket.AF_INET6 if ":" in address else socket.AF_INET
        super().__init__((address, port), _Connection)


# what is told of it, a function that sends a packet (and whether it is RTCP), one that closes
_Way = tuple[str, Callable[[bytes, bool], None], Callable[[], None]]


@dataclass
class _Session:
    """What SETUP agreed on: how packets go to the client, and what closes that way."""

    publisher: Publisher
    reader: Subscription
    send: Callable[[bytes, bool], None]  # packet, whether RTCP
    close: Callable[[], None]
    name: str = field(default_factory=lambda: secrets.token_hex(8))
    source: int = field(default_factory=lambda: secrets.randbits(32))
    playing: threading.Event = field(default_factory=threading.Event)
    ended: threading.Event = field(default_factory=threading.Event)
    sending: threading.Lock = field(default_factory=threading.Lock)  # held over the packets of a frame

    def halt(self) -> None:
        """Send no more; the frame on its way is awaited, so that no packet follows what is said next."""
        self.playing.clear()
        with self.sending:
            pass


class _Connection(socketserver.StreamRequestHandler):
    """One client: requests in this thread, packets in another."""

    server: _Server
    request: socket.socket

    def setup(self) -> None:
        super().setup()
        self.request.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.request.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, WAITING)
        seconds = struct.pack("ll", int(PATIENCE), 0)
        self.request.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, seconds)  # to read may take for ever
        self.session: _Session | None = None
        self.writing = threading.Lock()

    def handle(self) -> None:
        try:
            while (request := self._request()) is not None:
                if not self._answer(*request):
                    break
        except (OSError, ValueError):  # it went away, or speaks something else
            pass
        finally:
            self._end()

    def _request(self) -> tuple[str, str, dict[str, str]] | None:
        """Method, URL and headers of the next request; interleaved packets from the client are passed over."""
        while (first := self.rfile.read(1)) == b"$":
            _, length = struct.unpack(">BH", self.rfile.read(3))
            self.rfile.read(length)
        lines, size = [first + self.rfile.readline(LONGEST)], 0
        if not first:
            return None
        while line := self.rfile.readline(LONGEST).strip():
            size += len(line)
            if size > LONGEST:
                return None
            lines.append(line)
        method, url, version = lines[0].decode("latin-1").split()
        if not version.startswith("RTSP/1."):
            return None
        pairs = (line.decode("latin-1").partition(":") for line in lines[1:])
        headers = {name.strip().lower(): value.strip() for name, _, value in pairs}
        self.rfile.read(min(int(headers.get("content-length", 0)), LONGEST))
        return method, url, headers

    def _answer(self, method: str, url: str, headers: dict[str, str]) -> bool:
        """Whether the connection goes on."""
        sequence = headers.get("cseq", "0")
        if method == "OPTIONS":
            self._reply(200, sequence, {"Public": METHODS})
            return True
        if method in ("PLAY", "PAUSE", "TEARDOWN", "GET_PARAMETER"):
            session = self.session
            if session is None or headers.get("session", session.name).split(";")[0] != session.name:
                self._reply(454, sequence)
                return True
            more = {"Session": session.name}
            if method == "PLAY":
                self._reply(200, sequence, more | {"Range": "npt=now-"})
                session.playing.set()
            else:
                session.halt()
                self._reply(200, sequence, more)
            return method != "TEARDOWN"
        publisher = self._camera(url)
        if method not in ("DESCRIBE", "SETUP"):
            self._reply(501, sequence)
        elif publisher is None:
            self._reply(404, sequence)
        elif method == "DESCRIBE":
            base = {"Content-Base": url.rstrip("/") + "/", "Content-Type": "application/sdp"}
            self._reply(200, sequence, base, _description(publisher))
        elif self.session is not None:
            self._reply(400, sequence)
        else:
            self._set_up(publisher, headers.get("transport", ""), sequence)
        return True

    def _camera(self, url: str) -> Publisher | None:
        cameras = self.server.transport.cameras
        if len(cameras) == 1:
            return next(iter(cameras.values()))
        return cameras.get(unquote(urlsplit(url).path).strip("/").removesuffix("/track1"))

    def _set_up(self, publisher: Publisher, offers: str, sequence: str) -> None:
        for offer in offers.split(","):
            words = offer.strip().split(";")
            options = dict(w.split("=", 1) for w in words[1:] if "=" in w)
            if words[0].upper() == "RTP/AVP/TCP":
                way = self._by_tcp(options.get("interleaved", "0-1"))
            elif words[0].upper() in ("RTP/AVP", "RTP/AVP/UDP") and "multicast" not in words:
                way = self._by_udp(options.get("client_port", ""))
            else:
                continue
            if way is None:
                continue
            told, send, close = way
            session = self._begin(publisher, send, close)
            told += f";ssrc={session.source:08X}"
            self._reply(200, sequence, {"Transport": told, "Session": f"{session.name};timeout=60"})
            return
        self._reply(461, sequence)

    def _by_tcp(self, channels: str) -> _Way | None:
        first = int(channels.split("-")[0])
        if not 0 <= first < 255:
            return None

        def send(packet: bytes, rtcp: bool) -> None:
            self._write(struct.pack(">cBH", b"$", first + rtcp, len(packet)) + packet)

        return f"RTP/AVP/TCP;unicast;interleaved={first}-{first + 1}", send, lambda: None

    def _by_udp(self, asked: str) -> _Way | None:
        """To the client's own address, never another: this is no amplifier."""
        low, _, high = asked.partition("-")
        ports = (int(low), int(high or int(low) + 1)) if low else (0, 0)
        if not all(0 < p < 65536 for p in ports):
            return None
        sockets = [socket.socket(self.request.family, socket.SOCK_DGRAM) for _ in ports]
        for s in sockets:
            s.bind((self.request.getsockname()[0], 0))

        def send(packet: bytes, rtcp: bool) -> None:
            with contextlib.suppress(ConnectionRefusedError):  # nobody listens at that port now
                sockets[rtcp].sendto(packet, (self.client_address[0], ports[rtcp]))

        def close() -> None:
            for s in sockets:
                s.close()

        mine = "-".join(str(s.getsockname()[1]) for s in sockets)
        return f"RTP/AVP;unicast;client_port={ports[0]}-{ports[1]};server_port={mine}", send, close

    def _begin(
        self, publisher: Publisher, send: Callable[[bytes, bool], None], close: Callable[[], None]
    ) -> _Session:
        reader = publisher.subscribe("{}:{}".format(*self.client_address[:2]))
        self.server.transport.readers.append(reader)
        self.session = _Session(publisher, reader, send, close)
        threading.Thread(target=self._send_frames, args=(self.session,), name="rtp", daemon=True).start()
        return self.session

    def _send_frames(self, session: _Session) -> None:
        """Until the session ends; a client that takes too long is let go."""
        transport, publisher = self.server.transport, session.publisher
        compress = transport.compress[publisher.name]
        sequence, octets, reported = secrets.randbits(16), 0, 0.0
        count = 0
        try:
            while not (session.ended.is_set() or transport.stopped.is_set() or publisher.done.is_set()):
                if not session.playing.wait(0.2):
                    continue
                frame = session.reader.next(0.5)
                if frame is None:
                    continue
                scan = rtp_jpeg.scan_of(compress(frame))
                with session.sending:
                    if not session.playing.is_set() or session.ended.is_set():
                        continue
                    if time.monotonic() > reported + REPORT:
                        reported = time.monotonic()
                        session.send(
                            rtp_jpeg.sender_report(frame.stamp_ns, session.source, count, octets), True
                        )
                    stamp = rtp_jpeg.ticks(frame.stamp_ns)
                    for packet in rtp_jpeg.packets(scan, sequence, stamp, session.source):
                        session.send(packet, False)
                        sequence, count, octets = sequence + 1, count + 1, octets + len(packet) - 12
        except (
            OSError,
            BrightfieldError,
        ):  # it went away or hangs; or the region became one that RTP has not
            pass
        finally:
            session.close()
            session.reader.close()
            self._hang_up()

    def _reply(
        self, status: int, sequence: str, more: dict[str, str] | None = None, body: bytes = b""
    ) -> None:
        headers = {"CSeq": sequence, **(more or {})}
        if body:
            headers["Content-Length"] = str(len(body))
        text = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
        self._write(f"RTSP/1.0 {status} {REASONS[status]}\r\n{text}\r\n".encode("latin-1") + body)

    def _write(self, data: bytes) -> None:
        with self.writing:
            self.request.sendall(data)

    def _end(self) -> None:
        if self.session is not None:
            self.session.ended.set()
            self.session.playing.set()

    def _hang_up(self) -> None:
        with contextlib.suppress(OSError):  # it had gone before
            self.request.shutdown(socket.SHUT_RDWR)


def _description(publisher: Publisher) -> bytes:
    lines = (
        "v=0", "o=- 0 0 IN IP4 127.0.0.1", f"s={publisher.name}", "c=IN IP4 0.0.0.0", "t=0 0", "a=control:*",
        f"m=video 0 RTP/AVP {rtp_jpeg.PAYLOAD_TYPE}", "a=control:track1",
        f"a=framerate:{1 / publisher.camera.settings.period:.6g}",
    )  # fmt: skip
    return "".join(f"{line}\r\n" for line in lines).encode()

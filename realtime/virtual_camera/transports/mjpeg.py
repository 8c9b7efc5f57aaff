"""Motion JPEG over HTTP, with the truth about each frame and a door to move the scene, as JSON.

| request | gives |
|---|---|
| ``GET /`` | a page that shows the cameras |
| ``GET /NAME.mjpg`` | multipart/x-mixed-replace; parts have X-Frame-Number, X-Timestamp-ns and X-Frames-Lost |
| ``GET /NAME.jpg``, ``.png``, ``.npy`` | the latest frame; PNG and NumPy have the sensor's exact DN |
| ``GET /NAME/truth.json?number=N`` | the record of frame N, without N of the latest |
| ``GET /NAME/object_id.npy`` ... | a map that the camera's frames carry |
| ``GET /clients.json`` | who reads, how many frames each got and lost |
| ``POST /NAME/settings``, ``/NAME/trigger``, ``/NAME/pose``, ``/scene`` | see realtime.virtual_camera.requests |

A client that does not take a part within ``PATIENCE`` seconds is let go.
"""

import html
import io
import json
import socket
import threading
from collections import deque
from collections.abc import Sequence
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

import cv2
import numpy as np

from interchange.problems import BrightfieldError
from realtime.virtual_camera import requests
from realtime.virtual_camera.compressed import Compressor
from realtime.virtual_camera.frame import Frame
from realtime.virtual_camera.publisher import Publisher, Subscription
from realtime.virtual_camera.transports.base import Transport, cannot_bind, is_loopback

PATIENCE = 20.0  # s
WAITING = 1 << 18  # bytes on their way to a client: what waits there is latency
LARGEST = 1 << 20  # bytes of a request's body
BOUNDARY = "brightfield-frame"


class Mjpeg(Transport):
    meaning = "Motion JPEG over HTTP, with the truth as JSON"
    port = 8080

    def __init__(self, publishers: Sequence[Publisher], address: str = "127.0.0.1", port: int = 0) -> None:
        super().__init__(publishers, address, port)
        self.compress = {
            name: Compressor(p.camera.jpeg_quality) if p.camera.jpeg_quality else Compressor()
            for name, p in self.cameras.items()
        }
        self.readers: deque[Subscription] = deque(maxlen=1000)
        self.stopped = threading.Event()
        self._server: _Server | None = None

    def start(self) -> list[str]:
        try:
            self._server = _Server(self, self.address, self.asked_port)
        except OSError as error:
            raise cannot_bind(error, self.address, self.asked_port, "port") from None
        threading.Thread(target=self._server.serve_forever, args=(0.1,), name="http", daemon=True).start()
        return [f"{self.url}/{name}.mjpg   truth: {self.url}/{name}/truth.json" for name in self.cameras]

    @property
    def url(self) -> str:
        assert self._server is not None
        host = f"[{self.address}]" if ":" in self.address else self.address
        return f"http://{host}:{self._server.server_address[1]}"

    def stop(self) -> None:
        self.stopped.set()
        if self._server is not None:
            self._server.shutdown()
            self._server.server_close()

    def clients(self) -> list[dict[str, object]]:
        return [
            {"client": r.name, "camera": r.publisher.name, "got": r.got, "lost": r.lost} for r in self.readers
        ]


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False

    def __init__(self, transport: Mjpeg, address: str, port: int) -> None:
        self.transport = transport
        self.address_family = socket.AF_INET6 if ":" in address else socket.AF_INET
        super().__init__((address, port), _Handler)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that went away is no error; others are told as usual."""
        import sys

        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    server_version = "Brightfield"
    timeout = PATIENCE

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not logged: a stream's console is for its own lines."""

    def do_GET(self) -> None:
        if not self._trusted():
            return
        place = urlsplit(self.path)
        path, query = unquote(place.path).strip("/"), parse_qs(place.query)
        transport = self.server.transport
        if path == "":
            self._send("text/html; charset=utf-8", _page(list(transport.cameras)).encode())
            return
        if path == "clients.json":
            self._json(transport.clients())
            return
        name, _, what = path.replace("/", ".", 1).partition(".")
        publisher = transport.cameras.get(name)
        if publisher is None:
            self._refuse(HTTPStatus.NOT_FOUND, f"There are cameras {', '.join(transport.cameras)}.")
        elif what == "mjpg":
            self._stream(publisher)
        elif what == "truth.json":
            word = query.get("number", ["0"])[0]
            truth = publisher.truth(int(word)) if word.isdecimal() else None
            if truth is None:
                self._refuse(
                    HTTPStatus.NOT_FOUND, "The truth of that frame is not kept, or there is none yet."
                )
            else:
                self._json(truth.record())
        else:
            self._still(publisher, what)

    def do_POST(self) -> None:
        if not self._trusted():
            return
        if (
            self.headers.get_content_type() != "application/json"
        ):  # which no foreign web page may send unasked
            self._refuse(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "A request must be application/json.")
            return
        length = self.headers.get("Content-Length", "0")
        if not length.isdecimal() or int(length) > LARGEST:
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"A request must fit into {LARGEST} bytes.")
            return
        try:
            body = json.loads(self.rfile.read(int(length)) or b"{}")
            path = unquote(urlsplit(self.path).path).strip("/")
            self._json(requests.answer(self.server.transport.cameras, path, body))
        except ValueError as error:
            if isinstance(error, BrightfieldError):
                self._refuse(HTTPStatus.BAD_REQUEST, str(error))
            else:
                self._refuse(HTTPStatus.BAD_REQUEST, f"A request must be JSON: {error}.")
        except BrightfieldError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))

    def _trusted(self) -> bool:
        """A server on the loopback interface answers to its own names alone (DNS rebinding)."""
        host = urlsplit(f"//{self.headers.get('Host', '')}").hostname or "localhost"
        if is_loopback(self.server.transport.address) and not is_loopback(host):
            self._refuse(HTTPStatus.FORBIDDEN, f'This server is not called "{host}".')
            return False
        return True

    def _stream(self, publisher: Publisher) -> None:
        transport = self.server.transport
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, WAITING)
        self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._headers("multipart/x-mixed-replace; boundary=" + BOUNDARY)
        reader = publisher.subscribe("{}:{}".format(*self.client_address[:2]))
        transport.readers.append(reader)
        compress = transport.compress[publisher.name]
        try:
            while not transport.stopped.is_set() and not publisher.done.is_set():
                frame = reader.next(1.0)
                if frame is not None:
                    self.connection.sendall(_part(frame, compress(frame), reader.lost))
            self.connection.sendall(f"--{BOUNDARY}--\r\n".encode())
        except OSError:  # it went away, or did not take the frame in time
            return
        finally:
            reader.close()
            self.close_connection = True

    def _still(self, publisher: Publisher, what: str) -> None:
        frame = publisher.latest
        if frame is None:
            self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, "There is no frame yet.")
            return
        stem = what.removesuffix(".npy")
        if what == "jpg":
            self._send("image/jpeg", self.server.transport.compress[publisher.name](frame), frame)
        elif what == "png":
            self._send("image/png", cv2.imencode(".png", np.ascontiguousarray(frame.bgr))[1].tobytes(), frame)
        elif what == "npy":
            self._send("application/octet-stream", _npy(frame.pixels), frame)
        elif what.endswith(".npy") and stem in frame.maps:
            self._send("application/octet-stream", _npy(frame.maps[stem]), frame)
        else:
            known = ", ".join(["mjpg", "jpg", "png", "npy", "truth.json", *(f"{m}.npy" for m in frame.maps)])
            self._refuse(HTTPStatus.NOT_FOUND, f"A camera has {known}.")

    def _json(self, content: Any) -> None:
        self._send("application/json", json.dumps(content).encode())

    def _refuse(self, status: HTTPStatus, why: str) -> None:
        self._send("application/json", json.dumps({"error": why}).encode(), status=status)

    def _send(
        self, kind: str, content: bytes, frame: Frame | None = None, status: HTTPStatus = HTTPStatus.OK
    ) -> None:
        about = {"Content-Length": str(len(content))}
        if frame is not None:
            about |= {"X-Frame-Number": str(frame.number), "X-Timestamp-ns": str(frame.stamp_ns)}
        self._headers(kind, about, status)
        if self.command != "HEAD":
            self.wfile.write(content)

    def _headers(
        self, kind: str, more: dict[str, str] | None = None, status: HTTPStatus = HTTPStatus.OK
    ) -> None:
        self.send_response(status)
        for name, value in {"Content-Type": kind, "Cache-Control": "no-store", **(more or {})}.items():
            self.send_header(name, value)
        self.end_headers()


def _part(frame: Frame, jpeg: bytes, lost: int) -> bytes:
    head = (
        f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n"
        f"X-Frame-Number: {frame.number}\r\nX-Timestamp-ns: {frame.stamp_ns}\r\nX-Frames-Lost: {lost}\r\n\r\n"
    )
    return head.encode() + jpeg + b"\r\n"


def _npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def _page(names: list[str]) -> str:
    shown = "".join(
        f'<figure><img src="/{n}.mjpg" alt="{n}"><figcaption>{n}: <a href="/{n}/truth.json">truth</a>, '
        f'<a href="/{n}.png">PNG</a></figcaption></figure>'
        for n in map(html.escape, names)
    )
    return f"<!doctype html><meta charset=utf-8><title>Brightfield</title><h1>Live cameras</h1>{shown}"

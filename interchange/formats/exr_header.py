"""The header of an OpenEXR file, read and checked without the OpenEXR library.

    magic 20000630 · version and flags · attributes (name, type, size, value), an empty name · [next part]
    · one table of chunk offsets a part · chunks

A damaged file is refused here, before native code meets it. Technical introduction to OpenEXR, openexr.com.
"""

import os
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from interchange.problems import FileError, Problem, Where

MAGIC = b"\x76\x2f\x31\x01"
COMPRESSIONS = (
    "none", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB", "HTJ2K256", "HTJ2K32",
    "LJ2K", "ZSTD",
)  # fmt: skip
LINES = {"none": 1, "RLE": 1, "ZIPS": 1, "ZIP": 16}  # rows a chunk
KINDS = {0: ("uint", 4), 1: ("half", 2), 2: ("float", 4)}
REQUIRED = ("channels", "compression", "dataWindow", "displayWindow", "lineOrder")
MAX_HEADER_BYTES = 64 << 20
MAX_PIXEL_BYTES = 4 << 30
MAX_SIDE = 1 << 20  # px
NUMBERS = {
    "int": "<i", "float": "<f", "double": "<d", "v2i": "<2i", "v2f": "<2f", "v2d": "<2d", "v3i": "<3i",
    "v3f": "<3f", "v3d": "<3d", "box2i": "<4i", "box2f": "<4f", "m33f": "<9f", "m44f": "<16f", "m33d": "<9d",
    "m44d": "<16d", "chromaticities": "<8f", "rational": "<iI", "timecode": "<2I", "keycode": "<7i",
}  # fmt: skip


@dataclass(frozen=True)
class Channel:
    name: str
    kind: str  # "half", "float", "uint"
    sampling: tuple[int, int] = (1, 1)

    @property
    def bytes(self) -> int:
        return 2 if self.kind == "half" else 4


@dataclass(frozen=True)
class Header:
    """``windows``: (x0, y0, x1, y1), px, ends included. ``attributes``: what the fields do not hold."""

    channels: tuple[Channel, ...]
    data_window: tuple[int, int, int, int]
    display_window: tuple[int, int, int, int]
    compression: str
    storage: str  # "scanline", "tiled", "deep scanline", "deep tiled"
    parts: tuple[str, ...] = ("",)  # names; this is the header of the first
    attributes: dict[str, Any] = field(default_factory=dict)
    end: int = 0  # bytes from the start of the file to the chunk table

    @property
    def resolution(self) -> tuple[int, int]:
        """(width, height) of the display window, px."""
        return size(self.display_window)

    @property
    def row_bytes(self) -> int:
        return size(self.data_window)[0] * sum(c.bytes for c in self.channels)


def size(window: tuple[int, int, int, int]) -> tuple[int, int]:
    x0, y0, x1, y1 = window
    return x1 - x0 + 1, y1 - y0 + 1


def read_header(path: Path) -> Header:
    """The header of the first part. Raises FileError where it is damaged or claims what no file holds."""
    try:
        with open(path, "rb") as stream:
            data = stream.read(MAX_HEADER_BYTES)
            file_bytes = os.fstat(stream.fileno()).st_size
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", Where(str(path)))) from None
    try:
        return parse(data, file_bytes)
    except _Damaged as error:
        raise FileError(Problem(f"Not a usable OpenEXR file: {error}.", Where(str(path)))) from None


class _Damaged(Exception):
    pass


def parse(data: bytes, file_bytes: int) -> Header:
    if data[:4] != MAGIC:
        raise _Damaged("it does not begin with OpenEXR's magic number")
    (version,) = _unpack("<I", data, 4)
    flags = version & ~0xFF
    if version & 0xFF != 2 or flags & ~0x1E00:
        raise _Damaged(f"version {version & 0xFF} with flags {flags:#x} is not known")
    multipart = bool(flags & 0x1000)
    at = 8
    headers: list[dict[str, Any]] = []
    while True:
        attributes, at = _attributes(data, at)
        if not attributes and headers and multipart:
            break
        headers.append(attributes)
        if not multipart:
            break
    first = headers[0]
    missing = [n for n in REQUIRED if n not in first]
    if missing:
        raise _Damaged(f"its header has no {', '.join(missing)}")
    channels, compression = first["channels"], first["compression"]
    right = isinstance(channels, tuple) and all(isinstance(c, Channel) for c in channels)
    if not right or not isinstance(compression, str):
        raise _Damaged("its channels or its compression are of another type")
    deep = bool(flags & 0x800) or str(first.get("type", "")).startswith("deep")
    tiled = bool(flags & 0x200) or str(first.get("type", "")).endswith(("tiledimage", "deeptile"))
    known = {*REQUIRED, "type", "name", "pixelAspectRatio", "screenWindowCenter", "screenWindowWidth"}
    header = Header(
        channels=first["channels"],
        data_window=_window(first, "dataWindow"),
        display_window=_window(first, "displayWindow"),
        compression=first["compression"],
        storage=("deep " if deep else "") + ("tiled" if tiled else "scanline"),
        parts=tuple(str(h.get("name", "")) for h in headers),
        attributes={k: v for k, v in first.items() if k not in known},
        end=at,
    )
    _check(header, file_bytes)
    return header


def _check(header: Header, file_bytes: int) -> None:
    if not header.channels:
        raise _Damaged("it has no channel")
    names = [c.name for c in header.channels]
    if len(set(names)) != len(names):
        raise _Damaged("it names a channel twice")
    for window in (header.data_window, header.display_window):
        width, height = size(window)
        if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE):
            raise _Damaged(f"a window of {width} x {height} px must have sides in [1, {MAX_SIDE}]")
        needed = width * height * sum(c.bytes for c in header.channels)
        if needed > MAX_PIXEL_BYTES:
            limit = f"{MAX_PIXEL_BYTES >> 30} GiB"
            raise _Damaged(f"pixels must fit into {limit}; it has {needed / 2**30:.3g} GiB")
    height = size(header.data_window)[1]
    chunks = -(-height // LINES.get(header.compression, 256)) if header.storage == "scanline" else 1
    if header.end + 16 * chunks > file_bytes:
        raise _Damaged(f"it is cut off: {file_bytes} bytes cannot hold {height} rows")


def _attributes(data: bytes, at: int) -> tuple[dict[str, Any], int]:
    found: dict[str, Any] = {}
    while True:
        name, at = _string(data, at)
        if not name:
            return found, at
        kind, at = _string(data, at)
        (length,) = _unpack("<i", data, at)
        value = data[at + 4 : at + 4 + length]
        if length < 0 or len(value) != length:
            raise _Damaged(f'attribute "{name}" of {length} bytes does not fit into the file')
        found[name] = _value(name, kind, value)
        at += 4 + length


def _value(name: str, kind: str, value: bytes) -> Any:
    if name == "channels" and kind == "chlist":
        return _channels(value)
    if kind == "compression":
        code = value[0] if value else 255
        if code >= len(COMPRESSIONS):
            raise _Damaged(f"compression {code} is not known")
        return COMPRESSIONS[code]
    if kind in ("lineOrder", "envmap") and value:
        return value[0]
    if kind == "string":
        return value.decode("utf-8", "replace")
    if kind == "stringvector":
        texts, at = [], 0
        while at < len(value):
            (length,) = _unpack("<i", value, at)
            if length < 0:
                raise _Damaged(f'attribute "{name}" is malformed')
            texts.append(value[at + 4 : at + 4 + length].decode("utf-8", "replace"))
            at += 4 + length
        return tuple(texts)
    if kind in NUMBERS:
        if struct.calcsize(NUMBERS[kind]) != len(value):
            raise _Damaged(f'attribute "{name}" of type {kind} has {len(value)} bytes')
        numbers = struct.unpack(NUMBERS[kind], value)
        return numbers if len(numbers) > 1 else numbers[0]
    return f"({kind}, {len(value)} bytes)"


def _channels(value: bytes) -> tuple[Channel, ...]:
    found: list[Channel] = []
    at = 0
    while True:
        name, at = _string(value, at)
        if not name:
            return tuple(found)
        kind, _, sx, sy = _unpack("<iIii", value, at)
        if kind not in KINDS or sx < 1 or sy < 1:
            raise _Damaged(f'channel "{name}" has type {kind} and sampling {sx}, {sy}')
        found.append(Channel(name, KINDS[kind][0], (sx, sy)))
        at += 16


def _window(attributes: dict[str, Any], name: str) -> tuple[int, int, int, int]:
    value = attributes[name]
    if not (isinstance(value, tuple) and len(value) == 4 and all(isinstance(v, int) for v in value)):
        raise _Damaged(f"{name} is not a box of integers")
    return value


def _string(data: bytes, at: int) -> tuple[str, int]:
    end = data.find(b"\0", at, at + 256)
    if end < 0:
        raise _Damaged("its header is cut off or damaged")
    try:
        return data[at:end].decode(), end + 1
    except UnicodeDecodeError:
        raise _Damaged("a name in its header is not text") from None


def _unpack(layout: str, data: bytes, at: int) -> tuple[Any, ...]:
    if at + struct.calcsize(layout) > len(data):
        raise _Damaged("its header is cut off")
    return struct.unpack_from(layout, data, at)

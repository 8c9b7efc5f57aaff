"""glTF's containers and buffers: JSON and binary data from a .glb or .gltf file, accessors as arrays.

Every length, offset and count is checked against the bytes that are there.
"""

import base64
import binascii
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from interchange.formats.surface import Findings
from interchange.problems import FileError, Problem, Where

COMPONENT = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
LARGEST_EMPTY = 1 << 26  # elements of an accessor without data, which the specification reads as zeros


def container(data: bytes, path: str) -> tuple[dict[str, Any], bytes]:
    """The JSON document and the binary chunk."""
    text, chunk = data, b""
    if data[:4] == b"glTF":
        if len(data) < 20:
            raise FileError(Problem("The file ends within its header.", Where(path)))
        version, length = struct.unpack_from("<2I", data, 4)
        if version != 2 or length > len(data):
            said = f"glTF version {version}, {length} bytes"
            raise FileError(Problem(f"The header says {said}; the file has {len(data)} bytes.", Where(path)))
        parts, at = [], 12
        while at + 8 <= length:
            size, kind = struct.unpack_from("<I4s", data, at)
            if at + 8 + size > length:
                raise FileError(Problem("A chunk is longer than the file.", Where(path)))
            parts.append((kind, data[at + 8 : at + 8 + size]))
            at += 8 + size
        if not parts or parts[0][0] != b"JSON":
            raise FileError(Problem("The first chunk must be JSON.", Where(path)))
        text = parts[0][1]
        chunk = parts[1][1] if len(parts) > 1 and parts[1][0] == b"BIN\0" else b""
    try:
        document = json.loads(text)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise FileError(Problem(f"The JSON is damaged: {error}.", Where(path))) from None
    if not isinstance(document, dict):
        raise FileError(Problem("The JSON must be an object.", Where(path)))
    return document, chunk


class Buffers:
    """Accessors as arrays, each length and offset checked."""

    def __init__(self, document: dict[str, Any], chunk: bytes, path: str, find: Findings) -> None:
        self.document, self.path, self.find = document, path, find
        self.buffers = [self._buffer(b, i, chunk) for i, b in enumerate(document.get("buffers", []))]

    def _buffer(self, buffer: dict[str, Any], index: int, chunk: bytes) -> bytes:
        place, length, found = f"buffers[{index}]", buffer["byteLength"], len(self.find.problems)
        data = self.uri(buffer["uri"], place) if "uri" in buffer else chunk
        if isinstance(data, str):
            try:
                data = Path(data).read_bytes()
            except OSError as error:
                self.find.error(f'The file "{buffer["uri"]}" cannot be read: {error.strerror}.', place)
                data = b""
        if len(data) < length and len(self.find.problems) == found:
            self.find.error(f"The buffer must hold {length} bytes; got {len(data)}.", place)
        return data

    def uri(self, uri: str, place: str) -> bytes | str:
        """The bytes of a data URI, or the path of the file that a relative one names."""
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            try:
                return (
                    base64.b64decode(body, validate=True)
                    if head.endswith(";base64")
                    else unquote(body).encode()
                )
            except binascii.Error as error:
                self.find.error(f"The base64 text is damaged: {error}.", place)
                return b""
        if ":" in uri.split("/")[0] or uri.startswith(("/", "\\")):
            self.find.error(f'A file must be named relative to this one; got "{uri[:80]}".', place)
            return b""
        return str(Path(self.path).parent / unquote(uri))

    def view(self, index: int) -> tuple[memoryview, int]:
        """The bytes of a buffer view and its stride (0: packed)."""
        view = item(self.document.get("bufferViews", []), index, "bufferViews")
        data = item(self.buffers, view["buffer"], "buffers")
        start, length = view.get("byteOffset", 0), view["byteLength"]
        if start < 0 or length < 0 or start + length > len(data):
            raise Damaged(f"bufferViews[{index}] reaches beyond its buffer of {len(data)} bytes")
        return memoryview(data)[start : start + length], view.get("byteStride", 0)

    def accessor(self, index: int) -> np.ndarray:
        """(count,) or (count, width): floats for floats and normalised integers, else integers."""
        about = item(self.document.get("accessors", []), index, "accessors")
        kind, width, count = np.dtype(COMPONENT[about["componentType"]]), WIDTH[about["type"]], about["count"]
        if not isinstance(count, int) or count < 0:
            raise Damaged(f"accessors[{index}] must have a count of 0 or more; got {count}")
        if "bufferView" in about:
            values = self._rows(about, count, kind, width, f"accessors[{index}]")
        elif count <= LARGEST_EMPTY:
            values = np.zeros((count, width), kind)
        else:
            raise Damaged(f"accessors[{index}] has {count} elements and no data")
        if sparse := about.get("sparse"):
            n = sparse["count"]
            where = np.dtype(COMPONENT[sparse["indices"]["componentType"]])
            rows = self._rows(sparse["indices"], n, where, 1, f"accessors[{index}].sparse").ravel()
            if n and rows.max() >= count:
                raise Damaged(f"accessors[{index}].sparse must index below {count}; got {rows.max()}")
            values = values.copy()
            values[rows] = self._rows(sparse["values"], n, kind, width, f"accessors[{index}].sparse")
        if about.get("normalized") and kind.kind in "iu":
            values = np.maximum(values / np.iinfo(kind).max, -1.0)
        return values if width > 1 else values[:, 0]

    def _rows(
        self, about: dict[str, Any], count: int, kind: np.dtype[Any], width: int, place: str
    ) -> np.ndarray:
        data, stride = self.view(about["bufferView"])
        start, size = about.get("byteOffset", 0), kind.itemsize * width
        stride = stride or size
        if start < 0 or stride < size or (count and start + stride * (count - 1) + size > len(data)):
            raise Damaged(f"{place} needs more than the {len(data)} bytes of its buffer view")
        return np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))


class Damaged(Exception):
    """What a buffer claims is not there."""


def item(items: list[Any], index: Any, name: str) -> Any:
    if not isinstance(index, int) or not 0 <= index < len(items):
        raise Damaged(f"{name} has {len(items)} entries; got index {index}")
    return items[index]

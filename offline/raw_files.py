"""The two file formats that the worker exchanges with Blender in passing: uncompressed EXR in, float TIFF out.

Both are written for this one use (files that live for a frame), so that the process that runs Blender needs no
other library.
"""

import struct
from pathlib import Path

import numpy as np


def read_exr(path: Path) -> dict[str, np.ndarray]:
    """All channels (H, W) float32 of an uncompressed scanline EXR of one or more parts, as Cycles writes it."""
    raw = path.read_bytes()
    if raw[:4] != b"\x76\x2f\x31\x01":
        raise ValueError(f"{path} must be an OpenEXR file.")
    several = bool(raw[5] & 0x10)
    at = 8
    headers: list[dict[str, bytes]] = []
    while not headers or (several and raw[at] != 0):
        attributes, at = _header(raw, at)
        headers.append(attributes)
    at += several
    found: dict[str, np.ndarray] = {}
    parts = []
    for attributes in headers:
        left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
        parts.append((_channels(attributes["channels"], path), right - left + 1, bottom - top + 1))
        if attributes["compression"][0] != 0:
            raise ValueError(f"{path} must not be compressed.")
    at += 8 * sum(height for _, _, height in parts)  # the tables of line offsets; the lines stand in order
    head = 12 if several else 8
    for names, width, height in parts:
        line = head + 4 * width * len(names)
        block = np.frombuffer(raw, np.uint8, line * height, at).reshape(height, line)[:, head:]
        at += line * height
        pixels = np.ascontiguousarray(block).view(np.float32).reshape(height, len(names), width)
        found.update({name: np.ascontiguousarray(pixels[:, k]) for k, name in enumerate(names)})
    return found


def _header(raw: bytes, at: int) -> tuple[dict[str, bytes], int]:
    attributes = {}
    while raw[at] != 0:
        end = raw.index(b"\0", at)
        name = raw[at:end].decode()
        at = raw.index(b"\0", end + 1) + 1  # skips the type's name
        (size,) = struct.unpack_from("<i", raw, at)
        attributes[name] = raw[at + 4 : at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def _channels(value: bytes, path: Path) -> list[str]:
    names, k = [], 0
    while value[k] != 0:
        stop = value.index(b"\0", k)
        names.append(value[k:stop].decode())
        if struct.unpack_from("<i", value, stop + 1)[0] != 2:
            raise ValueError(f"{path} must hold float channels; {names[-1]} is of another type.")
        k = stop + 17
    return names


def write_tiff(path: Path, pixels: np.ndarray) -> None:
    """A float32 image (h, w, C) as one uncompressed strip."""
    h, w, c = pixels.shape
    body = np.ascontiguousarray(pixels, "<f4").tobytes()
    entries = [
        (256, 4, 1, w), (257, 4, 1, h), (258, 3, 1, 32), (259, 3, 1, 1), (262, 3, 1, 2 if c == 3 else 1),
        (273, 4, 1, 8), (277, 3, 1, c), (278, 4, 1, h), (279, 4, 1, len(body)), (339, 3, 1, 3),
    ]  # fmt: skip
    extra = b""
    table = 8 + len(body)
    after = table + 2 + 12 * len(entries) + 4
    packed = struct.pack("<H", len(entries))
    for tag, kind, count, value in entries:
        if tag in (258, 339) and c == 3:  # one number a channel, which does not fit into the entry
            packed += struct.pack("<HHII", tag, kind, c, after + len(extra))
            extra += struct.pack("<3H", value, value, value)
        else:
            packed += struct.pack("<HHII", tag, kind, count, value)
    path.write_bytes(struct.pack("<2sHI", b"II", 42, table) + body + packed + struct.pack("<I", 0) + extra)

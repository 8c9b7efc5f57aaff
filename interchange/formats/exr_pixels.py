"""The channels of an OpenEXR file as arrays.

Files in rows without compression or with ZIP (ours, Blender's, OpenCV's) are decoded here by NumPy and zlib,
which no file can crash. Tiles, several parts and the other compressions go to the OpenEXR library in a
process of its own: it prints its complaints and hands out what it could decode, so that is checked.

A chunk is ``y, bytes, data``; inflated, ``data`` is two halves to interleave (even and odd bytes) in which
each byte is the difference to its predecessor plus 128; then each row holds its channels one after another.
"""

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from interchange.formats.exr_header import LINES, Header, read_header, size
from interchange.formats.isolation import isolated
from interchange.problems import FileError, Problem, Where

DTYPES: dict[str, np.dtype[Any]] = {
    "uint": np.dtype("<u4"),
    "half": np.dtype("<f2"),
    "float": np.dtype("<f4"),
}
SECONDS = 60.0


def read_channels(path: Path, header: Header | None = None) -> dict[str, np.ndarray]:
    """Every channel of the first part, (h, w) of the data window: uint32, float16 or float32 as in the file.

    Raises FileError for damaged files, deep pixels and subsampled channels.
    """
    header = header or read_header(path)
    where = Where(str(path))
    if header.storage.startswith("deep"):
        raise FileError(Problem("A flat image must be given; this OpenEXR file holds deep pixels.", where))
    if coarse := [c.name for c in header.channels if c.sampling != (1, 1)]:
        message = f"Channels must have full resolution; {', '.join(coarse)} is subsampled."
        raise FileError(Problem(message, where))
    if (
        header.storage == "scanline"
        and len(header.parts) == 1
        and header.compression in ("none", "ZIPS", "ZIP")
    ):
        return _decode(path, header)
    memory = (1 << 30) + 2 * header.row_bytes * size(header.data_window)[1]
    return isolated(_read_with_library, path, header, seconds=SECONDS, memory_bytes=memory)


def _decode(path: Path, header: Header) -> dict[str, np.ndarray]:
    data = path.read_bytes()
    width, height = size(header.data_window)
    lines, y0 = LINES[header.compression], header.data_window[1]
    count = -(-height // lines)
    offsets = struct.unpack_from(f"<{count}Q", data, header.end)  # in the file: read_header checked it
    rows = np.empty((height, header.row_bytes), np.uint8)
    filled = np.zeros(count, bool)
    for offset in offsets:
        y, length = struct.unpack_from("<ii", data, offset) if offset + 8 <= len(data) else (0, -1)
        index, rest = divmod(y - y0, lines)
        if length < 0 or rest or not 0 <= index < count or filled[index] or offset + 8 + length > len(data):
            raise _damaged(path, "its table of chunks points outside the file; it is cut off or damaged")
        block = rows[index * lines : (index + 1) * lines]
        packed = memoryview(data)[offset + 8 : offset + 8 + length]
        if length == block.size:  # stored as it is where packing gains nothing
            block[:] = np.frombuffer(packed, np.uint8).reshape(block.shape)
        else:
            block[:] = _unzip(path, packed, block.size).reshape(block.shape)
        filled[index] = True
    channels, at = {}, 0
    for channel in header.channels:
        dtype = DTYPES[channel.kind]
        column = np.ascontiguousarray(rows[:, at : at + width * channel.bytes])
        channels[channel.name] = column.view(dtype)
        at += width * channel.bytes
    return channels


def _unzip(path: Path, packed: memoryview, length: int) -> np.ndarray:
    inflate = zlib.decompressobj()
    try:
        raw = inflate.decompress(packed, length)
        complete = len(raw) == length and not inflate.decompress(inflate.unconsumed_tail, 1) and inflate.eof
    except zlib.error:
        complete = False
    if not complete:
        raise _damaged(path, "a chunk of its pixels does not unpack")
    halves = np.cumsum(np.frombuffer(raw, np.uint8), dtype=np.uint8)
    halves[1::2] ^= 128  # minus 128 at every step
    rows = np.empty(length, np.uint8)
    middle = (length + 1) // 2
    rows[0::2], rows[1::2] = halves[:middle], halves[middle:]
    return rows


def _read_with_library(path: str, header: Header) -> dict[str, np.ndarray]:
    import OpenEXR

    try:
        with OpenEXR.File(path, separate_channels=True, num_threads=0) as file:
            first = file.parts[0].channels if file.parts else {}
            found = {name: np.array(channel.pixels) for name, channel in first.items()}
    except (RuntimeError, ValueError, UnicodeDecodeError):
        raise _damaged(Path(path), "the OpenEXR library cannot open it") from None
    width, height = size(header.data_window)
    if not all(c.name in found and found[c.name].shape == (height, width) for c in header.channels):
        raise _damaged(Path(path), "its pixels do not unpack")
    return found


def _damaged(path: Path, why: str) -> FileError:
    return FileError(Problem(f"Not a usable OpenEXR file: {why.rstrip('.')}.", Where(str(path))))

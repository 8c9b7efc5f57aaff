"""PNG's structure, checked before libpng meets it, and a writer for 8 and 16 bits.

A PNG is chunks ``length, type, data, CRC``. Of these only the critical ones and tRNS reach the decoder, with
checked CRCs and pixel data that was inflated here and has the right length: nothing is left to go wrong.
PNG specification, third edition, W3C 2025.
"""

import struct
import zlib
from dataclasses import dataclass

import numpy as np

SIGNATURE = b"\x89PNG\r\n\x1a\n"
SAMPLES = {0: "Y", 2: "RGB", 3: "RGB", 4: "YA", 6: "RGBA"}  # by colour type; 3 is a palette
DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
ADAM7 = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
MAX_BYTES = 2 << 30
PIECE = 1 << 20  # bytes a chunk: OpenCV refuses larger ones than 8 MB


class DamagedImage(Exception):
    """Why an image cannot be read, without its name; a reader adds the place."""


@dataclass(frozen=True, eq=False)
class Decoded:
    """``array`` (h, w, C), channels as ``channels`` names them; ``bits`` a sample had in the file."""

    array: np.ndarray
    channels: str  # "Y", "YA", "RGB", "RGBA"
    bits: int
    srgb: bool | None  # what the file says of its encoding; None where it says nothing
    about: dict[str, str | int | float]


def decode(data: bytes) -> Decoded:
    """Samples of 1, 2, 4 bits are widened to 8 (0 .. 255), palettes to RGB or RGBA. Raises DamagedImage."""
    import cv2

    chunks = _chunks(data)
    if not chunks or chunks[0][0] != b"IHDR" or len(chunks[0][1]) != 13:
        raise DamagedImage("its first chunk is not a header")
    width, height, bits, color, packing, filtering, interlace = struct.unpack(">IIBBBBB", chunks[0][1])
    if color not in DEPTHS or bits not in DEPTHS[color] or packing or filtering or interlace > 1:
        raise DamagedImage(f"colour type {color} with {bits} bits is not in the standard")
    if not (0 < width < 1 << 31 and 0 < height < 1 << 31):
        raise DamagedImage(f"a size of {width} x {height} px is not in the standard")
    samples = 1 if color == 3 else len(SAMPLES[color])
    passes = ADAM7 if interlace else ((0, 0, 1, 1),)
    raw_bytes = 0
    for x, y, dx, dy in passes:
        w, h = -(-(width - x) // dx), -(-(height - y) // dy)
        raw_bytes += h * (1 + (w * samples * bits + 7) // 8) if w > 0 and h > 0 else 0
    packed = b"".join(d for t, d in chunks if t == b"IDAT")
    if raw_bytes > MAX_BYTES:
        raise DamagedImage(f"pixels must fit into {MAX_BYTES >> 30} GiB; it has {raw_bytes / 2**30:.3g} GiB")
    palette = [d for t, d in chunks if t == b"PLTE"]
    if color == 3 and not (len(palette) == 1 and len(palette[0]) % 3 == 0 and 0 < len(palette[0]) <= 768):
        raise DamagedImage("it needs one palette of up to 256 colours")
    raw = _inflate(packed, raw_bytes)
    keep = [(t, d) for t, d in chunks if t in (b"IHDR", b"PLTE", b"tRNS") and (t != b"PLTE" or color == 3)]
    stored = zlib.compress(raw, 0)
    pieces = [(b"IDAT", stored[i : i + PIECE]) for i in range(0, len(stored), PIECE)]
    clean = [*keep, *pieces, (b"IEND", b"")]
    array = cv2.imdecode(
        np.frombuffer(SIGNATURE + b"".join(map(_chunk, clean)), np.uint8), cv2.IMREAD_UNCHANGED
    )
    if array is None or array.shape[:2] != (height, width):
        raise DamagedImage("its pixels do not unpack")
    array = array[..., None] if array.ndim == 2 else array
    if color == 4:
        array = array[..., [0, 3]]
    elif array.shape[2] >= 3:
        array = array[..., [2, 1, 0, 3][: array.shape[2]]]
    names = {1: "Y", 2: "YA", 3: "RGB", 4: "RGBA"}[array.shape[2]]
    about: dict[str, str | int | float] = {"palette": len(palette[0]) // 3} if color == 3 else {}
    info = dict(chunks)
    if len(info.get(b"pHYs", b"")) == 9 and info[b"pHYs"][8] == 1:
        about["pixels_per_metre"] = struct.unpack(">I", info[b"pHYs"][:4])[0]
    if info.get(b"sBIT"):
        about["significant_bits"] = max(info[b"sBIT"])
    srgb = None
    if b"sRGB" in info:
        srgb = True
    elif len(info.get(b"gAMA", b"")) == 4:
        gamma = struct.unpack(">I", info[b"gAMA"])[0] / 1e5
        about["gamma"] = gamma
        srgb = True if abs(gamma - 1 / 2.2) < 1e-3 else False if gamma == 1 else None
    return Decoded(np.ascontiguousarray(array), names, bits, srgb, about)


def encode(array: np.ndarray) -> bytes:
    """PNG of an array (h, w), (h, w, 1), (h, w, 3) or (h, w, 4), uint8 or uint16, rows top first."""
    h, w = array.shape[:2]
    planes = array.shape[2] if array.ndim == 3 else 1
    color = {1: 0, 2: 4, 3: 2, 4: 6}[planes]
    bits = 8 * array.dtype.itemsize
    rows = np.ascontiguousarray(array, f">u{array.dtype.itemsize}").view(np.uint8).reshape(h, -1)
    raw = np.zeros((h, rows.shape[1] + 1), np.uint8)
    raw[:, 0] = 2  # filter "up": small differences pack well
    raw[0, 1:], raw[1:, 1:] = rows[0], rows[1:] - rows[:-1]
    header = struct.pack(">IIBBBBB", w, h, bits, color, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(raw.tobytes(), 6)), (b"IEND", b"")]
    return SIGNATURE + b"".join(map(_chunk, chunks))


def _chunk(chunk: tuple[bytes, bytes]) -> bytes:
    kind, data = chunk
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    found: list[tuple[bytes, bytes]] = []
    at = len(SIGNATURE)
    while True:
        if at + 12 > len(data):
            raise DamagedImage("it is cut off")
        (length,) = struct.unpack_from(">I", data, at)
        if at + 12 + length > len(data):
            name = data[at + 4 : at + 8].decode("ascii", "replace")
            raise DamagedImage(f"its chunk {name} of {length} bytes is cut off")
        kind, content = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        (crc,) = struct.unpack_from(">I", data, at + 8 + length)
        if zlib.crc32(kind + content) != crc:
            raise DamagedImage(f"the checksum of its chunk {kind.decode('ascii', 'replace')} is wrong")
        found.append((kind, content))
        if kind == b"IEND":
            return found
        at += 12 + length


def _inflate(packed: bytes, length: int) -> bytes:
    if length > 1032 * len(packed) + 1024:  # deflate's largest ratio
        raise DamagedImage("it is cut off: its pixel data cannot fill its size")
    inflate = zlib.decompressobj()
    try:
        raw = inflate.decompress(packed, length)
    except zlib.error:
        raise DamagedImage("its pixels do not unpack") from None
    if len(raw) != length:
        raise DamagedImage("it is cut off: its pixel data does not fill its size")
    return raw

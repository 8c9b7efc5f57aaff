"""TIFF 6.0: the first image of a file, exactly as its samples are.

Strips without compression, packed by Deflate or PackBits, of 8 and 16 bit integers and floats are decoded by
NumPy; LZW and tiles go to OpenCV's libtiff in a process of its own. TIFF revision 6.0, Adobe 1992.
"""

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np

from interchange.formats.isolation import isolated
from interchange.formats.png import MAX_BYTES, DamagedImage, Decoded

LETTERS = {1: "B", 3: "H", 4: "I", 16: "Q"}  # whole numbers; no other type is needed
PACKINGS = {
    1: "none", 2: "CCITT fax", 3: "CCITT fax", 4: "CCITT fax", 5: "LZW", 6: "JPEG", 7: "JPEG", 8: "Deflate",
    32773: "PackBits", 32946: "Deflate", 50000: "Zstandard",
}  # fmt: skip
WIDTH, HEIGHT, BITS, COMPRESSION, PHOTOMETRIC, OFFSETS, ORIENTATION = 256, 257, 258, 259, 262, 273, 274
SAMPLES, ROWS, COUNTS, PLANAR, PREDICTOR, PALETTE = 277, 278, 279, 284, 317, 320
TILE_WIDTH, FORMAT = 322, 339
NEEDED = {*range(WIDTH, PHOTOMETRIC + 1), OFFSETS, ORIENTATION, SAMPLES, ROWS, COUNTS} | {
    PLANAR, PREDICTOR, PALETTE, TILE_WIDTH, FORMAT,
}  # fmt: skip


def is_tiff(head: bytes) -> bool:
    return head[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def decode(data: bytes, path: Path) -> Decoded:
    """Raises DamagedImage for damaged files and for kinds that cannot be had exactly (CMYK, JPEG, fax)."""
    order: Literal["<", ">"] = "<" if data[:2] == b"II" else ">"
    tags, more = _directory(data, order)
    required = {"ImageWidth": WIDTH, "ImageLength": HEIGHT, "PhotometricInterpretation": PHOTOMETRIC}
    for name, tag in required.items():
        if not tags.get(tag):
            raise DamagedImage(f"it has no {name}")
    width, height = tags[WIDTH][0], tags[HEIGHT][0]
    samples = tags.get(SAMPLES, (1,))[0]
    bits, kinds = set(tags.get(BITS, (1,))), set(tags.get(FORMAT, (1,)))
    packing = PACKINGS.get(tags.get(COMPRESSION, (1,))[0], "an unknown packing")
    photometric, predictor = tags[PHOTOMETRIC][0], tags.get(PREDICTOR, (1,))[0]
    if len(bits) != 1 or len(kinds) != 1 or (code := (kinds.pop(), bits.pop())) not in _KINDS:
        raise DamagedImage("samples must be unsigned integers of 8, 16, 32 bits or floats")
    if photometric not in (0, 1, 2, 3) or samples < (3 if photometric == 2 else 1) or samples > 64:
        raise DamagedImage("only grey, RGB and palette images are read")
    if photometric == 3 and (samples != 1 or code not in ((1, 8), (1, 16))):
        raise DamagedImage("a palette needs one channel of 8 or 16 bits")
    dtype = np.dtype(_KINDS[code])
    needed = width * height * samples * dtype.itemsize
    if not 0 < needed <= MAX_BYTES:
        limit = f"{MAX_BYTES >> 30} GiB"
        raise DamagedImage(f"pixels must fit into {limit}; it has {needed / 2**30:.3g} GiB")
    unpack = _UNPACK.get(packing)
    planar = samples > 1 and tags.get(PLANAR, (1,))[0] == 2
    about: dict[str, str | int | float] = {"packing": packing}
    if unpack and TILE_WIDTH not in tags and predictor in (1, 2) and (predictor == 1 or code[0] == 1):
        array = _strips(data, tags, unpack, dtype.newbyteorder(order), (height, width, samples), predictor)
    elif packing in _LIBRARY and samples in (1, 3, 4) and photometric in (1, 2) and not planar:
        from interchange.formats.native import opencv

        memory = (1 << 30) + 4 * needed
        array = isolated(opencv.decode, path, data, memory_bytes=memory)
        if array.shape != (height, width, samples) or array.dtype != dtype:
            raise DamagedImage("its pixels do not unpack")
    else:
        raise DamagedImage(f"packing by {packing} is not read for this kind of image")
    if photometric == 0:
        if code[0] != 1:
            raise DamagedImage("white must not be zero where samples are floats")
        array = np.iinfo(dtype).max - array
    if photometric == 3:
        table = np.array(tags.get(PALETTE, ()), np.uint16)
        if len(table) != 3 << code[1]:
            raise DamagedImage("its palette is missing or too short")
        bits_of_index = code[1]
        array = table.reshape(3, -1).T[array[..., 0]]
        about["palette"] = 1 << bits_of_index
        code = (1, 16)
    if more:
        about["further_images"] = "left out"
    if tags.get(ORIENTATION, (1,))[0] != 1:
        about["orientation"] = tags[ORIENTATION][0]
    names = {1: "Y", 2: "YA", 3: "RGB", 4: "RGBA"}.get(array.shape[2], f"{array.shape[2]} channels")
    return Decoded(array, names, code[1], None, about)


def encode(array: np.ndarray) -> bytes:
    """TIFF of an array (h, w), (h, w, 1) or (h, w, 3), uint8 or uint16: one strip, not packed, little-endian."""
    height, width = array.shape[:2]
    samples = array.shape[2] if array.ndim == 3 else 1
    bits = 8 * array.dtype.itemsize
    pixels = np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes()
    entries = {
        WIDTH: (4, [width]),
        HEIGHT: (4, [height]),
        BITS: (3, [bits] * samples),
        COMPRESSION: (3, [1]),
        PHOTOMETRIC: (3, [2 if samples == 3 else 1]),
        OFFSETS: (4, [8]),
        SAMPLES: (3, [samples]),
        ROWS: (4, [height]),
        COUNTS: (4, [len(pixels)]),
        PLANAR: (3, [1]),
        FORMAT: (3, [1] * samples),
    }
    start = 8 + len(pixels) + len(pixels) % 2
    beyond = start + 2 + 12 * len(entries) + 4
    directory, more = struct.pack("<H", len(entries)), b""
    for tag, (kind, values) in sorted(entries.items()):
        data = struct.pack(f"<{len(values)}{LETTERS[kind]}", *values)
        if len(data) > 4:
            data, more = struct.pack("<I", beyond + len(more)), more + data
        directory += struct.pack("<HHI", tag, kind, len(values)) + data.ljust(4, b"\0")
    head = struct.pack("<2sHI", b"II", 42, start)
    return head + pixels + b"\0" * (len(pixels) % 2) + directory + struct.pack("<I", 0) + more


_KINDS = {(1, 8): "u1", (1, 16): "u2", (1, 32): "u4", (3, 16): "f2", (3, 32): "f4", (3, 64): "f8"}


def _directory(data: bytes, order: str) -> tuple[dict[int, tuple[Any, ...]], bool]:
    """The tags of the first image, and whether there are more images."""
    big = data[2:4] in (b"+\0", b"\0+")
    entry, value, inline = (20, 12, 8) if big else (12, 8, 4)
    word, count_word = ("Q", "Q") if big else ("I", "H")

    def get(layout: str, at: int) -> tuple[Any, ...]:
        if at + struct.calcsize(order + layout) > len(data):
            raise DamagedImage("it is cut off")
        return struct.unpack_from(order + layout, data, at)

    (start,) = get(word, 8 if big else 4)
    (entries,) = get(count_word, start)
    start += struct.calcsize(order + count_word)
    tags: dict[int, tuple[Any, ...]] = {}
    for i in range(min(entries, 4096)):
        at = start + entry * i
        tag, kind = get("HH", at)
        (count,) = get(word, at + 4)
        if kind not in LETTERS or tag not in NEEDED:
            continue
        if count > len(data):
            raise DamagedImage("it is cut off")
        place = at + value
        if struct.calcsize(f"{order}{count}{LETTERS[kind]}") > inline:
            (place,) = get(word, place)
        tags[tag] = get(f"{count}{LETTERS[kind]}", place)
    (following,) = get(word, start + entry * entries)
    return tags, following != 0


def _strips(
    data: bytes,
    tags: dict[int, tuple[Any, ...]],
    unpack: Callable[[bytes, int], bytes],
    dtype: np.dtype[Any],
    shape: tuple[int, int, int],
    predictor: int,
) -> np.ndarray:
    height, width, samples = shape
    planes = samples if tags.get(PLANAR, (1,))[0] == 2 and samples > 1 else 1
    deep = samples // planes
    rows = max(1, min(tags.get(ROWS, (height,))[0], height))
    offsets, counts = tags.get(OFFSETS, ()), tags.get(COUNTS, ())
    strips = -(-height // rows)
    if len(offsets) != strips * planes or len(counts) != len(offsets):
        raise DamagedImage(f"{strips * planes} strips are needed; it has {len(offsets)}")
    array = np.empty((planes, height, width, deep), dtype.newbyteorder("="))
    for i, (offset, count) in enumerate(zip(offsets, counts, strict=True)):
        plane, strip = divmod(i, strips)
        block = array[plane, strip * rows : (strip + 1) * rows]
        length = block.size * dtype.itemsize
        raw = unpack(data[offset : offset + count], length)
        if len(raw) < length:
            raise DamagedImage("it is cut off: its strips do not fill its size")
        block[:] = np.frombuffer(raw[:length], dtype).reshape(block.shape)
    if predictor == 2:
        array = np.cumsum(array, axis=2, dtype=array.dtype)
    return np.ascontiguousarray(array[0] if planes == 1 else np.moveaxis(array[..., 0], 0, -1))


def _plain(packed: bytes, length: int) -> bytes:
    return packed


def _inflate(packed: bytes, length: int) -> bytes:
    try:
        return zlib.decompressobj().decompress(packed, length)
    except zlib.error:
        raise DamagedImage("a strip of its pixels does not unpack") from None


def _packbits(packed: bytes, length: int) -> bytes:
    out = bytearray()
    at = 0
    while at < len(packed) and len(out) < length:
        n = packed[at]
        if n < 128:
            out += packed[at + 1 : at + 2 + n]
            at += n + 2
        else:  # 128 does nothing
            out += packed[at + 1 : at + 2] * (257 - n if n > 128 else 0)
            at += 2 if n > 128 else 1
    return bytes(out)


_LIBRARY = ("none", "Deflate", "LZW", "PackBits")  # tiles, LZW, differences of floats
_UNPACK = {"none": _plain, "Deflate": _inflate, "PackBits": _packbits}

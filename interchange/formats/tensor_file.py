"""Tensor files: named arrays in one file, as the RGL material database and Mitsuba keep them.

"tensor_file\\0", version 1.0, the number of fields, then for each its name, dimensions, type, offset and shape, all
little endian; the arrays lie at their offsets.
"""

import os
import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from interchange.formats.atomic import written_beside
from interchange.formats.binary_file import bytes_of
from interchange.problems import FileError, Problem, Where

MAGIC = b"tensor_file\0"
TYPES = ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8")  # numbered from 1
MAX_FIELDS = 256


def read_tensors(path: Path | str) -> dict[str, np.ndarray]:
    """The arrays by name, read-only. Raises FileError for a file that is damaged or cut short."""
    path = Path(path)
    data = bytes_of(path)

    def error(message: str) -> FileError:
        return FileError(Problem(message, Where(str(path))))

    if not data.startswith(MAGIC):
        raise error("A tensor file must begin with its name; this one does not.")
    fields: dict[str, np.ndarray] = {}
    try:
        version = data[12:14]
        (count,) = struct.unpack_from("<I", data, 14)
        if version != b"\1\0" or count > MAX_FIELDS:
            raise error(f"A tensor file must be of version 1.0 with up to {MAX_FIELDS} fields.")
        at = 18
        for _ in range(count):
            (length,) = struct.unpack_from("<H", data, at)
            name = data[at + 2 : at + 2 + length].decode("utf8")
            dimensions, kind, offset = struct.unpack_from("<HBQ", data, at + 2 + length)
            at += 13 + length
            shape = struct.unpack_from(f"<{dimensions}Q", data, at)
            at += 8 * dimensions
            if not 1 <= kind <= len(TYPES) or dimensions > 16 or max(shape, default=0) > len(data):
                raise error(f'The field "{name}" has a type or a shape that cannot be.')
            dtype = np.dtype("<" + TYPES[kind - 1])
            size = dtype.itemsize
            for n in shape:
                size *= n
            if offset + size > len(data):
                raise error(
                    f'The field "{name}" must take {size} bytes from {offset}; the file has {len(data)}.'
                )
            fields[name] = np.frombuffer(data, dtype, size // dtype.itemsize, offset).reshape(shape)
    except (struct.error, ValueError):  # UnicodeDecodeError is one
        raise error("The file is cut short or damaged.") from None
    return fields


def write_tensors(path: Path | str, fields: Mapping[str, np.ndarray]) -> None:
    """Write arrays under their names, beside and renamed. Raises FileError where that fails."""
    path = Path(path)
    arrays = {name: np.ascontiguousarray(a) for name, a in fields.items()}
    head = sum(2 + len(name.encode()) + 11 + 8 * a.ndim for name, a in arrays.items())
    offset = len(MAGIC) + 6 + head
    parts = [MAGIC, b"\1\0", struct.pack("<I", len(arrays))]
    for name, a in arrays.items():
        offset += -offset % 8
        word = name.encode()
        kind = TYPES.index(a.dtype.str[1:]) + 1
        parts.append(struct.pack("<H", len(word)) + word + struct.pack("<HBQ", a.ndim, kind, offset))
        parts.append(struct.pack(f"<{a.ndim}Q", *a.shape))
        offset += a.nbytes
    data = b"".join(parts)
    for a in arrays.values():
        data += bytes(-len(data) % 8) + a.astype(a.dtype.newbyteorder("<")).tobytes()
    beside = written_beside(path)
    try:
        beside.write_bytes(data)
        os.replace(beside, path)
    except OSError as error:
        raise FileError(Problem(f"The file cannot be written: {error.strerror}.", Where(str(path)))) from None
    finally:
        beside.unlink(missing_ok=True)

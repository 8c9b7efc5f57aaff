"""GigE Vision's stream protocol: a frame as UDP datagrams.

AIA: GigE Vision, video streaming and device control over Ethernet standard, 2.0, 2011: part 3, standard IDs.
"""

import struct

from realtime.virtual_camera.frame import Frame
from realtime.virtual_camera.genicam import IMAGE_CHUNK, NUMBER_CHUNK, TRUTH_CHUNK

HEADERS = 20 + 8 + 8  # bytes of IP, UDP and GVSP in a packet's size
LEADER, TRAILER, PAYLOAD = 1, 2, 3
IMAGE, WITH_CHUNKS = 0x0001, 0x4000
RESENT = 0x0100  # status of a packet that was asked for again


def payload(frame: Frame, truth: bytes | None) -> bytes:
    """The frame's bytes; with ``truth``, its number and that text in chunks behind."""
    pixels = frame.pixels.tobytes()  # little-endian, as PFNC has it
    if truth is None:
        return pixels
    number = struct.pack(">Q", frame.number)
    chunks = ((pixels, IMAGE_CHUNK), (number, NUMBER_CHUNK), (truth, TRUTH_CHUNK))
    return b"".join(data + struct.pack(">II", kind, len(data)) for data, kind in chunks)


def packets(frame: Frame, data: bytes, block: int, size: int, chunks: bool) -> list[bytes]:
    """The datagrams of one block: leader, payload in packets of ``size`` bytes with all headers, trailer."""
    kind = IMAGE | (WITH_CHUNKS if chunks else 0)
    height, width = frame.pixels.shape[:2]
    x, y = frame.truth.region[:2]
    stamp = frame.stamp_ns
    leader = struct.pack(
        ">HHIIIIIIIHH", 0, kind, stamp >> 32 & 0xFFFFFFFF, stamp & 0xFFFFFFFF, frame.format.code, width, height, x, y,
        0, 0,
    )  # fmt: skip
    out = [_head(block, LEADER, 0) + leader]
    step = size - HEADERS
    out += [
        _head(block, PAYLOAD, k + 1) + data[at : at + step] for k, at in enumerate(range(0, len(data), step))
    ]
    trailer = struct.pack(">HHI", 0, kind, height)
    if chunks:
        trailer += struct.pack(">I", 1)  # identifies the chunks' layout, which is always this one
    return [*out, _head(block, TRAILER, len(out)) + trailer]


def again(packet: bytes) -> bytes:
    """A packet, marked as one that was asked for again."""
    return struct.pack(">H", RESENT) + packet[2:]


def gone(block: int, number: int) -> bytes:
    """What is sent for a packet that is not kept any more."""
    return struct.pack(">HHI", 0x800C, block, PAYLOAD << 24 | number)


def _head(block: int, kind: int, number: int) -> bytes:
    return struct.pack(">HHI", 0, block, kind << 24 | number)

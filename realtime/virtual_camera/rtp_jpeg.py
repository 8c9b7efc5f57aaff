"""JPEG in RTP packets.

Berc, Fenner, Frederick, McCanne, Stewart: RTP payload format for JPEG-compressed video. RFC 2435, 1998.
Schulzrinne, Casner, Frederick, Jacobson: RTP: a transport protocol for real-time applications. RFC 3550, 2003.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from interchange.problems import BrightfieldError

PAYLOAD_TYPE = 26  # JPEG, of RFC 3551
CLOCK = 90_000  # ticks a second
LARGEST = 1400  # bytes of a packet's payload: below Ethernet's with all headers
MOST_PIXELS = 2040  # a side: the header has one byte for its eighths
NTP_FROM_UNIX = 2_208_988_800  # s from 1900 to 1970
TABLES_FOLLOW = 255  # Q: the quantisation tables are in the packet
SUBSAMPLING = {(2, 1): 0, (2, 2): 1}  # of luma against chroma, (horizontal, vertical) -> type


@dataclass(frozen=True)
class Scan:
    """What RTP carries of a JPEG file: the rest is agreed upon. ``tables``: 128 bytes, luma's and chroma's."""

    kind: int
    width: int
    height: int
    tables: bytes
    data: bytes


def check_size(width: int, height: int) -> None:
    """Raises BrightfieldError where RFC 2435 cannot say the size."""
    if width % 8 or height % 8 or max(width, height) > MOST_PIXELS:
        raise BrightfieldError(
            f"RTSP's frames must have multiples of 8 px a side, up to {MOST_PIXELS} (RFC 2435); got "
            f"{width} x {height}. Stream another region or --width."
        )


def scan_of(jpeg: bytes) -> Scan:
    """Take a baseline JPEG of three channels with the usual Huffman tables apart; BrightfieldError for any other."""
    tables: dict[int, bytes] = {}
    at, kind, width, height = 2, -1, 0, 0
    used: list[int] = []
    while at + 4 <= len(jpeg):
        marker, length = struct.unpack_from(">HH", jpeg, at)
        body = jpeg[at + 4 : at + 2 + length]
        if marker == 0xFFDB:
            while body and body[0] < 16:  # eight-bit tables
                tables[body[0]] = body[1:65]
                body = body[65:]
        elif marker == 0xFFC0 and body[5] == 3:
            height, width = struct.unpack_from(">HH", body, 1)
            sampling = body[7] >> 4, body[7] & 15
            kind = SUBSAMPLING.get(sampling, -1)
            used = [body[8], body[11]]
        elif marker == 0xFFDA:
            if kind < 0 or any(u not in tables for u in used):
                break
            check_size(width, height)
            end = len(jpeg) - 2 if jpeg.endswith(b"\xff\xd9") else len(jpeg)
            return Scan(kind, width, height, b"".join(tables[u] for u in used), jpeg[at + 2 + length : end])
        at += 2 + length
    raise BrightfieldError("RTP carries baseline JPEG of three channels with 4:2:0 or 4:2:2; got another.")


def packets(scan: Scan, sequence: int, timestamp: int, source: int) -> Iterator[bytes]:
    """RTP packets of one frame, the last one marked. ``sequence``: number of the first."""
    offset = 0
    while offset < len(scan.data):
        head = struct.pack(
            ">BBHBBBB", 0, offset >> 16, offset & 0xFFFF, scan.kind, TABLES_FOLLOW, scan.width // 8, scan.height // 8
        )  # fmt: skip
        if offset == 0:
            head += struct.pack(">BBH", 0, 0, len(scan.tables)) + scan.tables
        part = scan.data[offset : offset + LARGEST - len(head)]
        offset += len(part)
        last = offset >= len(scan.data)
        yield (
            struct.pack(
                ">BBHII", 0x80, (last << 7) | PAYLOAD_TYPE, sequence & 0xFFFF, timestamp & 0xFFFFFFFF, source
            )
            + head
            + part
        )
        sequence += 1


def ticks(stamp_ns: int) -> int:
    """RTP's time of a stamp, before it is cut to 32 bits."""
    return stamp_ns * CLOCK // 1_000_000_000


def sender_report(stamp_ns: int, source: int, count: int, octets: int) -> bytes:
    """RTCP packet that tells which moment (UTC) the RTP time of ``stamp_ns`` is."""
    seconds, rest = divmod(stamp_ns, 1_000_000_000)
    fraction = (rest << 32) // 1_000_000_000
    return struct.pack(
        ">BBHIIIIII", 0x80, 200, 6, source, (seconds + NTP_FROM_UNIX) & 0xFFFFFFFF, fraction,
        ticks(stamp_ns) & 0xFFFFFFFF, count & 0xFFFFFFFF, octets & 0xFFFFFFFF,
    )  # fmt: skip

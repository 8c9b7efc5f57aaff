"""The layout of the shared ring: a head, then slots, each a short head, the pixels, and the truth as JSON.

Little-endian, 8-byte numbers. Head: magic, version, pid of the writer, slots, bytes a slot, height, width, channels,
bytes a sample, bits, format's name (16 bytes), newest number, and room for the truth. A slot's head: sequence, number,
stamp in ns, length of the truth. Frame n lies in slot n mod slots. The sequence is 2 n while the slot is whole and
odd while it is written (a sequence lock: Lameter, Linux seqlock.h, 2005): who reads 2 n before and after has read
frame n and nothing else.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path("/dev/shm")  # where Linux has POSIX shared memory
MAGIC, VERSION = 0x424647524E495231, 1
HEAD = struct.Struct("<10Q16sQQ")
NEWEST = struct.Struct("<Q")
NEWEST_AT = 10 * 8 + 16
SLOT = struct.Struct("<4Q")
PAGE = 4096


@dataclass(frozen=True)
class Layout:
    """Of one ring; ``format`` by its GenICam name."""

    pid: int
    slots: int
    height: int
    width: int
    channels: int
    itemsize: int
    bits: int
    format: str
    truth_bytes: int

    @property
    def pixel_bytes(self) -> int:
        return self.height * self.width * self.channels * self.itemsize

    @property
    def slot_bytes(self) -> int:
        whole = PAGE + self.pixel_bytes + self.truth_bytes  # pixels begin on a page
        return -(-whole // PAGE) * PAGE

    @property
    def size(self) -> int:
        return PAGE + self.slots * self.slot_bytes

    def slot(self, number: int) -> int:
        """Where frame ``number`` lies."""
        return PAGE + number % self.slots * self.slot_bytes

    def write(self, memory: memoryview) -> None:
        HEAD.pack_into(
            memory, 0, MAGIC, VERSION, self.pid, self.slots, self.slot_bytes, self.height, self.width,
            self.channels, self.itemsize, self.bits, self.format.encode(), 0, self.truth_bytes,
        )  # fmt: skip

    @classmethod
    def read(cls, memory: memoryview) -> "Layout | None":
        """None where the memory is no ring of this version, or not ready yet."""
        if len(memory) < HEAD.size:
            return None
        magic, version, pid, slots, _, height, width, channels, itemsize, bits, name, _, truth = (
            HEAD.unpack_from(memory, 0)
        )
        if (magic, version) != (MAGIC, VERSION):
            return None
        text = name.rstrip(b"\0").decode()
        return cls(pid, slots, height, width, channels, itemsize, bits, text, truth)

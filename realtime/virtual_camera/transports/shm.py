"""Shared memory: a ring of frames in /dev/shm that readers on this host look into without a copy.

``realtime.virtual_camera.reader.SharedReader`` reads it; realtime.virtual_camera.ring has the layout for others. The
writer never waits: a reader that is slower than the ring is long misses frames, and cannot be handed a torn one.
"""

import contextlib
import json
import os
import re
from collections.abc import Sequence
from multiprocessing import shared_memory

import numpy as np

from interchange.problems import BrightfieldError
from realtime.virtual_camera.frame import Frame
from realtime.virtual_camera.publisher import Publisher
from realtime.virtual_camera.ring import FOLDER, NEWEST, NEWEST_AT, PAGE, SLOT, Layout
from realtime.virtual_camera.transports.base import Transport

SLOTS = 8
MARGIN = 4096  # bytes of truth beyond those of the first frame's: numbers have more or fewer digits


class Shm(Transport):
    meaning = "shared memory on this host, without a copy"

    def __init__(self, publishers: Sequence[Publisher], address: str = "127.0.0.1", port: int = 0) -> None:
        super().__init__(publishers, address, port)
        self.rings: dict[str, Ring] = {}

    def start(self) -> list[str]:
        for name, publisher in self.cameras.items():
            ring = Ring(ring_name(name), publisher.camera.prepare())
            self.rings[name] = ring
            publisher.each(ring.put)
        return [f"shm:{ring.name}   SharedReader({ring.name!r})" for ring in self.rings.values()]

    def stop(self) -> None:
        for ring in self.rings.values():
            ring.close()


def ring_name(camera: str) -> str:
    """``brightfield-Top``."""
    return "brightfield-" + re.sub(r"[^\w.-]+", "_", camera)


class Ring:
    """Where frames like ``first`` are written. BrightfieldError where a living process has a ring of that name."""

    def __init__(self, name: str, first: Frame, slots: int = SLOTS) -> None:
        self.name = name
        pixels = first.pixels
        height, width = pixels.shape[:2]
        told = len(json.dumps(first.truth.record()))
        self.layout = Layout(
            os.getpid(), slots, height, width, first.format.channels, pixels.itemsize, first.format.bits,
            first.format.name, told + told // 2 + MARGIN,
        )  # fmt: skip
        self._memory = _create(name, self.layout.size)
        assert self._memory.buf is not None  # not closed yet
        self._buffer: memoryview = self._memory.buf
        self._open = True
        self.layout.write(self._buffer)

    def put(self, frame: Frame) -> None:
        """Write a frame. BrightfieldError where it has another size or format than the ring."""
        if not self._open:
            return
        layout, number = self.layout, frame.number
        if frame.format.name != layout.format or frame.pixels.nbytes != layout.pixel_bytes:
            raise BrightfieldError(
                f"A ring's frames must stay {layout.width} x {layout.height} px of {layout.format}; got "
                f"{frame.pixels.shape[1]} x {frame.pixels.shape[0]} px of {frame.format.name}. Stream again."
            )
        truth = json.dumps(frame.truth.record()).encode()
        if len(truth) > layout.truth_bytes:
            truth = json.dumps(frame.truth.record(bodies=False)).encode()
        at, begin = layout.slot(number), layout.slot(number) + PAGE
        NEWEST.pack_into(self._buffer, at, 2 * number - 1)
        SLOT.pack_into(self._buffer, at, 2 * number - 1, number, frame.stamp_ns, len(truth))
        place = np.frombuffer(self._buffer, frame.pixels.dtype, frame.pixels.size, begin)
        np.copyto(place.reshape(frame.pixels.shape), frame.pixels)
        end = begin + layout.pixel_bytes
        self._buffer[end : end + len(truth)] = truth
        NEWEST.pack_into(self._buffer, at, 2 * number)
        NEWEST.pack_into(self._buffer, NEWEST_AT, number)

    def close(self) -> None:
        """Take the name away; whoever looks in still can."""
        if self._open:
            self._open = False
            NEWEST.pack_into(self._buffer, 0, 0)  # no magic: the ring has ended
            self._memory.close()
            self._memory.unlink()


def _create(name: str, size: int) -> shared_memory.SharedMemory:
    """A new segment, in place of one whose writer is gone."""
    try:
        return shared_memory.SharedMemory(name, create=True, size=size)
    except FileExistsError:
        # not by SharedMemory: Python's resource tracker would take the name away from whoever has it
        with contextlib.suppress(FileNotFoundError), open(FOLDER / name, "rb") as file:
            layout = Layout.read(memoryview(file.read(PAGE)))
            if layout is not None and _lives(layout.pid):
                raise BrightfieldError(
                    f"Process {layout.pid} streams to the shared memory {name} already; stop it, or name another "
                    "camera."
                ) from None
        (FOLDER / name).unlink(missing_ok=True)
        return shared_memory.SharedMemory(name, create=True, size=size)
    except OSError as error:
        why = error.strerror or str(error)
        raise BrightfieldError(f"{size / 1e6:.0f} MB of shared memory cannot be had: {why}.") from None


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True

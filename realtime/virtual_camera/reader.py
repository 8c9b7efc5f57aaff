"""Reads a ring of shared memory: ``SharedReader("brightfield-Top")``, in any process of the host, without a copy."""

import json
import mmap
import time
from collections.abc import Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np

from interchange.problems import BrightfieldError
from realtime.virtual_camera.ring import FOLDER, NEWEST, NEWEST_AT, PAGE, SLOT, Layout

NAP = 2e-4  # s between looks: a fraction of any frame's period


@dataclass(frozen=True, eq=False)
class SharedFrame:
    """``pixels`` (H, W) or (H, W, 3), read-only, in the ring itself: whole as long as ``whole`` says so after use."""

    number: int
    stamp_ns: int
    pixels: np.ndarray
    reader: "SharedReader"

    @property
    def whole(self) -> bool:
        """Whether the writer has not come round to this slot since."""
        return self.reader.sequence(self.number) == 2 * self.number

    def copy(self) -> np.ndarray | None:
        """The pixels for keeps; None where they were overwritten before the copy was done."""
        pixels = self.pixels.copy()
        return pixels if self.whole else None

    def truth(self) -> dict[str, Any] | None:
        """The record of the frame (realtime.virtual_camera.frame); None where it was overwritten."""
        return self.reader.truth(self.number)


class SharedReader:
    """``lost`` counts frames that were written while the reader was busy. BrightfieldError where no camera streams
    under that name (within ``timeout`` s)."""

    def __init__(self, name: str, timeout: float = 0.0) -> None:
        self.name, self.latest, self.got, self.lost = name, 0, 0, 0
        self._closed = False
        until = time.monotonic() + timeout
        while (layout := self._attach()) is None:
            if time.monotonic() >= until:
                raise BrightfieldError(f'No camera streams to the shared memory "{name}" on this host.')
            time.sleep(0.02)
        self.layout = layout

    def _attach(self) -> Layout | None:
        try:
            with open(FOLDER / self.name, "rb") as file:
                self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (FileNotFoundError, ValueError):  # not there, or not of its size yet
            return None
        self._memory = memoryview(self._map)
        return Layout.read(self._memory)

    @property
    def ended(self) -> bool:
        """Whether the camera has stopped."""
        return self._closed or NEWEST.unpack_from(self._memory, 0)[0] == 0

    @property
    def newest(self) -> int:
        """Number of the newest frame; 0: none yet."""
        return int(NEWEST.unpack_from(self._memory, NEWEST_AT)[0])

    def next(self, timeout: float = 5.0) -> SharedFrame | None:
        """The newest frame that it has not had; waits for one. None where none came, or the camera has stopped."""
        until = time.monotonic() + timeout
        while True:
            number = self.newest
            if number > self.latest and (frame := self._frame(number)) is not None:
                if self.latest:
                    self.lost += number - self.latest - 1
                self.latest = number
                self.got += 1
                return frame
            if self.ended or time.monotonic() > until:
                return None
            time.sleep(NAP)

    def __iter__(self) -> Iterator[SharedFrame]:
        """Frames until the camera stops."""
        while not self.ended:
            if (frame := self.next(1.0)) is not None:
                yield frame

    def sequence(self, number: int) -> int:
        """Of the slot where that frame lies; 0 where the reader is closed."""
        return 0 if self._closed else int(SLOT.unpack_from(self._memory, self.layout.slot(number))[0])

    def truth(self, number: int) -> dict[str, Any] | None:
        """The record of a frame that is still in the ring."""
        at = self.layout.slot(number)
        sequence, _, _, length = SLOT.unpack_from(self._memory, at)
        begin = at + PAGE + self.layout.pixel_bytes
        text = bytes(self._memory[begin : begin + length])
        if sequence != 2 * number or self.sequence(number) != 2 * number:
            return None
        return dict(json.loads(text))

    def _frame(self, number: int) -> SharedFrame | None:
        layout = self.layout
        at = layout.slot(number)
        sequence, found, stamp, _ = SLOT.unpack_from(self._memory, at)
        if sequence != 2 * number or found != number:
            return None  # the writer was faster
        kind = np.uint8 if layout.itemsize == 1 else np.uint16
        shape = (layout.height, layout.width) + ((layout.channels,) if layout.channels > 1 else ())
        pixels: np.ndarray = np.frombuffer(self._memory, kind, int(np.prod(shape)), at + PAGE).reshape(shape)
        return SharedFrame(number, stamp, pixels, self)

    def close(self) -> None:
        """The memory is given back when the last frame that looks into it is gone."""
        self._closed = True

    def __enter__(self) -> "SharedReader":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

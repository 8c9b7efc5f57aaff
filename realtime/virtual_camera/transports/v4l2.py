"""Video4Linux: frames into the loopback devices of Linux's module v4l2loopback, which programs open as webcams.

Numbers are those of linux/videodev2.h (struct v4l2_capability, v4l2_format, v4l2_pix_format) on 64-bit machines.
"""

import contextlib
import fcntl
import os
import struct
from collections.abc import Sequence
from pathlib import Path

from interchange.problems import BrightfieldError
from realtime.virtual_camera.frame import Frame
from realtime.virtual_camera.properties import FOURCC
from realtime.virtual_camera.publisher import Publisher
from realtime.virtual_camera.transports.base import Transport

DEVICES = Path("/dev")
CAPABILITY = struct.Struct("16s32s32sIII12x")  # driver, card, bus, version, capabilities, of this device
FORMAT = struct.Struct("I4xII4sIIIIIIIII152x")
QUERY_CAPABILITY, SET_FORMAT = 0x80685600, 0xC0D05605
OUTPUT, PROGRESSIVE, SRGB = (
    2,
    1,
    8,
)  # V4L2_BUF_TYPE_VIDEO_OUTPUT (and its capability), V4L2_FIELD_NONE, colour space
MISSING = (
    "V4L2 needs a device of the kernel module v4l2loopback for each camera; {found}. "
    "On Debian or Ubuntu: sudo apt install v4l2loopback-dkms && sudo modprobe v4l2loopback devices={count}."
)


class V4l2(Transport):
    meaning = "Video4Linux, through the module v4l2loopback"

    def __init__(self, publishers: Sequence[Publisher], address: str = "127.0.0.1", port: int = 0) -> None:
        super().__init__(publishers, address, port)
        self._files: list[int] = []
        self._written: dict[str, list[int]] = {name: [0, 0] for name in self.cameras}  # frames, refused ones

    def start(self) -> list[str]:
        devices = loopbacks()
        count = len(self.cameras)
        if len(devices) < count:
            found = f"there are {len(devices)} for {count} cameras" if devices else "there is none"
            raise BrightfieldError(MISSING.format(found=found, count=count))
        for device, (name, publisher) in zip(devices, self.cameras.items(), strict=False):
            file = os.open(device, os.O_RDWR | os.O_NONBLOCK)
            self._files.append(file)
            first = publisher.camera.prepare()
            try:
                fcntl.ioctl(file, SET_FORMAT, bytearray(format_of(first)))
            except OSError as error:
                raise BrightfieldError(
                    f"{device} takes no {first.format.name} of {first.pixels.shape[1]} x {first.pixels.shape[0]} px: "
                    f"{error.strerror}."
                ) from None
            publisher.each(Writer(file, first, self._written[name]))
        return [f"v4l2:{d} ({n})" for d, n in zip(devices, self.cameras, strict=False)]

    def stop(self) -> None:
        for file in self._files:
            os.close(file)
        self._files.clear()

    def clients(self) -> list[dict[str, object]]:
        return [{"client": "v4l2", "camera": n, "got": w[0], "lost": w[1]} for n, w in self._written.items()]


class Writer:
    """Writes frames like ``first``; ``counts``: of those that the device took, and of those that it did not."""

    def __init__(self, file: int, first: Frame, counts: list[int]) -> None:
        self.file, self.shape, self.format, self.counts = file, first.pixels.shape, first.format, counts

    def __call__(self, frame: Frame) -> None:
        """Never waits. BrightfieldError where the frame's size or format has changed."""
        if frame.pixels.shape != self.shape or frame.format != self.format:
            raise BrightfieldError("A V4L2 device's frames must stay of one size and format. Stream again.")
        try:
            os.write(self.file, frame.pixels.tobytes())
            self.counts[0] += 1
        except OSError:  # its buffers are full, or it is being closed
            self.counts[1] += 1


def loopbacks() -> list[Path]:
    """The loopback devices that are there, in order."""
    found = []
    for device in sorted(DEVICES.glob("video*"), key=lambda p: (len(p.name), p.name)):
        with contextlib.suppress(OSError):  # one that cannot be opened, or is no V4L2 device
            file = os.open(device, os.O_RDWR | os.O_NONBLOCK)
            try:
                answer = bytearray(CAPABILITY.size)
                fcntl.ioctl(file, QUERY_CAPABILITY, answer)
                driver, _, _, _, _, able = CAPABILITY.unpack(answer)
                if driver.rstrip(b"\0") == b"v4l2 loopback" and able & OUTPUT:
                    found.append(device)
            finally:
                os.close(file)
    return found


def format_of(frame: Frame) -> bytes:
    """struct v4l2_format of frames like this one."""
    height, width = frame.pixels.shape[:2]
    row = width * frame.format.bytes_per_pixel
    code = FOURCC[frame.format.name].encode()
    return FORMAT.pack(OUTPUT, width, height, code, PROGRESSIVE, row, row * height, SRGB, 0, 0, 0, 0, 0)

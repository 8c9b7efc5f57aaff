"""What every transport is: it is started, says where its cameras are found, and is stopped."""

import ipaddress
from collections.abc import Sequence
from types import TracebackType
from typing import ClassVar, Self

from interchange.problems import BrightfieldError
from realtime.virtual_camera.publisher import Publisher


class Transport:
    """``address`` to bind to, ``port`` or 0 for a free one. What a transport does not need, it does not look at."""

    meaning: ClassVar[str]  # one line for a person
    port: ClassVar[int] = 0  # that its clients expect

    def __init__(self, publishers: Sequence[Publisher], address: str = "127.0.0.1", port: int = 0) -> None:
        self.cameras = {p.name: p for p in publishers}
        self.address, self.asked_port = address, port
        if len(self.cameras) < len(publishers):
            raise BrightfieldError(
                f"Cameras must have names of their own to be streamed; got {', '.join(p.name for p in publishers)}."
            )

    def start(self) -> list[str]:
        """Begin to serve; a line for each camera that says where it is. Raises BrightfieldError where it cannot."""
        raise NotImplementedError

    def stop(self) -> None:
        """End what ``start`` began; clients are let go."""
        raise NotImplementedError

    def clients(self) -> list[dict[str, object]]:
        """``client``, ``camera``, ``got`` and ``lost`` frames of everyone who reads now or has read."""
        return []

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


def is_loopback(address: str) -> bool:
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address == "localhost"


def cannot_bind(error: OSError, address: str, port: int, option: str) -> BrightfieldError:
    why = (error.strerror or str(error)).rstrip(".")
    return BrightfieldError(f"Nothing can be served at {address}:{port}: {why}. Give another {option}.")

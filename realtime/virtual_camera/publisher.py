"""Frames of one camera for many readers: each gets the newest, whoever is slow misses some and is told how many.

The camera's thread never waits for a reader; a reader that hangs costs nothing but its own place.
"""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

from interchange.problems import BrightfieldError
from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.frame import Frame, Truth


@dataclass
class Subscription:
    """One reader's place. ``lost``: frames that came and went while it was busy."""

    publisher: "Publisher"
    name: str
    got: int = 0
    lost: int = 0
    latest: int = 0  # number of the frame that it got last

    def next(self, timeout: float = 5.0) -> Frame | None:
        """The newest frame that it has not had; waits for one. None where none came, or the camera has stopped."""
        frame = self.publisher.after(self.latest, timeout)
        if frame is not None:
            if self.latest:
                self.lost += frame.number - self.latest - 1
            self.latest = frame.number
            self.got += 1
        return frame

    def close(self) -> None:
        self.publisher.leave(self)


class Publisher:
    """Takes frames in a thread of its own from ``start`` to ``stop``.

    ``frames``: how many to take in all, 0 without end. ``kept``: truths that can still be asked for.
    """

    def __init__(self, camera: VirtualCamera, frames: int = 0, kept: int = 1000) -> None:
        self.camera, self.frames = camera, frames
        self.subscriptions: list[Subscription] = []
        self.error: BrightfieldError | None = None
        self.done = threading.Event()
        self._truths: deque[Truth] = deque(maxlen=kept)
        self._frame: Frame | None = None
        self._new = threading.Condition()
        self._thread: threading.Thread | None = None
        self._sinks: list[Callable[[Frame], None]] = []

    @property
    def name(self) -> str:
        """The last part of the camera's prim path, by which a transport calls it."""
        return self.camera.name.rsplit("/", 1)[-1]

    def start(self) -> None:
        """Compile, then take frames."""
        self.camera.prepare()
        self._thread = threading.Thread(target=self._run, name=f"camera {self.name}", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Wakes every reader; releases the camera."""
        self.done.set()
        self.camera.release()
        with self._new:
            self._new.notify_all()
        if self._thread is not None:
            self._thread.join()

    def each(self, sink: Callable[[Frame], None]) -> None:
        """Call ``sink`` with every frame, in the camera's thread: for what is quick and must miss none."""
        self._sinks.append(sink)

    def subscribe(self, name: str) -> Subscription:
        subscription = Subscription(self, name)
        with self._new:
            self.subscriptions.append(subscription)
        return subscription

    def leave(self, subscription: Subscription) -> None:
        with self._new:
            if subscription in self.subscriptions:
                self.subscriptions.remove(subscription)

    def after(self, number: int, timeout: float) -> Frame | None:
        """The newest frame, if its number is greater; waits ``timeout`` s for one."""
        with self._new:
            self._new.wait_for(
                lambda: self.done.is_set() or (self._frame is not None and self._frame.number > number),
                timeout,
            )
            return self._frame if self._frame is not None and self._frame.number > number else None

    @property
    def latest(self) -> Frame | None:
        return self._frame

    def truth(self, number: int = 0) -> Truth | None:
        """Of frame ``number``, while it is kept; 0 is the latest."""
        with self._new:
            if not number:
                return self._truths[-1] if self._truths else None
            first = self._truths[0].number if self._truths else 0
            place = number - first
            return self._truths[place] if 0 <= place < len(self._truths) else None

    def _run(self) -> None:
        try:
            while not self.done.is_set():
                frame = self.camera.take()
                if frame is None:
                    continue  # no trigger came
                self._publish(frame)
        except BrightfieldError as error:
            self.error = error
        finally:
            self.done.set()
            with self._new:
                self._new.notify_all()

    def _publish(self, frame: Frame) -> None:
        for sink in self._sinks:
            sink(frame)
        with self._new:
            self._frame = frame
            self._truths.append(frame.truth)
            self._new.notify_all()
        if self.frames and frame.number >= self.frames:
            self.done.set()

    def __enter__(self) -> "Publisher":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

"""What goes between a renderer and its worker process: jobs and replies, pickled, with their length in front.

Meshes, textures and profiles go over once: in a job they stand as numbers, and the ones that the worker has not
seen yet are sent ahead (``Sender``, ``Receiver``).
"""

import io
import pickle
import struct
import weakref
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np

from interchange.camera import Camera
from interchange.light import Profile
from interchange.material import Texture
from interchange.mesh import Mesh
from interchange.scene import Scene
from offline.settings import CyclesSettings

HEAVY = (Mesh, Texture, Profile)


@dataclass(frozen=True, eq=False)
class Job:
    """One frame. ``truth``: also what stands at the pixel centres (``centres_only``: nothing else); ``lit``: also the
    lamps' visible shares."""

    scene: Scene
    camera: Camera
    settings: CyclesSettings
    truth: bool = False
    lit: bool = False
    per_light: bool = False
    centres_only: bool = False


@dataclass(frozen=True, eq=False)
class Reply:
    """Arrays are files (``numpy.save``) under the same names; see ``offline.frame`` for what they hold."""

    arrays: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    version: str = ""
    error: str = ""


class Sender:
    """Keeps which heavy records the other side holds; forgets those that nobody here refers to any more."""

    def __init__(self) -> None:
        self.keys: dict[int, int] = {}
        self.next_key = 0
        self.dead: list[int] = []

    def pack(self, job: Any) -> bytes:
        ahead: list[tuple[int, Any]] = []
        buffer = io.BytesIO()
        pickler = _Pickler(buffer, self, ahead)
        pickler.dump(job)
        forget, self.dead = self.dead, []
        return pickle.dumps((forget, [(k, _plain(x)) for k, x in ahead], buffer.getvalue()), protocol=5)

    def key(self, record: Any, ahead: list[tuple[int, Any]]) -> int:
        if id(record) not in self.keys:
            key, self.next_key = self.next_key, self.next_key + 1
            self.keys[id(record)] = key
            weakref.finalize(record, self._forget, id(record), key).atexit = False
            ahead.append((key, record))
        return self.keys[id(record)]

    def _forget(self, identity: int, key: int) -> None:
        if self.keys.get(identity) == key:
            del self.keys[identity]
            self.dead.append(key)


class _Pickler(pickle.Pickler):
    def __init__(self, file: BinaryIO, sender: Sender, ahead: list[tuple[int, Any]]) -> None:
        super().__init__(file, protocol=5)
        self.sender, self.ahead = sender, ahead

    def persistent_id(self, record: Any) -> int | None:
        return self.sender.key(record, self.ahead) if isinstance(record, HEAVY) else None


def _plain(record: Any) -> tuple[type, dict[str, Any]]:
    """The declared fields alone, without what has been derived and cached."""
    names = record.__dataclass_fields__
    return type(record), {name: getattr(record, name) for name in names}


class Receiver:
    def __init__(self) -> None:
        self.records: dict[int, Any] = {}

    def unpack(self, message: bytes) -> Any:
        forget, ahead, job = pickle.loads(message)
        for key in forget:
            self.records.pop(key, None)
        for key, (kind, values) in ahead:
            self.records[key] = kind(**values)
        unpickler = pickle.Unpickler(io.BytesIO(job))
        unpickler.persistent_load = self.records.__getitem__  # type: ignore[method-assign]
        return unpickler.load()


def write(stream: BinaryIO, message: bytes) -> None:
    stream.write(struct.pack("<Q", len(message)))
    stream.write(message)
    stream.flush()


def read(stream: BinaryIO) -> bytes | None:
    """The next message; None at the end of the stream."""
    head = stream.read(8)
    if len(head) < 8:
        return None
    (length,) = struct.unpack("<Q", head)
    body = stream.read(length)
    return body if len(body) == length else None


def unwrap_normal(packed: np.ndarray) -> np.ndarray:
    """Unit vectors (..., 3) from the octahedral map that osl/surface.osl writes to [0, 2]²."""
    x, y = packed[..., 0].astype(np.float64) - 1, packed[..., 1].astype(np.float64) - 1
    z = 1 - np.abs(x) - np.abs(y)
    below = z < 0
    x, y = (
        np.where(below, (1 - np.abs(y)) * np.where(x < 0, -1, 1), x),
        np.where(below, (1 - np.abs(x)) * np.where(y < 0, -1, 1), y),
    )
    n = np.stack([x, y, z], axis=-1)
    return n / np.linalg.norm(n, axis=-1, keepdims=True)

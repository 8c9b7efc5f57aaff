"""What lies in the GPU's memory: meshes, textures and photometric profiles, kept as long as a scene refers to them.

Records compare by identity. Every store holds a reference to the record, so that an identity is not reused,
and releases what the latest scenes no longer name.
"""

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import moderngl
import numpy as np

from interchange.light import Profile
from interchange.material import Texture, Wrap
from interchange.mesh import Mesh
from interchange.projector import Projector
from interchange.table import Table
from realtime.closed import is_closed
from realtime.split import Split, edge_lengths, parts, split

VERTEX_FORMAT = "3f 3f 4f 2f"
VERTEX_NAMES = ("position", "normal", "tangent", "uv")
MOST_BOXES = 4096  # of a mesh, by which its distance is found
CULL_FROM = 2000  # faces from which it pays to find out whether a mesh is closed


@dataclass(eq=False)
class Geometry:
    """A mesh on the GPU; ``closed``: its back faces can never be seen from outside."""

    mesh: Mesh
    vertices: moderngl.Buffer
    indices: moderngl.Buffer
    closed: bool
    bounds: np.ndarray  # (2, 3), body frame
    splits: dict[tuple[float, float], Split] = field(default_factory=dict)
    counts: dict[tuple[float, float], int] = field(default_factory=dict)  # of patches

    @cached_property
    def lengths(self) -> np.ndarray:
        """(F, 3) m: of each face's edges."""
        return edge_lengths(self.mesh.vertices, self.mesh.faces)

    @cached_property
    def longest(self) -> np.ndarray:
        """(F,) m: of each face."""
        return np.asarray(self.lengths.max(axis=1, initial=0.0))

    @cached_property
    def longest_of_all(self) -> float:
        return float(self.longest.max(initial=0.0))

    @cached_property
    def boxes(self) -> np.ndarray:
        """(N, 2, 3), body frame: of runs of faces."""
        starts = np.arange(0, len(self.mesh.faces), -(-len(self.mesh.faces) // MOST_BOXES) or 1)
        corners = self.mesh.vertices[self.mesh.faces]
        low = np.minimum.reduceat(corners.min(axis=1), starts)
        return np.stack([low, np.maximum.reduceat(corners.max(axis=1), starts)], axis=1)

    def patches(self, length: float, patch: float) -> int:
        """How many patches ``split`` makes, at most."""
        if self.longest_of_all <= length:
            return 0
        key = _steps(length, patch)
        if key not in self.counts:
            most = parts(self.longest[self.longest > key[0]], key[1])
            self.counts[key] = int((most.astype(float) ** 2).sum())
        return self.counts[key]

    def split(self, context: moderngl.Context, length: float, patch: float) -> Split | None:
        """The faces by whether their edges are longer than ``length``, m; those cut until no edge is longer than
        ``patch``, if that is more (both or a little less). None where no face is to be split."""
        if self.longest_of_all <= length:
            return None
        key = least, most = _steps(length, patch)
        if key not in self.splits:
            rows, counts = vertex_rows(self.mesh), parts(self.lengths, most)
            self.splits[key] = split(context, rows, self.mesh.faces, counts, self.longest > least)
        return self.splits[key]

    def release(self) -> None:
        self.vertices.release()
        self.indices.release()
        for made in self.splits.values():
            made.release()


@dataclass(eq=False)
class Picture:
    """A texture on the GPU, with the numbers by which the shader finds its way in it."""

    record: Texture | Table | Profile | Projector
    texture: moderngl.Texture
    uv_from_st: tuple[float, ...] = ()  # column by column
    wrap: tuple[int, int] = (0, 0)

    def release(self) -> None:
        self.texture.release()


class Uploads:
    """``counts`` says how often each kind of thing was uploaded, for whoever asks whether the cache works."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self.counts: Counter[str] = Counter()
        self._kept: dict[int, Any] = {}
        self._used: set[int] = set()

    def begin(self) -> None:
        self._used.clear()

    def end(self) -> None:
        """Release what was not asked for since ``begin``."""
        for key in [k for k in self._kept if k not in self._used]:
            self._kept.pop(key).release()

    def release(self) -> None:
        self.begin()
        self.end()

    def geometry(self, mesh: Mesh) -> Geometry:
        return self._get(mesh, self._upload_mesh)

    def bounds(self, mesh: Mesh) -> np.ndarray:
        """(2, 3) of an uploaded mesh, body frame."""
        return self.geometry(mesh).bounds

    def picture(self, texture: Texture | Table) -> Picture:
        return self._get(texture, self._upload_texture)

    def beam(self, beam: Profile | Projector) -> Picture:
        upload = self._upload_profile if isinstance(beam, Profile) else self._upload_projector
        return self._get(beam, upload)

    def _get(self, record: Any, upload: Any) -> Any:
        key = id(record)
        self._used.add(key)
        if key not in self._kept:
            self._kept[key] = upload(record)
            self.counts[type(record).__name__.lower()] += 1
        return self._kept[key]

    def _upload_mesh(self, mesh: Mesh) -> Geometry:
        rows = vertex_rows(mesh).astype(np.float32)
        closed = len(mesh.faces) >= CULL_FROM and is_closed(mesh.vertices, mesh.faces)
        faces = np.ascontiguousarray(mesh.faces, np.int32)
        return Geometry(
            mesh,
            self.context.buffer(rows.tobytes() or bytes(48)),
            self.context.buffer(faces.tobytes() or bytes(12)),
            closed,
            mesh.bounds if len(rows) else np.zeros((2, 3)),
        )

    def _upload_texture(self, record: Texture | Table) -> Picture:
        height, width, channels = record.pixels.shape
        data = np.ascontiguousarray(record.pixels, np.float32).tobytes()
        texture = self.context.texture((width, height), channels, data, dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        if isinstance(record, Table):
            return Picture(record, texture)
        order = list(Wrap)
        matrix = tuple(float(x) for x in np.asarray(record.uv_from_st, np.float64).T.ravel())
        return Picture(record, texture, matrix, (order.index(record.wrap[0]), order.index(record.wrap[1])))

    def _upload_profile(self, record: Profile) -> Picture:
        table = np.zeros((len(record.horizontal) + 1, len(record.vertical) + 1), np.float32)
        table[0, 1:], table[1:, 0], table[1:, 1:] = record.vertical, record.horizontal, record.candela
        texture = self.context.texture((table.shape[1], table.shape[0]), 1, table.tobytes(), dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return Picture(record, texture)

    def _upload_projector(self, record: Projector) -> Picture:
        """The image below a row of numbers, four a texel; shaders/projector.glsl reads both."""
        image = np.broadcast_to(record.image.pixels, (*record.image.pixels.shape[:2], 3))
        numbers = record.numbers().reshape(-1, 4)
        table = np.zeros((len(image) + 1, max(image.shape[1], len(numbers)), 4), np.float32)
        table[0, : len(numbers)], table[1:, : image.shape[1], :3] = numbers, image
        texture = self.context.texture((table.shape[1], table.shape[0]), 4, table.tobytes(), dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return Picture(record, texture)


def _steps(length: float, patch: float) -> tuple[float, float]:
    """Few lengths a factor of 2, so that a camera that moves finds what was made; the second is no shorter."""
    least, most = 2.0 ** (np.floor(2 * np.log2([length, patch])) / 2)
    return float(least), max(float(most), float(least))


def vertex_rows(mesh: Mesh) -> np.ndarray:
    """(V, 12) float64, in the order of VERTEX_NAMES."""
    rows = np.zeros((len(mesh.vertices), 12))
    rows[:, :3], rows[:, 3:6] = mesh.vertices, mesh.normals
    rows[:, 6:9], rows[:, 9] = mesh.tangents, handedness(mesh)
    if mesh.uv is not None:
        rows[:, 10:] = mesh.uv
    return rows


def handedness(mesh: Mesh) -> np.ndarray:
    """(V,) +1 where v grows along normal x tangent, -1 where the texture is mirrored: a normal map's green."""
    if mesh.uv is None or not len(mesh.faces):
        return np.ones(len(mesh.vertices))
    uv = mesh.uv[mesh.faces]
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    det = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    total = np.bincount(mesh.faces.ravel(), np.repeat(det, 3), minlength=len(mesh.vertices))
    return np.where(total < 0, -1.0, 1.0)

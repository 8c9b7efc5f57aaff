"""A mesh's faces by the length of their edges: those that a distorting lens shows straight, and those to be split.

Faces whose edges are too long even for the tessellator are cut beforehand, each edge into the same number of parts.
"""

from dataclasses import dataclass

import moderngl
import numpy as np

MOST_CUT = 100_000  # faces that cutting may make of one mesh


@dataclass(eq=False)
class Split:
    """``whole``: indices of the faces that stay whole, None for none; ``vertices`` and ``patches`` of the others;
    ``vertices`` None: the mesh's own."""

    whole: moderngl.Buffer | None
    vertices: moderngl.Buffer | None
    patches: moderngl.Buffer | None

    def release(self) -> None:
        for buffer in (self.whole, self.vertices, self.patches):
            if buffer is not None:
                buffer.release()


def longest_edges(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) of each face."""
    corners = vertices[faces]
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1))


def parts(longest: np.ndarray, length: float, patch: float) -> int:
    """Into how many parts the edges must be cut, so that none is longer than ``patch``; 0 where that would make too
    many faces. ``longest``: of each face, ``length``: of what stays whole."""
    most = float(longest.max(initial=0.0))
    n = 1
    while most > n * patch and most > length:
        n *= 2
        if int((longest > length).sum()) * n * n > MOST_CUT:
            return 0
    return n


def split(context: moderngl.Context, rows: np.ndarray, faces: np.ndarray, long: np.ndarray, n: int) -> Split:
    """``rows`` (V, N) float64 vertices with their attributes; ``long`` (F,) bool: faces to be split, each edge in ``n``
    parts beforehand."""
    kept, coarse = faces[~long], faces[long]
    whole = context.buffer(np.ascontiguousarray(kept, np.int32).tobytes()) if len(kept) else None
    if not len(coarse):
        return Split(whole, None, None)
    if n == 1:
        return Split(whole, None, context.buffer(np.ascontiguousarray(coarse, np.int32).tobytes()))
    weights, pattern = _grid(n)
    # on a shared edge one product is 0, so that the order of the sum makes no difference: both faces cut it alike
    a, b, c = (weights[None, :, i, None] * rows[coarse[:, i], None] for i in range(3))
    cut = (a + b + c) / n
    indices = pattern[None] + len(weights) * np.arange(len(coarse))[:, None, None]
    return Split(
        whole,
        context.buffer(cut.astype(np.float32).tobytes()),
        context.buffer(np.ascontiguousarray(indices, np.int32).tobytes()),
    )


def _grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """The corners of a triangle's n² parts, (n + 1)(n + 2) / 2 barycentric coordinates times n, and the parts."""
    weights = np.array([(n - i - j, i, j) for i in range(n + 1) for j in range(n + 1 - i)], np.float64)
    number = {(int(i), int(j)): k for k, (_, i, j) in enumerate(weights)}
    found = []
    for i in range(n):
        for j in range(n - i):
            found.append((number[i, j], number[i + 1, j], number[i, j + 1]))
            if i + j < n - 1:
                found.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    return weights, np.array(found)
